"""Redrawn noise: expectations, common draws for common factors, and a choice that shows in the errors."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from compared_plays import compared_run
from topobelief.errors import InvalidInputError
from topobelief.estimation import optimize
from topobelief.graph.pose_graph import PoseGraph
from topobelief.simulation.comparison import (
    HINDSIGHT,
    ComparedRun,
    compared_runs,
    compared_strategy,
    redrawn_errors,
    restricted,
    summarised,
)
from topobelief.simulation.metrics import trajectory_error
from topobelief.simulation.noise import InjectedNoise
from topobelief.simulation.record import RunOptions
from topobelief.simulation.scenario import Goal, Scenario
from topobelief.world import World

NOISE = InjectedNoise.of_ratio(0.35)


@pytest.fixture(scope="module")
def loop() -> PoseGraph:
    """Thirty poses around a square and back at its start, one closure."""
    corners = np.array([(0, 0), (8, 0), (8, 8), (0, 8), (0, 0.5)], dtype=float)
    places = np.concatenate([np.linspace(a, b, 8, endpoint=False) for a, b in pairwise(corners)])
    headings = np.repeat(np.arange(4) * np.pi / 2, 8)
    edges = [*((i, i + 1) for i in range(31)), (31, 0)]
    return PoseGraph(np.column_stack([places, headings]), edges, None, np.eye(3))


def test_redraws_are_estimates_under_noise(loop):
    errors = redrawn_errors(loop, loop.poses, NOISE, num_redraws=3, seed=4, num_poses=(32, 10))
    measured = NOISE.disturbed(loop.measurements, rng=np.random.default_rng([4, 1]))
    estimate = optimize(PoseGraph(loop.poses, loop.edges, measured, NOISE.information)).poses
    assert errors.shape == (3, 2)
    assert errors[1].tolist() == [trajectory_error(estimate, loop.poses), trajectory_error(estimate, loop.poses, num_poses=10)]


def test_graphs_share_the_noise_of_the_factors_that_they_share(loop):
    """Open chains: what is added behind the tenth pose does not change the errors before it."""
    chain = PoseGraph(loop.poses, loop.edges[:-1], None, np.eye(3))
    long, short = (
        redrawn_errors(graph, loop.poses[: graph.num_poses], NOISE, num_redraws=4, seed=0, num_poses=(11,))
        for graph in (chain, restricted(chain, 11))
    )
    np.testing.assert_allclose(long, short, atol=1e-6)


def test_a_closure_lowers_the_expected_error(loop):
    chain = PoseGraph(loop.poses, loop.edges[:-1], None, np.eye(3))
    open_end, closed = (
        redrawn_errors(graph, loop.poses, NOISE, num_redraws=40, seed=1, num_poses=(32,)) for graph in (chain, loop)
    )
    assert closed.mean() < 0.8 * open_end.mean()


@pytest.mark.parametrize("name", ["shortest", "path-3", "spanning_trees:joint", "optimum:error", HINDSIGHT])
def test_what_can_be_compared(name):
    assert compared_strategy(name) == name


@pytest.mark.parametrize(
    ("name", "message"),
    [("shortst", "a strategy of"), ("spanning_trees:entropy", "objective"), ("hindsight:map", 'got "hindsight"')],
)
def test_what_cannot_be_compared(name, message):
    with pytest.raises(InvalidInputError, match=message):
        compared_strategy(name)


def run(seed: int, strategy: str, error: float) -> ComparedRun:
    return compared_run(seed, strategy, error_shared=error, error_all=error)


def test_a_path_of_its_own_is_no_candidate_of_the_others():
    """Around a pillar; whichever strategy comes first, the others choose among the same paths."""
    world = World.from_boxes([(3, 3, 5, 5)], bounds=(0, 0, 8, 8))
    scenario = Scenario("room", world, (1.5, 1.5, 0.0), (Goal((6.5, 1.5), 2), Goal((1.5, 6.5), 3)))
    own, shortest = compared_runs(scenario, RunOptions(), ["roadmap", "path-0"], NOISE, num_redraws=2)
    assert (own.strategy, own.chosen, own.num_candidates) == ("roadmap", 3, 4)
    assert (shortest.strategy, shortest.chosen, shortest.num_candidates) == ("path-0", 0, 3)
    assert own.outcome == shortest.outcome == "arrived"
    assert own.num_shared == shortest.num_shared
    assert own.predicted <= shortest.predicted + 1e-9


def test_a_summary_pairs_runs_by_seed():
    runs = [run(seed, "shortest", error) for seed, error in enumerate((1.0, 2.0, 3.0, 4.0))]
    runs += [run(seed, "spanning_trees", error) for seed, error in enumerate((0.5, 2.0, 3.5, 1.0))]
    shortest, trees = summarised(runs, baseline="shortest")
    assert (shortest.gain, shortest.share_better, shortest.share_same) == (0.0, 0.0, 1.0)
    assert trees.gain == pytest.approx(1 - 1.5 / 2.5)
    assert (shortest.saved, trees.saved) == (0.0, 0.25)
    assert (trees.share_better, trees.share_same) == (0.5, 0.25)
    assert np.isnan(summarised(runs, baseline="random")[0].gain)
