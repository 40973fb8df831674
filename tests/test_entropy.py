"""Exact joint entropy: against finite differences, closed forms, an independent library, and published numbers."""

import math

import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from data_files import data_file
from graphs import SE2_GROUP, connected_topologies, noises, pose_graphs, random_poses, relabelled
from references import LOG_2_PI_E, entropy_reference
from topobelief.entropy import joint_entropy, joint_entropy_estimate
from topobelief.errors import DisconnectedGraphError, InvalidGraphError
from topobelief.graph.pose_graph import PoseGraph

seeds = st.integers(0, 2**32 - 1)


# Against definitions ----------------------------------------------------------------------------------------------------


def perturbed(group, pose, t, frame):
    """The pose moved by a small tangent: in its own frame, or position and orientation in the world."""
    if frame == "body":
        return group.compose(pose, group.exp(t))
    k = group.position_dim
    turn = group.exp(np.concatenate([np.zeros(k), t[k:]]))
    moved = group.compose(turn, np.concatenate([np.zeros(k), pose[k:]]))
    moved[:k] = pose[:k] + t[:k]
    return moved


def finite_difference_information(graph, frame, step=1e-6):
    """H^T Omega H of all poses, H by central differences of the residuals at predicted measurements."""
    group, kappa = graph.group, graph.tangent_dim
    i, j = graph.edges.T
    measured = group.between(graph.poses[i], graph.poses[j])
    jacobian = np.zeros((graph.num_edges, kappa, graph.num_poses, kappa))
    for node in range(graph.num_poses):
        for axis in range(kappa):
            residuals = []
            for sign in (1, -1):
                poses = graph.poses.copy()
                poses[node] = perturbed(group, poses[node], sign * step * np.eye(kappa)[axis], frame)
                residuals.append(group.residual(measured, group.between(poses[i], poses[j])))
            jacobian[:, :, node, axis] = (residuals[0] - residuals[1]) / (2 * step)
    flat = jacobian.reshape(graph.num_edges, kappa, -1)
    return np.einsum("eax,eab,eby->xy", flat, graph.information, flat, optimize=True)


@pytest.mark.parametrize("frame", ["body", "world"])
@settings(max_examples=30)
@given(data=st.data())
def test_entropy_is_that_of_the_finite_difference_jacobian(frame, data):
    graph = data.draw(pose_graphs(min_poses=2, max_poses=5, max_extra=5, log_ratio=(-1.0, 1.0)))
    length = max(1.0, np.abs(graph.positions).max())
    scaled = graph.with_poses(np.column_stack([graph.positions / length, graph.poses[:, graph.group.position_dim :]]))
    matrix = finite_difference_information(scaled, frame)
    anchor = data.draw(st.integers(0, graph.num_poses - 1))
    free = np.repeat(np.arange(graph.num_poses) != anchor, graph.tangent_dim)
    scale = 1 / np.sqrt(np.diagonal(matrix)[free])
    log_det = np.linalg.slogdet(matrix[np.ix_(free, free)] * scale[:, None] * scale)[1] - 2 * np.log(scale).sum()
    expected = (graph.num_poses - 1) * graph.tangent_dim / 2 * LOG_2_PI_E - log_det / 2
    assert joint_entropy(scaled) == pytest.approx(expected, abs=1e-5)


@given(pose_graphs())
def test_entropy_is_that_of_a_dense_qr(graph):
    estimate = joint_entropy_estimate(graph)
    assert estimate.value == pytest.approx(entropy_reference(graph), rel=1e-9, abs=1e-7)
    assert 0 <= estimate.error < 1e-3


@given(connected_topologies(min_nodes=2, max_extra=0), noises(), seeds)
def test_on_a_tree_only_the_noise_counts(topology, noise, seed):
    """J = (n-1) kappa/2 ln(2 pi e) - 1/2 sum of ln|Omega|: no geometry."""
    rng = np.random.default_rng(seed)
    information = noise.draw(rng, topology.num_edges)
    graph = PoseGraph(
        random_poses(rng, noise.group, topology.edges, topology.num_nodes, noise.length), topology.edges, None, information
    )
    scale = np.sqrt(np.diagonal(information, axis1=1, axis2=2))
    log_dets = np.linalg.slogdet(information / (scale[:, :, None] * scale[:, None, :]))[1] + 2 * np.log(scale).sum(axis=1)
    expected = (graph.num_poses - 1) * graph.tangent_dim / 2 * LOG_2_PI_E - log_dets.sum() / 2
    assert joint_entropy(graph) == pytest.approx(expected, rel=1e-9, abs=1e-7)


def test_one_pose_has_no_entropy():
    assert joint_entropy(PoseGraph([[3, 4, 1]], [], None, np.eye(3))) == 0.0


def test_parallel_measurements_add_their_information():
    graph = PoseGraph([[0, 0, 0], [2, 1, 0.3]], [(0, 1), (0, 1)], None, [np.diag([1, 2, 3]), np.diag([4, 5, 6])])
    assert joint_entropy(graph) == pytest.approx(1.5 * LOG_2_PI_E - 0.5 * math.log(5 * 7 * 9), rel=1e-14)


