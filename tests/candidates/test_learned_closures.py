"""Learned from a graph's history: how many closures a pose, how far away, how probable."""

from __future__ import annotations

import math

import numpy as np
import pytest

from topobelief import PoseGraph, learn_closures
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
    assert model.radius == pytest.approx(0.1)
    assert model.angle == pytest.approx(0, abs=1e-9)
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
