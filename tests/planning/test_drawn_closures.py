"""Values over draws of probable closures: exact for each draw, and no better in the mean than at expected information."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from topobelief import Action, ClosureModel, Planner, PoseGraph, drawn_values, predict_actions
from topobelief.errors import InvalidActionError, InvalidInputError

OMEGA = np.diag([100.0, 100.0, 800.0])
GRAPH = PoseGraph([(float(x), 0.0, 0.0) for x in range(8)], [(i, i + 1) for i in range(7)], None, OMEGA)
PATH = [(7, 0), (7, 1), (0, 1)]


@pytest.mark.parametrize("objective", ["map", "joint"])
def test_the_mean_is_the_expectation_over_all_outcomes_and_bounded_by_jensen(objective: str) -> None:
    chance = 0.3
    edges = [(7, 8), (8, 9), (8, 1), (9, 0), (9, 3)]
    chances = np.array([1, 1, *[chance] * 3])
    poses = [(6.0, 1.0, 0.0), (5.0, 1.0, 0.0)]
    action = Action(poses, edges, chances[:, None, None] * OMEGA, probabilities=chances, cost=3)
    planner = Planner(GRAPH, objective=objective)
    expectation = 0.0
    for made in itertools.product([False, True], repeat=3):
        kept = np.r_[True, True, made]
        value = planner.entropies([Action(poses, np.array(edges)[kept], OMEGA)])[0]
        expectation += value * chance ** sum(made) * (1 - chance) ** (3 - sum(made))
    drawn = drawn_values(planner, action, 2000, rng=np.random.default_rng(0))
    assert drawn.values.shape == (2000,)
    assert len(set(drawn.values.round(9))) <= 8
    assert drawn.mean == pytest.approx(expectation, abs=4 * drawn.std / np.sqrt(2000))
    assert planner.entropies([action])[0] < expectation


def test_the_same_generator_draws_the_same() -> None:
    (action,) = predict_actions(GRAPH, [PATH], closures=ClosureModel(max_per_pose=2, probability=0.4))
    planner = Planner(GRAPH, objective="map")
    one, two = (drawn_values(planner, action, 5, rng=np.random.default_rng(3)) for _ in range(2))
    assert one.values.tolist() == two.values.tolist()
    assert one.std > 0


def test_what_is_certain_does_not_spread() -> None:
    (action,) = predict_actions(GRAPH, [PATH], closures=ClosureModel.by_hand())
    planner = Planner(GRAPH)
    drawn = drawn_values(planner, action, 4, rng=np.random.default_rng(0))
    assert drawn.values.tolist() == [planner.entropies([action])[0]] * 4
    assert drawn.std == 0 == drawn_values(planner, action, 1, rng=np.random.default_rng(0)).std


def test_no_draws_and_poses_without_certain_odometry_are_refused() -> None:
    loose = Action([(8, 0, 0)], [(7, 8)], OMEGA / 1e9, probabilities=[1e-9])
    with pytest.raises(InvalidActionError, match="expected every new pose to be attached"):
        drawn_values(Planner(GRAPH), loose, rng=np.random.default_rng(0))
    with pytest.raises(InvalidInputError, match="at least 1 draw"):
        drawn_values(Planner(GRAPH), loose, 0, rng=np.random.default_rng(0))
