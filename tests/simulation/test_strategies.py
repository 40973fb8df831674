"""Strategies choose what they say they choose."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief.candidates.polyline import path_length
from topobelief.candidates.predicted_factors import predict_actions
from topobelief.errors import InvalidInputError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.planner import Planner
from topobelief.simulation.strategies import STRATEGIES, checked_strategy, choose

INFORMATION = np.diag([100.0, 100.0, 800.0])


@pytest.fixture(scope="module")
def question():
    """A drive out, and three ways to a place beside it: straight, along the drive, and far around."""
    poses = [(float(x), 0.0, 0.0) for x in range(11)]
    graph = PoseGraph(poses, [(i, i + 1) for i in range(10)], None, INFORMATION)
    paths = [
        np.array([(10, 0), (10, 5), (1, 5), (1, 1.5)], dtype=float),
        np.array([(10, 0), (9, 1), (1, 1), (1, 1.5)], dtype=float),
        np.array([(10, 0), (10, 9), (1, 9), (1, 1.5)], dtype=float),
    ]
    actions = predict_actions(graph, paths)
    return graph, actions, np.array([path_length(path) for path in paths])


def chosen(question, strategy, *, objective="joint", seed=0):
    return choose(strategy, *question, objective=objective, rng=np.random.default_rng(seed))


@pytest.mark.parametrize("objective", ["joint", "map", "per_pose"])
def test_those_that_evaluate_find_the_least_objective(question, objective):
    graph, actions, _ = question
    best = int(np.argmin(Planner(graph, objective=objective).entropies(actions)))
    assert chosen(question, "standard", objective=objective).action == best
    optimum = chosen(question, "optimum", objective=objective)
    assert optimum.action == best
    assert optimum.decision.proven_optimal


@pytest.mark.parametrize("signature", ["spanning_trees", "von_neumann", "von_neumann_approx"])
def test_a_signature_takes_the_first_of_its_ranking(question, signature):
    choice = chosen(question, signature)
    assert choice.action == choice.decision.ranking[0]
    assert choice.decision.signature == signature
    assert np.isfinite(choice.decision.error_bound)


def test_lengths_alone(question):
    lengths = question[2]
    order = np.argsort(lengths).tolist()
    assert chosen(question, "shortest").action == order[0]
    assert [chosen(question, f"path-{k}").action for k in (1, 2, 3, 4)] == [*order, order[-1]]
    assert chosen(question, "shortest").decision is None


def test_random_draws_all_of_them_and_repeats_itself(question):
    draws = [chosen(question, "random", seed=seed).action for seed in range(30)]
    assert set(draws) == {0, 1, 2}
    assert draws == [chosen(question, "random", seed=seed).action for seed in range(30)]


def test_unknown_strategies_are_refused():
    assert [checked_strategy(name) for name in STRATEGIES] == list(STRATEGIES)
    for name in ("spanning", "path-0", "path-", "path-1x"):
        with pytest.raises(InvalidInputError, match="spanning_trees"):
            checked_strategy(name)
