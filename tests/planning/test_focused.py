"""The entropy of some poses alone: against dense marginals, bounded, and with clear errors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from graphs import SE2_GROUP, SE3_GROUP, Noise, random_pose_graph
from topobelief.errors import InvalidInputError
from topobelief.graph.action import Action, posterior
from topobelief.graph.fisher import fisher_rows
from topobelief.planning.planner import Planner


@pytest.fixture(scope="module", params=[SE2_GROUP, SE3_GROUP], ids=["plane", "space"])
def session(request):
    noise = Noise(group=request.param, kind="general", position_weight=100.0, ratio=0.5, length=1.0, spread=0.5)
    graph = random_pose_graph(np.random.default_rng(3), noise, 12, 6)
    n = graph.num_poses
    omega = graph.information[0]
    place = graph.poses[-1]
    revisit = [Action([place, place], [(n - 1, n), (n, n + 1), (n + 1, old)], omega, label=f"to {old}") for old in range(5)]
    return graph, [Action([], [], omega, label="stay"), *revisit]


def dense_marginal(graph, focus, anchor):
    """Entropy of the poses in focus but the anchor, by the inverse of the whole information matrix."""
    form = fisher_rows(graph).joint()
    kappa, n = graph.tangent_dim, graph.num_poses
    information = np.zeros((n * kappa, n * kappa))
    for (i, j), a, b in zip(form.edges, form.rows_i, form.rows_j, strict=True):
        row = np.zeros((len(a), n * kappa))
        row[:, i * kappa : (i + 1) * kappa], row[:, j * kappa : (j + 1) * kappa] = a, b
        information += row.T @ row
    free = [pose for pose in range(n) if pose != anchor]
    keep = np.concatenate([np.arange(pose * kappa, (pose + 1) * kappa) for pose in free])
    covariance = np.linalg.inv(information[np.ix_(keep, keep)])
    wanted = np.concatenate([np.arange(kappa) + free.index(p) * kappa for p in sorted(set(focus) - {anchor})])
    return 0.5 * (len(wanted) * math.log(2 * math.pi * math.e) + np.linalg.slogdet(covariance[np.ix_(wanted, wanted)])[1])


@pytest.mark.parametrize("engine", ["scratch", "incremental"])
@pytest.mark.parametrize("focus", [[0], [2, 5, 7], list(range(12)), [4, 11]])
def test_it_is_the_entropy_of_the_marginal(session, focus, engine):
    graph, actions = session
    planner = Planner(graph, objective="focused", focus=focus, engine=engine)
    anchor = graph.num_poses - 1
    expected = [dense_marginal(posterior(graph, action), focus, anchor) for action in actions]
    np.testing.assert_allclose(planner.entropies(actions), expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize("bounds", ["fischer", "fischer_step", "anchored", "chain", "auto"])
def test_bounds_hold_and_the_proof_finds_the_best(session, bounds):
    graph, actions = session
    planner = Planner(graph, objective="focused", focus=[1, 2, 3], bounds=bounds)
    exact, decision = planner.entropies(actions), planner.decide(actions)
    assert (decision.lower <= exact + 1e-9).all()
    assert (exact <= decision.upper + 1e-9).all()
    proven = planner.decide(actions, proof="optimal")
    assert exact[proven.best] == pytest.approx(exact.min())
    assert "entropy of the poses in focus" in proven.summary()


def test_without_closures_nothing_is_gained(session):
    graph, actions = session
    n = graph.num_poses
    ahead = Action([graph.poses[-1]], [(n - 1, n)], graph.information[0])
    planner = Planner(graph, objective="focused", focus=[0, 4])
    stay, drive = planner.entropies([actions[0], ahead])
    assert drive == pytest.approx(stay, abs=1e-9)


def test_a_grown_planner_keeps_its_focus(session):
    graph, actions = session
    planner = Planner(graph, objective="focused", focus=[1], anchor=0)
    grown = posterior(graph, actions[1])
    assert planner.extended(grown).entropies([actions[0]]) == pytest.approx(planner.entropies([actions[1]]), abs=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"objective": "focused"}, "expected focus="),
        ({"focus": [1]}, "expected focus="),
        ({"objective": "focused", "focus": []}, "expected at least one pose in focus"),
        ({"objective": "focused", "focus": [99]}, "expected poses in focus from 0 to 11, got 99"),
    ],
)
def test_a_focus_that_makes_no_sense(session, options, message):
    with pytest.raises(InvalidInputError, match=message):
        Planner(session[0], **options)
