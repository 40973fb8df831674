"""What is minimised: joint, map and per-pose entropy against their dense definitions, with bounds and signatures of each."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from graphs import pose_graphs, sessions, shares_isotropic_noise
from references import LOG_2_PI_E, entropy_reference, log_det_reference
from topobelief.graph.action import Action, posterior
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.topology import Topology
from topobelief.planning.planner import Planner
from topobelief.signatures.spanning_trees import log_num_spanning_trees, spanning_tree_signature

OBJECTIVES = ("joint", "map", "per_pose")


def close(value):
    return pytest.approx(value, rel=1e-8, abs=1e-6)


def objective_reference(graph, action, objective):
    """THEORY sections 1 and 11, by dense QR."""
    after = posterior(graph, action)
    joint = entropy_reference(after)
    if objective == "joint":
        return joint
    if objective == "per_pose":
        return joint / max(1, after.num_poses - 1)
    n0, kappa = graph.num_poses, graph.tangent_dim
    gain = log_det_reference(after, "joint") - log_det_reference(after, "joint", held=range(n0))
    return (n0 - 1) * kappa / 2 * LOG_2_PI_E - gain / 2


@given(sessions(max_actions=3))
def test_entropies_are_those_of_the_dense_definitions(session):
    for objective in OBJECTIVES:
        found = Planner(session.graph, objective=objective).entropies(session.actions)
        expected = [objective_reference(session.graph, action, objective) for action in session.actions]
        assert found.tolist() == [close(value) for value in expected], objective


@settings(max_examples=30)
@given(sessions(max_actions=1, log_ratio=(-1.0, 1.0)))
def test_the_map_objective_is_the_entropy_of_the_priors_marginal(session):
    """ln det I - ln det I_nn is the log-determinant of the Schur complement: the new poses marginalised out."""
    graph, action = session.graph, session.actions[0]
    after = posterior(graph, action)
    kappa, n0 = graph.tangent_dim, graph.num_poses
    k = graph.group.position_dim
    length = 10.0 ** np.round(np.log10(max(1e-3, np.abs(after.positions - after.positions[0]).max(initial=0))))
    rows = np.zeros((after.num_edges, kappa, after.num_poses, kappa))
    for e, (i, j) in enumerate(after.edges.tolist()):
        relative = after.group.between(after.poses[j], after.poses[i])
        rows[e, :, i] = -after.group.adjoint(relative)
        rows[e, :, j] = np.eye(kappa)
    rows[..., :k] *= length  # positions in units of `length`: better scaled
    matrix = np.einsum("eanx,eab,ebmy->nxmy", rows, after.information, rows, optimize=True)
    size = (after.num_poses - 1) * kappa
    matrix = matrix[1:, :, 1:].reshape(size, size)
    old = (n0 - 1) * kappa
    marginal = matrix[:old, :old]
    if len(matrix) > old:
        marginal = marginal - matrix[:old, old:] @ np.linalg.solve(matrix[old:, old:], matrix[old:, :old])
    scale = 1 / np.sqrt(np.diagonal(marginal))
    log_det = (
        np.linalg.slogdet(marginal * scale[:, None] * scale)[1] - 2 * np.log(scale).sum() - 2 * (n0 - 1) * k * math.log(length)
    )
    expected = old / 2 * LOG_2_PI_E - log_det / 2
    assert Planner(graph, objective="map").entropies([action])[0] == pytest.approx(expected, rel=1e-6, abs=1e-4)


@settings(max_examples=30)
@given(sessions(), st.sampled_from(["cholesky", "hadamard"]))
def test_bounds_bracket_each_objective_and_cost_adds_to_both(session, determinant):
    costs = np.array([action.cost for action in session.actions])
    for objective in OBJECTIVES:
        for family in ("fischer", "paper") if shares_isotropic_noise(session) else ("fischer",):
            planner = Planner(session.graph, objective=objective, bounds=family, determinant=determinant)
            decision = planner.decide(session.actions)
            J = np.array([objective_reference(session.graph, action, objective) for action in session.actions]) + costs
            slack = 1e-8 * (1 + np.abs(J))
            assert (decision.lower <= J + slack).all(), (objective, family)
            assert (decision.upper >= J - slack).all(), (objective, family)


@given(pose_graphs(), st.integers(1, 5), st.integers(0, 2**32 - 1))
def test_the_map_gains_nothing_without_closures_but_costs_decide(graph, length, seed):
    """Any tree, attached anywhere, leaves J_map as it is: the gain is zero, so the cheaper action is chosen."""
    rng = np.random.default_rng(seed)
    n = graph.num_poses
    poses = graph.poses[rng.integers(n, size=length)].copy()
    poses[:, :2] += rng.normal(size=(length, 2))
    edges = [(int(rng.integers(n + new)), n + new) for new in range(length)]
    omega = graph.information[0] if graph.num_edges else np.eye(graph.tangent_dim)
    wander = Action(poses, edges, omega, cost=2.0)
    stay = Action(poses[:0], [], omega, cost=1.0)
    planner = Planner(graph, objective="map")
    expected = entropy_reference(graph)
    assert planner.entropies([wander, stay]).tolist() == [close(expected), close(expected)]
    decision = planner.decide([wander, stay], proof="optimal")
    assert decision.best == 1
    assert decision.signatures[0] == close(decision.signatures[1])


@settings(max_examples=30)
@given(sessions(min_actions=2), st.floats(-3, 3))
def test_the_map_objective_is_free_of_units(session, decades):
    """In another unit of length all J_map, and s_map, move by one constant; joint entropies move by their poses."""
    graph, scale = session.graph, 10**decades
    k = graph.group.position_dim

    def rescaled(poses, information):
        unit = np.concatenate([np.full(k, 1 / scale), np.ones(graph.tangent_dim - k)])
        return np.column_stack([scale * poses[:, :k], poses[:, k:]]), information * unit[:, None] * unit

    poses, information = rescaled(graph.poses, graph.information)
    other = PoseGraph(poses, graph.edges, None, information)
    actions = []
    for action in session.actions:
        poses, information = rescaled(action.poses, action.information)
        actions.append(Action(poses, action.edges, information, cost=action.cost))
    constant = (graph.num_poses - 1) * k * math.log(scale)
    before, after = (Planner(g, objective="map").decide(a) for g, a in ((graph, session.actions), (other, actions)))
    assert after.signatures.tolist() == [close(value - constant) for value in before.signatures]
    assert after.upper.tolist() == [close(value + constant) for value in before.upper]
    joint_before, joint_after = (Planner(g).entropies(a) for g, a in ((graph, session.actions), (other, actions)))
    moved = [constant + action.num_new_poses * k * math.log(scale) for action in session.actions]
    assert joint_after.tolist() == [close(value + move) for value, move in zip(joint_before, moved, strict=True)]


@settings(max_examples=30)
@given(sessions())
def test_signatures_belong_to_their_objective(session):
    """s_ST; s_ST over the free poses; and s_map: trees of the whole over those with all existing poses contracted to one."""
    graph = session.graph
    for objective in OBJECTIVES:
        decision = Planner(graph, objective=objective).decide(session.actions, proof="none")
        for action, found in zip(session.actions, decision.signatures, strict=True):
            after = posterior(graph, action)
            if after.num_edges == 0:
                assert found == 0
                continue
            s = spanning_tree_signature(after.topology, after.information)
            expected = {"joint": s, "per_pose": s / max(1, after.num_poses - 1), "map": map_signature(graph, after)}[objective]
            assert found == close(expected), objective


def map_signature(graph, after):
    """THEORY section 11, as it is published: 1/2 [k (tau_p - ln det L_p,nn) + q (tau_r - ln det L_r,nn)]."""
    k, q = graph.group.position_dim, graph.group.rotation_dim
    w_p = np.exp(np.linalg.slogdet(after.information[:, :k, :k])[1] / k)
    w_r = np.exp((np.linalg.slogdet(after.information)[1] - k * np.log(w_p)) / q)
    contracted = np.maximum(after.edges - graph.num_poses + 1, 0)
    kept = contracted[:, 0] != contracted[:, 1]
    new_part = Topology(after.num_poses - graph.num_poses + 1, contracted[kept])
    gains = [
        log_num_spanning_trees(after.topology, weights=w) - log_num_spanning_trees(new_part, weights=w[kept])
        for w in (w_p, w_r)
    ]
    return (k * gains[0] + q * gains[1]) / 2


@given(sessions(kinds=("equal", "isotropic")))
def test_with_block_isotropic_noise_the_signature_is_minus_the_upper_bound(session):
    """UB = -s_ST, per pose too; for the map up to its noise-free constant (n0 - 1) kappa/2 ln(2 pi e) and the exact I_nn."""
    decision = Planner(session.graph).decide(session.actions)
    costs = np.array([action.cost for action in session.actions])
    assert decision.upper.tolist() == [close(value) for value in costs - decision.signatures]
    per_pose = Planner(session.graph, objective="per_pose").decide(session.actions)
    assert per_pose.upper.tolist() == [close(value) for value in costs - per_pose.signatures]
