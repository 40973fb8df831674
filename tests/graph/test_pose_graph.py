"""Pose graphs: immutable, canonical, and refusing what is malformed by name."""

import math

import numpy as np
import pytest
from hypothesis import given

from graphs import pose_graphs
from topobelief.errors import DisconnectedGraphError, InvalidGraphError, InvalidInputError, TopobeliefError
from topobelief.graph.pose_graph import PoseGraph

EYE = np.eye(3)
LINE = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
CHAIN = [(0, 1), (1, 2)]


def quaternions(*rows):
    return [[0, 0, 0, *row] for row in rows]


def test_sizes_and_dimensions():
    graph = PoseGraph(LINE, CHAIN, None, EYE)
    assert (graph.num_poses, graph.num_edges, graph.tangent_dim, graph.group.name) == (3, 2, 3, "SE(2)")
    assert graph.degrees_of_freedom == 0
    assert graph.ids.tolist() == [0, 1, 2]
    assert graph.topology.edges is graph.edges
    spatial = PoseGraph(quaternions((0, 0, 0, 1), (0, 0, 0, 1)), [(0, 1), (0, 1)], None, np.eye(6))
    assert (spatial.tangent_dim, spatial.group.name, spatial.positions.shape, spatial.degrees_of_freedom) == (
        6,
        "SE(3)",
        (2, 3),
        6,
    )


@given(pose_graphs(min_poses=2))
def test_predicted_measurements_leave_no_residual(graph):
    i, j = graph.edges.T
    assert np.allclose(graph.group.between(graph.poses[i], graph.poses[j]), graph.measurements, rtol=0, atol=0)
    root = np.sqrt(np.abs(graph.information).max())
    assert graph.chi2 <= graph.num_edges * (1e-13 * root * (1 + np.abs(graph.positions).max())) ** 2


def test_chi2_is_the_weighted_square_of_the_residual():
    graph = PoseGraph(LINE, CHAIN, [[1, 0, 0], [0.7, 0.2, 0.1]], np.diag([4.0, 9.0, 100.0]))
    c, s = math.cos(0.1), math.sin(0.1)  # the residual of the second edge is seen from its measured pose
    dx, dy = 0.3, -0.2
    x, y = c * dx + s * dy, -s * dx + c * dy
    assert graph.chi2 == pytest.approx(4 * x**2 + 9 * y**2 + 100 * 0.1**2, rel=1e-12)


def test_arrays_are_copied_in_and_read_only():
    poses, edges, information = np.array(LINE, dtype=float), np.array(CHAIN), np.tile(EYE, (2, 1, 1))
    graph = PoseGraph(poses, edges, None, information)
    poses[0], edges[0], information[0] = 9, 2, 7
    assert graph.poses[0].tolist() == [0, 0, 0]
    assert graph.edges.tolist() == [[0, 1], [1, 2]]
    assert graph.information[0].tolist() == EYE.tolist()
    for name in ("poses", "edges", "measurements", "information", "ids"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(graph, name)[0] = 0
    with pytest.raises(AttributeError):
        graph.poses = poses


def test_angles_and_quaternions_become_canonical_and_canonical_ones_keep_every_digit():
    flat = PoseGraph([[0, 0, 0.1], [1, 0, 2 * math.pi + 0.5]], [(0, 1)], None, EYE)
    assert flat.poses[0, 2] == 0.1
    assert flat.poses[1, 2] == pytest.approx(0.5, abs=1e-15)
    q = np.array([0.1, 0.2, -0.3, 0.9])
    spatial = PoseGraph(quaternions(3 * q, -q), [(0, 1)], None, np.eye(6))
    assert np.allclose(spatial.poses[:, 3:], q / np.linalg.norm(q), rtol=0, atol=3e-16)
    again = PoseGraph(spatial.poses, spatial.edges, None, np.eye(6))
    assert np.array_equal(again.poses, spatial.poses)


def test_with_poses_keeps_everything_else():
    graph = PoseGraph(LINE, CHAIN, [[1, 0, 0], [1, 0, 0]], EYE, ids=[7, 3, 5], fixed=(1,))
    moved = graph.with_poses([[0, 0, 0], [1, 1, 0], [2, 2, 0]])
    assert moved.ids.tolist() == [7, 3, 5]
    assert moved.fixed == (1,)
    assert np.array_equal(moved.measurements, graph.measurements)
    assert moved.chi2 > 0 == graph.chi2


def test_one_pose_is_a_graph():
    alone = PoseGraph([[1, 2, 3]], [], None, EYE)
    assert (alone.num_poses, alone.num_edges, alone.chi2, alone.degrees_of_freedom) == (1, 0, 0.0, 0)
    assert PoseGraph([[1, 2, 3]], np.zeros((0, 2), dtype=int), np.zeros((0, 3)), np.zeros((0, 3, 3))).num_edges == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([], CHAIN, None, EYE), r"expected poses of shape \(n, 3 or 7\), got \(0,\)"),
        ((np.zeros((0, 3)), [], None, EYE), "expected at least one pose, got none"),
        (([[0, 0, 0, 0]], [], None, EYE), r"expected poses of shape \(n, 3 or 7\), got \(1, 4\)"),
        (([0, 0, 0], [], None, EYE), r"expected poses of shape \(n, 3 or 7\), got \(3,\)"),
        (([[0, 0, 0], [1, np.nan, 0]], [(0, 1)], None, EYE), "expected finite poses, got nan or inf in row 1"),
        (([[0, 0, 0], [1, np.inf, 0]], [(0, 1)], None, EYE), "expected finite poses, got nan or inf in row 1"),
        (
            (quaternions((0, 0, 0, 1), (0, 0, 0, 0)), [(0, 1)], None, np.eye(6)),
            "expected unit quaternions in poses, got a zero one in row 1",
        ),
        ((LINE, [(0, 1), (1, 3)], None, EYE), r"expected node indices from 0 to 2, got edge 1 = \(1, 3\)"),
        ((LINE, [(0, 1), (1, -1)], None, EYE), r"expected node indices from 0 to 2, got edge 1 = \(1, -1\)"),
        ((LINE, [(0, 1), (1, 1)], None, EYE), r"got self-loop at node 1 \(edge 1\)"),
        ((LINE, CHAIN, [[1, 0, 0]], EYE), r"expected measurements of shape \(2, 3\), got \(1, 3\)"),
        ((LINE, CHAIN, quaternions((0, 0, 0, 1), (0, 0, 0, 1)), EYE), r"expected measurements of shape \(2, 3\), got \(2, 7\)"),
        ((LINE, CHAIN, [[1, 0, 0], [1, 0, np.inf]], EYE), "expected finite measurements, got nan or inf in row 1"),
        ((LINE, CHAIN, None, np.eye(6)), r"expected information of shape \(2, 3, 3\) or \(3, 3\).*got \(6, 6\)"),
        (
            (LINE, CHAIN, None, [EYE, -EYE]),
            "expected a positive definite information matrix, got an indefinite or singular one at edge 1",
        ),
        (
            (LINE, CHAIN, None, [EYE, 0 * EYE]),
            "expected a positive definite information matrix, got an indefinite or singular one at edge 1",
        ),
        (
            (LINE, CHAIN, None, EYE, ["pose", "landmark", "pose"]),
            r"expected an observation to lead from a pose to a landmark, got edge 1 = \(1, 2\) from a landmark",
        ),
        ((LINE, CHAIN, None, EYE, ["pose"] * 7), "kind"),
    ],
)
def test_malformed_graphs_name_what_is_wrong(arguments, message):
    with pytest.raises(InvalidGraphError, match=message):
        PoseGraph(*arguments)


