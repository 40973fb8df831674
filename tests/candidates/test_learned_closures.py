"""Learned from a graph's history: how many closures a pose, how far away, how probable."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from topobelief import ClosureModel, PoseGraph, learn_closures
from topobelief.candidates.learned_closures import num_opportunities
from topobelief.errors import InvalidInputError
from topobelief.world import World

OMEGA = np.diag([100.0, 100.0, 800.0])


def rounds(closures: list[tuple[int, int]], num: int = 40) -> PoseGraph:
    """Ten poses out along y = 0, ten back along y = 1, and again, headings as driven."""
    x = np.r_[0:10, 9:-1:-1]
    y, theta = np.repeat([0.0, 1.0], 10), np.repeat([0.0, np.pi], 10)
    once = np.column_stack([x, y, theta])
    poses = np.concatenate([once + np.array([0, 0.1 * lap, 0]) for lap in range(num // 20)])
    return PoseGraph(poses, [*((i, i + 1) for i in range(num - 1)), *closures], None, OMEGA)


def test_counts_radius_and_probability_are_those_of_the_history() -> None:
    """Every second pose of the second lap closes with the same place in the first, 0.1 m away."""
    graph = rounds([(i, i - 20) for i in range(20, 40, 2)])
    model = learn_closures(graph)
    assert (model.max_per_pose, model.min_index_gap, model.num_observed) == (1, 5, 10)
    assert model.radius == pytest.approx(0.5)  # half a step of odometry, for 0.1 m are less
    assert model.angle == pytest.approx(math.radians(15))  # for 0 are less
    wide = learn_closures(rounds([*((i, i - 20) for i in range(20, 39, 2)), (39, 20), (38, 21)]))
    assert wide.radius > 0.7
    assert wide.num_observed == 12


def test_probability_is_the_beta_mean_of_taken_over_opportunities() -> None:
    """All closures at the same distance: the second lap of 20 poses has 20 opportunities, of which 10 were taken."""
    graph = rounds([(i, i - 20) for i in range(20, 40, 2)])
    wider = PoseGraph(
        graph.poses, graph.edges, graph.measurements + [1e-3, 1e-3, 1e-3] * (np.abs(np.diff(graph.edges)) > 1), OMEGA
    )
    model = learn_closures(wider)
    assert model.probability == pytest.approx(11 / 22)


def test_more_closures_a_pose_raise_the_limit() -> None:
    """Three poses make two, one makes one: 7/4 a pose, rounded up."""
    model = learn_closures(rounds([(20, 0), (20, 2), (22, 2), (22, 4), (24, 4), (24, 6), (26, 6)]))
    assert model.max_per_pose == 2


def test_repeated_measurements_of_a_pair_count_once() -> None:
    pairs = [(i, i - 20) for i in range(20, 40, 2)]
    once, twice = learn_closures(rounds(pairs)), learn_closures(rounds([*pairs, *((b, a) for a, b in pairs)]))
    assert (twice.num_observed, twice.max_per_pose) == (10, 1) == (once.num_observed, once.max_per_pose)


def test_walls_take_opportunities_away() -> None:
    graph = rounds([(i, i - 20) for i in range(20, 40, 3)] + [(39, 25)])
    walls = World.from_boxes([(-2, 0.04, 12, 0.06)], (-5, -5, 15, 5))
    assert learn_closures(graph, world=walls).probability > learn_closures(graph).probability


def test_without_closures_the_model_is_cautious() -> None:
    model = learn_closures(rounds([]))
    assert (model.max_per_pose, model.probability, model.radius, model.angle) == (1, 0.5, 2.0, math.pi)
    assert "assumed" in str(model)
    assert learn_closures(rounds([]), probability=0.2).probability == 0.2
    assert learn_closures(PoseGraph([(0, 0, 0)], np.zeros((0, 2), dtype=int), None, np.eye(3))).num_observed == 0


def test_edges_that_skip_a_pose_are_no_closures() -> None:
    """Smoothing over three poses, as some front ends add it, and one closure."""
    skips = [(i, i + 3) for i in range(0, 36)]
    assert learn_closures(rounds(skips)).min_index_gap == 3
    few = learn_closures(rounds([(0, 3), *((i, i - 20) for i in range(20, 40)), *((i, i - 20 + 1) for i in range(20, 39))]))
    assert (few.min_index_gap, few.num_observed) == (5, 39)


def test_a_probability_that_is_none_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="expected probability above 0"):
        learn_closures(rounds([]), probability=0)


def test_of_a_known_rule_the_probability_alone_is_learned() -> None:
    """What the rule says counts like 20 opportunities."""
    graph = rounds([(i, i - 20) for i in range(20, 40, 2)])
    rule = ClosureModel(radius=0.3, max_per_pose=None, probability=0.8)
    assert num_opportunities(graph, rule) == 20
    model = learn_closures(graph, rule=rule)
    assert model == replace(rule, probability=(16 + 10) / (20 + 20), num_observed=10)
    assert learn_closures(rounds([], num=20), rule=rule).probability == pytest.approx(0.8)
    assert str(model).endswith("at least 5 steps apart, 65 % of opportunities, learned from 10 closures of this graph")


def test_a_place_is_left_before_it_can_be_seen_again() -> None:
    """Half a metre a step, closures 3 m apart: 7 steps straight on lead out of reach, however the last digits fall."""
    poses = np.column_stack([np.r_[0:30, 29:-1:-1] / 2, np.r_[[0.0] * 30, [3.0] * 30], np.zeros(60)])
    closures = [(59 - i, i) for i in range(0, 24, 2)]
    graph = PoseGraph(poses, [*((i, i + 1) for i in range(59)), *closures], None, OMEGA)
    model = learn_closures(graph)
    assert model.radius == pytest.approx(3, rel=1e-5)
    assert model.min_index_gap == 7