# Laws -------------------------------------------------------------------------------------------------------------------


@given(pose_graphs(min_poses=2), st.data())
def test_the_anchor_does_not_matter(graph, data):
    """The reference holds either anchor, the package whatever it likes: all the same."""
    one, other = (data.draw(st.integers(0, graph.num_poses - 1)) for _ in range(2))
    found = [joint_entropy(graph, anchor=one), joint_entropy(graph, anchor=other - graph.num_poses)]
    assert found[0] == pytest.approx(found[1], abs=1e-9)
    assert entropy_reference(graph, anchor=one) == pytest.approx(entropy_reference(graph, anchor=other), rel=1e-9, abs=1e-7)


@given(pose_graphs(min_poses=2), seeds)
def test_one_more_measurement_lowers_the_entropy(graph, seed):
    rng = np.random.default_rng(seed)
    edge = rng.choice(graph.num_poses, 2, replace=False)
    information = graph.information[rng.integers(graph.num_edges)]
    more = PoseGraph(
        graph.poses, np.concatenate([graph.edges, [edge]]), None, np.concatenate([graph.information, information[None]])
    )
    before, after = joint_entropy_estimate(graph), joint_entropy_estimate(more)
    assert after.value < before.value + before.error + after.error


@given(pose_graphs(), seeds)
def test_names_order_and_whereabouts_do_not_matter(graph, seed):
    """Relabelled, edges shuffled, and the whole map moved rigidly: the same entropy."""
    rng = np.random.default_rng(seed)
    expected = joint_entropy(graph)
    other = relabelled(graph, rng.permutation(graph.num_poses))
    assert joint_entropy(other) == pytest.approx(expected, rel=1e-10, abs=1e-8)
    order = rng.permutation(graph.num_edges)
    shuffled = PoseGraph(graph.poses, graph.edges[order], None, graph.information[order])
    assert joint_entropy(shuffled) == pytest.approx(expected, rel=1e-10, abs=1e-8)
    motion = graph.group.exp(rng.normal(size=graph.tangent_dim))
    moved = graph.with_poses(graph.group.compose(motion, graph.poses))
    assert joint_entropy(moved) == pytest.approx(expected, rel=1e-10, abs=1e-7)


@given(pose_graphs(min_poses=2, kinds=("isotropic",)), seeds)
def test_with_isotropic_noise_the_direction_of_travel_still_matters_through_the_lever_only(graph, seed):
    """Turning every pose on the spot changes nothing where the noise has no direction."""
    turns = np.random.default_rng(seed).normal(size=(graph.num_poses, graph.tangent_dim))
    turns[:, : graph.group.position_dim] = 0
    turned = graph.with_poses(graph.group.compose(graph.poses, graph.group.exp(turns)))
    assert joint_entropy(turned) == pytest.approx(joint_entropy(graph), rel=1e-10, abs=1e-8)


@given(pose_graphs(min_poses=2), st.floats(-3, 3))
def test_changing_the_unit_of_length_adds_a_constant(graph, decades):
    """Metres to another unit: k (n-1) ln(scale), because differential entropy depends on units."""
    scale, k = 10**decades, graph.group.position_dim
    poses = np.column_stack([scale * graph.positions, graph.poses[:, k:]])
    per_unit = np.concatenate([np.full(k, 1 / scale), np.ones(graph.tangent_dim - k)])
    other = PoseGraph(poses, graph.edges, None, graph.information * per_unit[:, None] * per_unit)
    expected = joint_entropy(graph) + (graph.num_poses - 1) * k * math.log(scale)
    assert joint_entropy(other) == pytest.approx(expected, rel=1e-9, abs=1e-6)


@given(pose_graphs(min_poses=2, groups=(SE2_GROUP,), kinds=("equal", "isotropic")))
def test_a_planar_graph_in_space_adds_what_leaves_the_plane(graph):
    """SE(2) embedded in SE(3): x, y, yaw as before; z, roll and pitch form an independent problem of the same edges."""
    n = graph.num_poses
    half = graph.poses[:, 2] / 2
    poses = np.column_stack([graph.positions, np.zeros((n, 3)), np.sin(half), np.cos(half)])
    w_p, w_r = graph.information[:, 0, 0], graph.information[:, 2, 2]
    information = np.stack([np.diag([p, p, p, r, r, r]) for p, r in zip(w_p, w_r, strict=True)])
    spatial = PoseGraph(poses, graph.edges, None, information)
    # z_j - z_i + (d x phi_i)_z, phi_x, phi_y: rows on (z, phi_x, phi_y) of both poses, dense
    rows = np.zeros((graph.num_edges, 3, n, 3))
    for e, (i, j) in enumerate(graph.edges.tolist()):
        d = graph.positions[j] - graph.positions[i]
        rows[e, :, i] = -np.diag(np.sqrt([w_p[e], w_r[e], w_r[e]]))
        rows[e, 0, i] += np.sqrt(w_p[e]) * np.array([0, -d[1], d[0]])
        rows[e, :, j] = np.diag(np.sqrt([w_p[e], w_r[e], w_r[e]]))
    matrix = rows[:, :, 1:].reshape(3 * graph.num_edges, -1)
    norms = np.linalg.norm(matrix, axis=0)
    triangle = np.linalg.qr(matrix / norms, mode="r")
    out_of_plane = 2 * float(np.log(np.abs(np.diagonal(triangle))).sum() + np.log(norms).sum())
    expected = joint_entropy(graph) + (n - 1) * 1.5 * LOG_2_PI_E - out_of_plane / 2
    assert joint_entropy(spatial) == pytest.approx(expected, rel=1e-9, abs=1e-6)


