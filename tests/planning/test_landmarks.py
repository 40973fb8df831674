"""Planning with landmarks: every quantity against dense matrices of the variables that exist, and the theory's inequalities."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import topobelief as tb
from engines import DenseEngine, judge
from graphs import SE2_GROUP, SE3_GROUP, Noise, random_pose_graph
from landmark_graphs import DenseInformation, landmark_sessions, observing_action, with_landmarks
from references import LOG_2_PI_E
from topobelief.errors import DisconnectedGraphError, InvalidActionError, InvalidGraphError, InvalidInputError
from topobelief.graph.action import landmark_ends
from topobelief.graph.fisher import fisher_rows
from topobelief.linalg import laplacian_form
from topobelief.planning.engine import ScratchEngine
from topobelief.planning.incremental_engine import IncrementalEngine

seeds = st.integers(0, 2**32 - 1)
ENGINES = st.sampled_from([ScratchEngine, IncrementalEngine])


def any_pose(graph, seed):
    return int(np.random.default_rng(seed).choice(graph.pose_indices))


def close(values):
    return pytest.approx(np.asarray(values), rel=1e-7, abs=1e-6)


@given(landmark_sessions(log_ratio=(-2.0, 1.0)), ENGINES, seeds)
def test_entropies_are_those_of_the_variables_that_exist(session, kind, seed):
    graph, actions = session.graph, session.actions
    anchor, n = any_pose(graph, seed), graph.num_nodes
    focus = np.random.default_rng(seed).choice(n, 2, replace=False).tolist()
    after = [DenseInformation.of(tb.posterior(graph, action)) for action in actions]
    joint = [each.entropy(held=[anchor]) for each in after]
    free = np.array([n - 1 + action.num_new_poses for action in actions])
    existing = [
        (DenseInformation.of(graph).dimension(held=[anchor]) * LOG_2_PI_E - each.log_det(held=[anchor])) / 2
        + each.log_det(held=range(n)) / 2
        for each in after
    ]
    focused = [each.marginal_entropy(focus, anchor=anchor) for each in after]
    held = tuple(sorted({*focus, anchor}))
    for objective, expected in (
        ("joint", joint),
        ("map", existing),
        ("per_pose", np.array(joint) / free),
        ("focused", focused),
    ):
        found = judge(graph, kind, objective=objective, anchor=anchor, **({"held": held} if objective == "focused" else {}))
        assert found.entropies(actions)[0] == close(expected)


@given(
    landmark_sessions(log_ratio=(-2.0, 1.0)),
    st.sampled_from(["fischer", "fischer_step", "anchored", "chain"]),
    st.sampled_from(["joint", "map", "focused"]),
    st.sampled_from(["cholesky", "hadamard"]),
    ENGINES,
    seeds,
)
def test_bounds_hold_in_every_family(session, family, objective, determinant, kind, seed):
    graph, actions = session.graph, session.actions
    anchor = any_pose(graph, seed)
    settings = {"objective": objective, "bounds": family, "determinant": determinant, "anchor": anchor}
    if objective == "focused":
        settings["held"] = tuple(sorted({anchor, *np.flatnonzero(graph.is_landmark).tolist()}))
    found = judge(graph, kind, **settings)
    lower, upper = found.bounds(actions)
    values, errors = found.entropies(actions)
    slack = errors + 1e-9 * (1 + np.abs(values))
    assert (lower <= values + slack).all()
    assert (values - slack <= upper).all()


@given(
    landmark_sessions(log_ratio=(-2.0, 1.0)),
    st.sampled_from(["joint", "map", "per_pose", "error"]),
    st.sampled_from(["fischer", "anchored", "chain"]),
    ENGINES,
    seeds,
)
def test_all_quantities_are_those_of_an_engine_in_dense_numpy(session, objective, bounds, kind, seed):
    graph, actions = session.graph, session.actions
    bounds = "fischer" if objective == "error" and bounds == "chain" else bounds
    anchor = any_pose(graph, seed)
    found, dense = (judge(graph, each, objective=objective, bounds=bounds, anchor=anchor) for each in (kind, DenseEngine))
    assert found.signatures(actions)[0] == close(dense.signatures(actions)[0])
    assert found.entropies(actions)[0] == close(dense.entropies(actions)[0])
    if kind is IncrementalEngine and objective != "error":
        np.testing.assert_allclose(found.bounds(actions), dense.bounds(actions), rtol=1e-7, atol=1e-6)


@given(landmark_sessions(kinds=("equal", "isotropic"), max_actions=1))
def test_the_signature_is_trees_of_positions_over_all_and_of_rotations_over_poses(session):
    """s_ST = 1/2 [k tau_p + q tau_r] - d/2 ln(2 pi e), minus the upper bound of J with block-isotropic noise."""
    graph = session.graph
    group, poses = graph.group, graph.pose_indices
    k, q = group.position_dim, group.rotation_dim
    between = graph.reading_codes == 0
    tau_p = tb.log_num_spanning_trees(graph.topology, weights=graph.information[:, 0, 0])
    relative = tb.Topology(len(poses), np.searchsorted(poses, graph.edges[between]))
    tau_r = tb.log_num_spanning_trees(relative, weights=graph.information[between, k, k])
    dimension = (k + q) * (len(poses) - 1) + k * graph.num_landmarks
    expected = (k * tau_p + q * tau_r - dimension * LOG_2_PI_E) / 2
    assert tb.spanning_tree_signature(graph.topology, graph.information, kinds=graph.kinds) == close(expected)
    assert tb.entropy_bounds(graph, anchor=int(poses[0])).upper == close(-expected)


@given(landmark_sessions(kinds=("isotropic",), groups=(SE2_GROUP,), max_actions=1), seeds)
def test_in_the_plane_the_lower_bound_has_the_lever_arms_of_observations_on_its_diagonal(session, seed):
    """ln det I <= 2 tau_p + ln det (L_r + D_w), D_w the weighted squared lengths of all edges that leave a pose."""
    graph = session.graph
    anchor, rows = any_pose(graph, seed), fisher_rows(graph)
    weights = graph.information[:, 0, 0]
    D = np.bincount(graph.edges[:, 0], weights=weights * rows.squared_lengths(), minlength=graph.num_nodes)
    poses = [node for node in graph.pose_indices if node != anchor]
    form = laplacian_form(graph.edges, graph.information[:, 2, 2])
    L = np.zeros((graph.num_nodes, graph.num_nodes))
    for (i, j), a, b in zip(form.edges, form.rows_i[:, 0, 0], form.rows_j[:, 0, 0], strict=True):
        L[np.ix_([i, j], [i, j])] += np.outer([a, b], [a, b])
    rotations = (L + np.diag(D))[np.ix_(poses, poses)]
    tau_p = tb.log_num_spanning_trees(graph.topology, weights=weights)
    log_det = 2 * tau_p + (np.linalg.slogdet(rotations)[1] if poses else 0.0)
    dimension = 3 * len(poses) + 2 * graph.num_landmarks
    assert tb.entropy_bounds(graph, anchor=anchor).lower == close(dimension / 2 * LOG_2_PI_E - log_det / 2)


@pytest.fixture(scope="module", params=[SE2_GROUP, SE3_GROUP], ids=["plane", "space"])
def session(request):
    noise = Noise(group=request.param, kind="general", position_weight=100.0, ratio=0.5, length=1.0, spread=0.5)
    rng = np.random.default_rng(3)
    graph = with_landmarks(rng, random_pose_graph(rng, noise, 20, 8), noise, 6)
    return graph, [observing_action(rng, graph, noise) for _ in range(12)]


@pytest.mark.parametrize("engine", ["scratch", "incremental"])
def test_a_proof_with_focus_on_landmarks_alone_finds_the_least_entropy(session, engine):
    graph, actions = session
    focus = np.flatnonzero(graph.is_landmark).tolist()
    planner = tb.Planner(graph, objective="focused", focus=focus, engine=engine)
    values = planner.entropies(actions)
    decision = planner.decide(actions, proof="optimal")
    assert decision.proven_optimal
    assert values[decision.best] == close(values.min())
    expected = [
        DenseInformation.of(tb.posterior(graph, action)).marginal_entropy(focus, anchor=graph.last_pose) for action in actions
    ]
    assert values == close(expected)


def test_a_planner_that_grew_is_one_from_the_start(session):
    graph, actions = session
    driven = next(action for action in actions if action.num_new_poses and landmark_ends(graph, action.edges).any())
    after = tb.posterior(graph, driven)
    further = [
        tb.Action(
            driven.poses[:1] + 0.1, [(after.last_pose, after.num_nodes)], graph.information[0] + np.eye(graph.tangent_dim)
        )
    ]
    grown = tb.Planner(graph, engine="incremental")
    grown.decide(actions)
    assert grown.extended(after).entropies(further) == close(tb.Planner(after, engine="scratch").entropies(further))


def test_from_a_landmark_alone_no_pose_hangs(session):
    graph, _ = session
    landmark, n = int(np.flatnonzero(graph.is_landmark)[0]), graph.num_nodes
    pose, omega = graph.poses[graph.last_pose], np.eye(graph.tangent_dim)
    planner = tb.Planner(graph)
    with pytest.raises(InvalidActionError, match=rf"got new pose {n} without a path of relative poses to it"):
        planner.decide([tb.Action([pose], [(n, landmark)], omega)])
    with pytest.raises(InvalidActionError, match="from a pose to a landmark, got one from a landmark; turn it round"):
        planner.decide([tb.Action([pose], [(graph.last_pose, n), (landmark, n)], omega)])
    partial = np.diag(1.0 * (np.arange(len(omega)) < graph.group.position_dim))
    with pytest.raises(InvalidActionError, match="one that says nothing of rotations"):
        planner.decide([tb.Action([pose], [(graph.last_pose, n)], partial[None])])


def test_what_is_not_for_landmarks_says_so(session):
    graph, _ = session
    landmark = int(np.flatnonzero(graph.is_landmark)[0])
    with pytest.raises(
        InvalidGraphError, match='a graph of poses alone, got 6 landmarks, which have no rotations; use family="fischer"'
    ):
        tb.Planner(graph, bounds="paper")
    with pytest.raises(InvalidGraphError, match="poses alone, got 6 landmarks"):
        tb.entropy_bounds(graph, family="paper", anchor=graph.last_pose)
    with pytest.raises(InvalidGraphError, match=f"expected the anchor to be a pose, got landmark {landmark}"):
        tb.Planner(graph, anchor=landmark)
    with pytest.raises(InvalidInputError, match="focus"):
        tb.Planner(graph, objective="focused", focus=[graph.num_nodes])


def test_where_landmarks_alone_join_poses_there_is_an_entropy_but_no_tree_of_rotations():
    """Two poses that see the same two points: J is finite, tau_r is not."""
    poses = [[0, 0, 0], [2, 0, 1.0], [1, 1, 0], [1, -1, 0]]
    graph = tb.PoseGraph(poses, [(0, 2), (0, 3), (1, 2), (1, 3)], None, np.eye(3), ["pose", "pose", "landmark", "landmark"])
    assert tb.joint_entropy(graph) == pytest.approx(DenseInformation.of(graph).entropy(held=[0]), abs=1e-9)
    with pytest.raises(DisconnectedGraphError, match="expected a connected graph of relative poses, landmarks left out"):
        tb.entropy_bounds(graph)
    with pytest.raises(DisconnectedGraphError, match="landmarks left out"):
        tb.Planner(graph)
