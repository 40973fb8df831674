"""The planner decides alike from scratch and by increments, and says what the latter needs."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief.errors import IllConditionedError, InvalidInputError
from topobelief.graph.action import Action
from topobelief.graph.information import block_isotropic
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning import planner as planner_module
from topobelief.planning.decision import Decision
from topobelief.planning.planner import Planner

OMEGA = np.diag([100.0, 100.0, 800.0])


def session(seed: int, *, num_actions: int = 40) -> tuple[PoseGraph, list[Action]]:
    """A wandering prior with closures, and chains hung on its last pose with closures of their own."""
    rng = np.random.default_rng(seed)
    n = 50
    poses = np.column_stack([np.cumsum(rng.normal(size=(n, 2)), axis=0), rng.uniform(-3, 3, n)])
    edges = [(i, i + 1) for i in range(n - 1)] + [tuple(rng.choice(n, 2, replace=False)) for _ in range(12)]
    actions: list[Action] = []
    for _ in range(num_actions):
        length = int(rng.integers(2, 9))
        new = np.column_stack([poses[-1, :2] + np.cumsum(rng.normal(size=(length, 2)), axis=0), rng.uniform(-3, 3, length)])
        chain = [(n - 1 + i, n + i) for i in range(length)]
        closures = [(n + int(rng.integers(length)), int(rng.integers(n))) for _ in range(int(rng.integers(0, 6)))]
        actions.append(Action(new, chain + closures, OMEGA, cost=float(rng.uniform(0, 1))))
    return PoseGraph(poses, edges, None, OMEGA), actions


def decided(engine: str, graph: PoseGraph, actions: list[Action], proof: str, **choices: str) -> Decision:
    return Planner(graph, engine=engine, **choices).decide(actions, proof=proof)


@pytest.mark.parametrize("objective", ["joint", "map", "per_pose"])
@pytest.mark.parametrize("bounds", ["fischer", "paper"])
@pytest.mark.parametrize("proof", ["bounded", "optimal"])
def test_both_engines_decide_alike(objective, bounds, proof):
    graph, actions = session(1)
    scratch = decided("scratch", graph, actions, proof, objective=objective, bounds=bounds)
    increments = decided("incremental", graph, actions, proof, objective=objective, bounds=bounds)
    assert increments.best == scratch.best
    assert increments.ranking.tolist() == scratch.ranking.tolist()
    np.testing.assert_allclose(increments.signatures, scratch.signatures, rtol=1e-9)
    if proof == "bounded":
        assert increments.survivors.tolist() == scratch.survivors.tolist()
        np.testing.assert_allclose(increments.lower, scratch.lower, rtol=1e-9)
        np.testing.assert_allclose(increments.upper, scratch.upper, rtol=1e-9)
        assert increments.error_bound == pytest.approx(scratch.error_bound, rel=1e-9, abs=1e-7)
    else:
        assert increments.proven_optimal
        assert scratch.proven_optimal


@pytest.mark.parametrize("seed", range(5))
def test_a_proof_by_increments_finds_the_least_value(seed):
    graph, actions = session(seed)
    for bounds in ("fischer", "anchored", "chain"):
        planner = Planner(graph, bounds=bounds, engine="incremental")
        values = planner.entropies(actions) + [action.cost for action in actions]
        assert planner.decide(actions, proof="optimal").best == int(np.argmin(values))


def test_anchored_bounds_enclose_and_rule_out_more_than_fischers():
    graph, actions = session(3)
    anchored = Planner(graph, bounds="anchored").decide(actions)
    fischer = Planner(graph).decide(actions)
    exact = Planner(graph).entropies(actions) + [action.cost for action in actions]
    rounding = 1e-9 * np.abs(exact)
    assert (anchored.lower <= exact + rounding).all()
    assert (exact - rounding <= anchored.upper).all()
    assert len(anchored.survivors) < len(fischer.survivors)
    assert anchored.error_bound < fischer.error_bound


def flat(sigma_rotation: float) -> tuple[PoseGraph, list[Action]]:
    """The same session with another noise of rotations."""
    omega = block_isotropic(0.1, sigma_rotation)
    graph, actions = session(6)
    return PoseGraph(graph.poses, graph.edges, None, omega), [
        Action(action.poses, action.edges, omega, cost=action.cost) for action in actions
    ]


def test_the_family_is_chosen_by_what_fischers_bounds_leave_open():
    chosen = {}
    for sigma in (1e-3, 0.3):
        graph, actions = flat(sigma)
        decision = decided("incremental", graph, actions, "optimal", bounds="auto")
        fischer = decided("incremental", graph, actions, "bounded", bounds="fischer")
        chosen[sigma] = decision.bounds, len(fischer.survivors) / len(actions)
        assert decision.best == decided("incremental", graph, actions, "optimal", bounds="fischer").best
        assert decision.proven_optimal
    assert chosen[1e-3][0] == "fischer"
    assert chosen[1e-3][1] < 0.5
    assert chosen[0.3][0] == "chain"
    assert chosen[0.3][1] > 0.5


def test_each_decision_chooses_its_family_anew():
    graph, actions = flat(0.3)
    planner = Planner(graph, bounds="auto", engine="incremental")
    assert planner.decide(actions).bounds == "chain"
    ruled_out = [Action(action.poses, action.edges, action.information, cost=1e3 * n) for n, action in enumerate(actions)]
    assert planner.decide(ruled_out).bounds == "fischer"
    assert planner.decide(actions).bounds == "chain"


def test_from_scratch_fischers_bounds_are_taken_without_a_trial():
    graph, actions = flat(0.3)
    assert Planner(graph, bounds="auto", engine="scratch").decide(actions).bounds == "fischer"


def test_an_action_beyond_double_precision_is_named_by_increments_too():
    graph, actions = session(4, num_actions=3)
    n = graph.num_poses
    far = [[1e14, 0, 0], [2e14, 0, 0]]
    hopeless = Action(far, [(n - 1, n), (n, n + 1), (n + 1, n - 1), (n + 1, 3)], OMEGA, label="hopeless")
    with pytest.raises(IllConditionedError, match=r"action 3 \('hopeless'\)"):
        Planner(graph, engine="incremental").entropies([*actions, hopeless])


def test_without_numba_everything_is_evaluated_from_scratch(monkeypatch):
    monkeypatch.setattr(planner_module, "has_kernels", lambda: False)
    graph, actions = session(5, num_actions=3)
    assert Planner(graph).decide(actions).num_actions == 3
    anchored = Planner(graph, bounds="anchored").decide(actions)
    np.testing.assert_allclose(anchored.upper, anchored.lower, rtol=1e-9)
    with pytest.raises(InvalidInputError, match=r"pip install 'topobelief\[fast\]'"):
        Planner(graph, engine="incremental")
