"""Pose graphs with landmarks: what they hold, what they refuse, and their whitened rows against finite differences."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import topobelief as tb
from graphs import SE2_GROUP, noises, random_pose_graph
from landmark_graphs import DenseInformation, log_det, shuffled, with_landmarks
from topobelief.errors import DisconnectedGraphError, InvalidGraphError
from topobelief.graph.observations import observations_by_kind
from topobelief.graph.readings import BEARING, BEARING_RANGE, POSITION, RANGE

seeds = st.integers(0, 2**32 - 1)
POSES = [[0, 0, 0], [2, 0, 0.5], [1, 3, 2.0]]
EDGES = [(0, 1), (0, 2), (1, 2)]
KINDS = ["pose", "pose", "landmark"]


def test_landmarks_are_counted_apart_and_have_no_rotation():
    graph = tb.PoseGraph(POSES, EDGES, None, np.diag([4.0, 4.0, 9.0]), KINDS)
    assert repr(graph) == "PoseGraph(SE(2), 2 poses, 1 landmark, 3 edges)"
    assert (graph.num_poses, graph.num_landmarks, graph.num_nodes) == (2, 1, 3)
    assert graph.kinds.tolist() == KINDS
    assert graph.poses[2].tolist() == [1, 3, 0]
    assert graph.measurements[1].tolist() == [1, 3, 0]
    assert graph.information[1].tolist() == np.diag([4.0, 4.0, 0.0]).tolist()
    assert graph.degrees_of_freedom == 3 + 2 * 2 - 3 - 2
    assert (graph.odometry_end, graph.last_pose) == (1, 1)
    copy = pickle.loads(pickle.dumps(graph))
    assert (copy.num_landmarks, copy.chi2) == (1, graph.chi2)


@pytest.mark.parametrize(
    ("edges", "kinds", "message"),
    [
        (EDGES, ["pose", "pose", "plane"], r'expected every kind to be "pose" or "landmark", got .*plane.* at node 2'),
        (EDGES, ["pose", "pose"], r"expected a kind per node, shape \(3,\)"),
        ([(0, 1), (2, 0)], KINDS, r"edge 1 = \(2, 0\) from a landmark; turn it round"),
        (EDGES, ["landmark"] * 3, "expected at least one pose, got landmarks alone"),
    ],
)
def test_what_is_no_graph_of_landmarks_is_refused(edges, kinds, message):
    with pytest.raises(InvalidGraphError, match=message):
        tb.PoseGraph(POSES, edges, None, np.eye(3), kinds)


def test_a_reading_has_to_fit_its_edge():
    with pytest.raises(InvalidGraphError, match='expected the reading of edge 0 to be "pose" between poses'):
        tb.PoseGraph(POSES, EDGES, None, np.eye(3), KINDS, readings=["range"] * 3)
    with pytest.raises(InvalidGraphError, match="reading of edge 1 to be one of position, bearing_range, range, bearing, got"):
        tb.PoseGraph(POSES, EDGES, None, np.eye(3), KINDS, readings=["pose"] * 3)
    with pytest.raises(
        InvalidGraphError, match="expected landmark 2 away from pose 0, which reads its range, got both at one place"
    ):
        tb.PoseGraph([[0, 0, 0], [2, 0, 0], [0, 0, 0]], EDGES, None, np.eye(3), KINDS, readings=["pose", "range", "range"])


def test_a_landmark_seen_once_by_range_is_named():
    graph = tb.PoseGraph(POSES, EDGES[:2], None, np.eye(3), KINDS, ids=[5, 6, 70], readings=["pose", "range"])
    message = "expected observations that determine the position of landmark 70, got 1 of range that leave a direction open"
    for asked in (tb.joint_entropy, tb.entropy_bounds, tb.optimize, tb.Planner, tb.expected_errors):
        with pytest.raises(InvalidGraphError, match=message):
            asked(graph)
    fixed = tb.PoseGraph(POSES, EDGES, None, np.eye(3), KINDS, readings=["pose", "range", "range"])
    assert tb.joint_entropy(fixed) == pytest.approx(DenseInformation.of(fixed).entropy(held=[0]))


def test_a_landmark_that_nobody_sees_is_not_reached():
    with pytest.raises(DisconnectedGraphError, match="does not reach: 2"):
        tb.joint_entropy(tb.PoseGraph(POSES, EDGES[:1], None, np.eye(3), KINDS))


@given(noises(log_ratio=(-1.0, 1.0)), seeds)
def test_the_information_matrix_is_that_of_finite_differences(noise, seed):
    """Residuals of all readings, differentiated by numbers alone at poses where they vanish."""
    rng = np.random.default_rng(seed)
    graph = with_landmarks(rng, random_pose_graph(rng, noise, 4, 2), noise, 3)
    matrix, anchor = DenseInformation.of(graph), int(graph.pose_indices[0])
    step = 1e-5
    scale = np.where(matrix.is_position, noise.length, 1.0)
    moves = [(node, column) for node, column in zip(matrix.node, variables(matrix), strict=True)]
    columns = []
    for (node, column), size in zip(moves, scale, strict=True):
        moved = np.zeros((graph.num_nodes, graph.tangent_dim))
        moved[node, column] = step * size
        columns.append((whitened(graph, moved) - whitened(graph, -moved)) / (2 * step * size))
    rows = np.array(columns).T
    free = matrix.node != anchor
    expected = log_det((rows.T @ rows)[np.ix_(free, free)])
    assert matrix.log_det(held=[anchor]) == pytest.approx(expected, rel=1e-5, abs=1e-3)
    assert tb.joint_entropy(graph) == pytest.approx(matrix.entropy(held=[anchor]), rel=1e-7, abs=1e-6)


def variables(matrix):
    """Column of each variable in the block of its node."""
    starts = np.concatenate([[True], np.diff(matrix.node) != 0])
    return np.arange(len(starts)) - np.maximum.accumulate(np.where(starts, np.arange(len(starts)), 0))


def whitened(graph, moves):
    """All residuals after small motions of positions and rotations in the world frame."""
    group, k = graph.group, graph.group.position_dim
    rotation, position = group.rotation_matrix(graph.poses), graph.positions + moves[:, :k]
    if k == 2:
        turns = Rotation.from_rotvec(np.column_stack([np.zeros((len(moves), 2)), moves[:, 2]])).as_matrix()[:, :2, :2]
    else:
        turns = Rotation.from_rotvec(moves[:, 3:]).as_matrix()
    rotation = turns @ rotation
    parts = []
    for e, (i, j) in enumerate(graph.edges):
        seen, measured = rotation[i].T @ (position[j] - position[i]), graph.measurements[e]
        kind = [kind for kind, which in observations_by_kind(graph.reading_codes) if e in which]
        if kind:
            residual = kind[0].residual(measured[None, :k], seen[None])[0]
        else:
            back = group.rotation_matrix(measured).T
            error = back @ rotation[i].T @ rotation[j]
            angle = [np.arctan2(error[1, 0], error[0, 0])] if k == 2 else Rotation.from_matrix(error).as_rotvec()
            residual = np.concatenate([back @ (seen - measured[:k]), angle])
        d = len(residual)
        parts.append(np.linalg.cholesky(graph.noise[e, :d, :d]).T @ residual)
    return np.concatenate(parts)


@pytest.mark.parametrize("kind", [POSITION, BEARING_RANGE, RANGE, BEARING], ids=lambda kind: kind.name)
@pytest.mark.parametrize("k", [2, 3])
def test_jacobians_of_readings_are_finite_differences(kind, k):
    x = np.random.default_rng(1).normal(size=(5, k))
    assert kind.residual(x, x) == pytest.approx(0.0, abs=1e-12)
    found = np.stack(
        [(kind.residual(x, x + 1e-6 * unit) - kind.residual(x, x - 1e-6 * unit)) / 2e-6 for unit in np.eye(k)], axis=2
    )
    assert kind.jacobian(x) == pytest.approx(found, abs=1e-8)
    assert found.shape[1] == kind.dimension(k)


def test_the_angle_of_a_bearing_is_its_residual():
    near, far = np.array([[1.0, 0.0]]), np.array([[-1.0, 0.1]])
    assert BEARING.residual(near, far)[0, 0] == pytest.approx(np.arctan2(0.1, -1.0))
    assert np.linalg.norm(BEARING.residual(np.array([[1.0, 0, 0]]), np.array([[0, 0, 2.0]]))) == pytest.approx(np.pi / 2)


@given(noises(log_ratio=(-1.0, 1.0)), seeds)
def test_the_order_of_nodes_and_edges_does_not_matter(noise, seed):
    rng = np.random.default_rng(seed)
    graph = with_landmarks(rng, random_pose_graph(rng, noise, 4, 2), noise, 3)
    other = shuffled(rng, graph)
    assert tb.joint_entropy(other) == pytest.approx(tb.joint_entropy(graph), rel=1e-8, abs=1e-7)
    assert tb.entropy_bounds(other, anchor=int(other.pose_indices[0])).upper == pytest.approx(
        tb.entropy_bounds(graph, anchor=int(graph.pose_indices[0])).upper, rel=1e-8, abs=1e-7
    )


def test_a_part_keeps_what_lies_inside():
    graph = tb.PoseGraph(
        POSES, EDGES, None, np.eye(3), KINDS, ids=[3, 4, 9], fixed=(1,), readings=["pose", "range", "position"]
    )
    part = graph.part(np.array([1, 2]))
    assert (part.ids.tolist(), part.edges.tolist(), part.fixed) == ([4, 9], [[0, 1]], (0,))
    assert (part.kinds.tolist(), part.readings.tolist()) == (["pose", "landmark"], ["position"])


def test_in_the_plane_information_turns_with_the_pose_that_sees():
    """A pose that looks along y sees a landmark ahead: what it knows well is across, along x of the world."""
    graph = tb.PoseGraph([[0, 0, np.pi / 2], [0, 2, 0]], [(0, 1)], None, np.diag([1.0, 100.0, 0.0])[None], ["pose", "landmark"])
    matrix = DenseInformation.of(graph).matrix
    assert matrix[-2:, -2:] == pytest.approx(np.diag([100.0, 1.0]))
    assert graph.group is SE2_GROUP