@pytest.mark.parametrize("poses", ["abc", [["a", "b", "c"]], [[0, 0], [1, 0, 0]], [[1j, 0, 0]], None], ids=str)
def test_what_is_not_numbers_is_refused(poses):
    with pytest.raises(TopobeliefError, match="expected poses"):
        PoseGraph(poses, [], None, EYE)


@pytest.mark.parametrize(("ids", "message"), [([1, 2], "expected 3 different ids"), ([1, 2, 2], "expected 3 different ids")])
def test_ids_are_one_each(ids, message):
    with pytest.raises(InvalidGraphError, match=message):
        PoseGraph(LINE, CHAIN, None, EYE, ids=ids)


def test_ids_beyond_64_bits_are_refused_not_wrapped():
    assert PoseGraph(LINE, CHAIN, None, EYE, ids=[0, 1, 2**63 - 1]).ids.tolist() == [0, 1, 2**63 - 1]
    with pytest.raises(InvalidInputError, match=r"expected ids below 2\^63, got 9223372036854775808"):
        PoseGraph(LINE, CHAIN, None, EYE, ids=np.array([0, 1, 2**63], dtype=np.uint64))


def test_fixed_poses_exist():
    with pytest.raises(InvalidGraphError, match="expected fixed poses from 0 to 2, got 3"):
        PoseGraph(LINE, CHAIN, None, EYE, fixed=(3,))


def test_a_disconnected_graph_may_be_built_but_has_no_entropy():
    from topobelief.entropy import joint_entropy

    graph = PoseGraph(LINE, [(0, 1)], None, EYE, ids=[10, 20, 30])
    with pytest.raises(DisconnectedGraphError, match="node 10 does not reach: 30"):
        joint_entropy(graph)
    with pytest.raises(DisconnectedGraphError, match="node 30 does not reach: 10, 20"):
        joint_entropy(graph, anchor=2)


def test_the_last_digit_of_an_asymmetric_matrix_does_not_matter_twice():
    """Omega and its transpose, equal within the tolerance of the check, are one information matrix."""
    omega = np.eye(3)
    omega[0, 1], omega[1, 0] = 0.5, 0.5 + 4e-10
    given_, transposed = (PoseGraph(LINE, CHAIN, None, matrix).information for matrix in (omega, omega.T))
    assert np.array_equal(given_, given_.transpose(0, 2, 1))
    assert np.array_equal(given_, transposed)


X = ord("x") << 56


@pytest.mark.parametrize(
    ("ids", "edges", "end"),
    [
        ([0, 1, 2, 3], [(0, 1), (2, 1), (2, 3), (0, 3)], 3),
        ([10, 20, 30, 45], [(0, 1), (1, 2), (2, 3)], 3),
        ([0, 1, 2, 1007], [(0, 1), (1, 2), (2, 3), (0, 3)], 2),
        ([3, X, X + 1, X + 2], [(0, 1), (1, 2), (2, 3)], 3),
        ([0, 1, 2, 3], [(0, 1), (2, 3), (0, 3)], 1),
        ([0, 1, 2, 3], [(0, 2), (1, 3), (0, 3)], None),
    ],
    ids=["loop", "gaps", "tag", "symbols after a tag", "broken", "no odometry"],
)
def test_the_robot_is_where_odometry_ends(ids, edges, end):
    """The chain follows edges from each pose to the next, and stops at a gap or at an id that is far from all others."""
    poses = [[k, 0, 0] for k in range(4)]
    assert PoseGraph(poses, edges, None, EYE, ids=ids).odometry_end == end


def test_a_single_pose_is_where_the_robot_is():
    assert PoseGraph([[0, 0, 0]], [], None, EYE).odometry_end == 0