# Bad input --------------------------------------------------------------------------------------------------------------


def test_unreached_poses_are_named():
    graph = PoseGraph(np.zeros((4, 3)), [(0, 1), (2, 3)], None, np.eye(3))
    with pytest.raises(
        DisconnectedGraphError, match=r"expected a connected graph, got 2 node\(s\) that node 0 does not reach: 2, 3"
    ):
        joint_entropy(graph)


def test_an_anchor_that_is_no_pose_is_refused():
    with pytest.raises(InvalidGraphError, match="expected an anchor from 0 to 1, got 2"):
        joint_entropy(PoseGraph(np.zeros((2, 3)), [(0, 1)], None, np.eye(3)), anchor=2)


# Real graphs ------------------------------------------------------------------------------------------------------------


def read(name):
    from topobelief.io.g2o import read_g2o

    return read_g2o(data_file(name))


@pytest.mark.parametrize(
    ("name", "entropy"),
    [
        ("csail.g2o", -6845.1963),
        ("manhattan3500.g2o", -9687.4586),
        ("city10000.g2o", -46668.7110),
        ("sphere2500.g2o", -18320.8116),
        ("intel.g2o", -6385.7311),
    ],
)
def test_reference_values_at_the_poses_as_filed(name, entropy):
    estimate = joint_entropy_estimate(read(name))
    assert estimate.value == pytest.approx(entropy, abs=1e-4)
    assert estimate.error < 1e-2


@pytest.mark.parametrize(
    "name",
    [
        "csail.g2o",
        "manhattan3500.g2o",
        "city10000.g2o",
        "kitti_05.g2o",
        "parking-garage.g2o",
        "sphere2500.g2o",
        "smallGrid3D.g2o",
    ],
)
def test_agrees_with_gtsam_on_every_file_it_can_eliminate(name):
    graph = read(name)
    assert joint_entropy(graph) == pytest.approx(gtsam_entropy(graph), rel=1e-9)


@pytest.mark.parametrize("name", ["intel.g2o", "ais2klinik.g2o"])
def test_factors_what_gtsam_calls_indeterminate(name):
    graph = read(name)
    estimate = joint_entropy_estimate(graph)
    assert math.isfinite(estimate.value)
    assert estimate.error < 1e-2
    with pytest.raises(RuntimeError, match="Indeterminate linear system"):
        gtsam_entropy(graph)


def gtsam_entropy(graph):
    """J by GTSAM's multifrontal elimination of the factors rebuilt with predicted measurements.

    Relative measurements leave a rigid motion free, so the Schur complement of any one pose is 0: a unit prior on it makes
    that complement I and multiplies the determinant by 1. GTSAM's SE(3) tangents have the rotation first.
    """
    planar = graph.group is SE2_GROUP
    order = np.arange(3) if planar else np.array([3, 4, 5, 0, 1, 2])
    make_pose = (lambda row: gtsam.Pose2(*row)) if planar else _pose3
    values, factors = gtsam.Values(), gtsam.NonlinearFactorGraph()
    poses = [make_pose(row) for row in graph.poses.tolist()]
    for key, pose in enumerate(poses):
        values.insert(key, pose)
    between = gtsam.BetweenFactorPose2 if planar else gtsam.BetweenFactorPose3
    models: dict[bytes, gtsam.noiseModel.Gaussian] = {}
    for (i, j), omega in zip(graph.edges.tolist(), graph.information, strict=True):
        model = models.setdefault(omega.tobytes(), gtsam.noiseModel.Gaussian.Information(omega[np.ix_(order, order)]))
        factors.add(between(i, j, poses[i].between(poses[j]), model))
    linear = factors.linearize(values)
    kappa = graph.tangent_dim
    linear.add(gtsam.JacobianFactor(0, np.eye(kappa), np.zeros(kappa), gtsam.noiseModel.Unit.Create(kappa)))
    log_det = 2 * linear.eliminateMultifrontal().logDeterminant()  # logDeterminant is ln|R|
    return (graph.num_poses - 1) * kappa / 2 * LOG_2_PI_E - log_det / 2


def _pose3(row):
    x, y, z, qx, qy, qz, qw = row
    return gtsam.Pose3(gtsam.Rot3.Quaternion(qw, qx, qy, qz), np.array([x, y, z]))
