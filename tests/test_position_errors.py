"""Expected errors in metres: against dense inverses, GTSAM's marginals and closed forms, whatever pose is held."""

from __future__ import annotations

import math

import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from data_files import RECORDED, data_file
from graphs import SE2_GROUP, SE3_GROUP, Noise, pose_graphs, random_pose_graph, relabelled, sessions
from references import covariance_reference, error_reference
from topobelief.conversions.gtsam import to_gtsam
from topobelief.errors import DisconnectedGraphError, IllConditionedError, InvalidInputError
from topobelief.estimation import optimize
from topobelief.graph.action import posterior
from topobelief.graph.information import block_isotropic
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.g2o import read_g2o
from topobelief.linalg import inverse_traces
from topobelief.position_errors import expected_errors

MODERATE = {"log_ratio": (-2.0, 1.0)}


def relative_std(graph: PoseGraph, goal: int) -> float:
    """With the first pose held, the world turned into its frame, the covariance of a position is that of the relative one."""
    covariance, k = covariance_reference(graph, held=0), graph.group.position_dim
    return math.sqrt(np.trace(covariance[goal, :k, goal, :k]))


@given(sessions(**MODERATE))
def test_they_are_those_of_a_dense_inverse(session):
    for action in (None, *session.actions):
        after = session.graph if action is None else posterior(session.graph, action)
        found = expected_errors(session.graph, action)
        assert found.map_rmse == pytest.approx(error_reference(session.graph, after), rel=1e-7, abs=1e-12)
        assert found.goal_std == pytest.approx(relative_std(after, after.num_poses - 1), rel=1e-7)


@given(pose_graphs(min_poses=3, **MODERATE), st.integers(0, 2**32 - 1))
def test_the_dense_inverse_does_not_depend_on_the_pose_that_is_held(graph, seed):
    held = int(np.random.default_rng(seed).integers(graph.num_poses))
    assert error_reference(graph, graph, held=held) == pytest.approx(error_reference(graph, graph), rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP])
@pytest.mark.parametrize("kind", ["equal", "isotropic", "full"])
def test_compiled_factors_and_those_from_scratch_agree(group, kind, monkeypatch):
    graph = random_pose_graph(np.random.default_rng(3), Noise(group, kind, 100.0, 0.4, 2.0), 60, 25)
    scratch = [expected_errors(graph, sample_size=size) for size in (500, 17)]
    monkeypatch.setattr(inverse_traces, "COMPILED_SIZE", 10)
    for size, expected in zip((500, 17), scratch, strict=True):
        found = expected_errors(graph, sample_size=size)
        assert found.map_rmse == pytest.approx(expected.map_rmse, rel=1e-10)
        assert found.goal_std == pytest.approx(expected.goal_std, rel=1e-10)


@pytest.mark.parametrize("kind", ["equal", "full"])
@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP])
def test_they_are_those_of_gtsam_s_marginals(group, kind):
    """In GTSAM covariances live in the frames of the poses: positions are turned into the world."""
    graph = random_pose_graph(np.random.default_rng(5), Noise(group, kind, 100.0, 0.4, 2.0), 20, 12)
    factors, values = to_gtsam(graph)
    prior = gtsam.PriorFactorPose2 if group is SE2_GROUP else gtsam.PriorFactorPose3
    at = values.atPose2 if group is SE2_GROUP else values.atPose3
    anchored = gtsam.NonlinearFactorGraph(factors)
    anchored.add(prior(0, at(0), gtsam.noiseModel.Isotropic.Sigma(graph.tangent_dim, 1e-5)))
    marginals, n, k = gtsam.Marginals(anchored, values), graph.num_poses, group.position_dim
    first = 0 if group is SE2_GROUP else 3  # GTSAM's tangent of Pose3 begins with the rotation
    joint = marginals.jointMarginalCovariance(list(range(n)))
    rotations = group.rotation_matrix(graph.poses)
    covariance = np.zeros((n, k, n, k))
    for i in range(n):
        for j in range(n):
            block = joint.at(i, j)[first : first + k, first : first + k]
            covariance[i, :, j] = rotations[i] @ block @ rotations[j].T
    found = expected_errors(graph)
    assert found.map_rmse == pytest.approx(error_reference(graph, graph, covariance=covariance), rel=1e-5)
    assert found.goal_std == pytest.approx(math.sqrt(np.trace(covariance[n - 1, :, n - 1])), rel=1e-5)


def test_a_line_with_a_known_bearing():
    """Steps of s along and across: positions walk, and E^2 = 2 s^2 tr(Pi L^-1 Pi) / n but for the turn that is taken out."""
    n, sigma = 9, 0.2
    omega = block_isotropic(sigma, 1e-6)
    line = PoseGraph([[i, 0, 0] for i in range(n)], [(i, i + 1) for i in range(n - 1)], None, omega)
    x = np.arange(n) - (n - 1) / 2
    walk = sigma**2 * np.minimum.outer(np.arange(n), np.arange(n))
    centre = np.eye(n) - 1 / n
    along = np.trace(centre @ walk @ centre)
    across = along - x @ walk @ x / (x @ x)
    found = expected_errors(line)
    assert found.map_rmse == pytest.approx(math.sqrt((along + across) / n), rel=1e-6)
    assert found.goal_std == pytest.approx(sigma * math.sqrt(2 * (n - 1)), rel=1e-6)


@given(pose_graphs(**MODERATE), st.integers(0, 2**32 - 1))
def test_names_do_not_matter_to_the_map(graph, seed):
    permutation = np.random.default_rng(seed).permutation(graph.num_poses)
    assert expected_errors(relabelled(graph, permutation)).map_rmse == pytest.approx(
        expected_errors(graph).map_rmse, rel=1e-6, abs=1e-12
    )


@settings(max_examples=30)
@given(pose_graphs(**MODERATE), st.integers(0, 2**32 - 1))
def test_moving_the_whole_graph_changes_nothing(graph, seed):
    rng = np.random.default_rng(seed)
    by = np.r_[rng.normal(size=2), rng.uniform(-3, 3)] if graph.group is SE2_GROUP else rng.normal(size=7)
    motion = graph.group.normalized(by[None])
    poses = graph.group.compose(np.repeat(motion, graph.num_poses, axis=0), graph.poses)
    moved, found = expected_errors(PoseGraph(poses, graph.edges, None, graph.information)), expected_errors(graph)
    assert moved.map_rmse == pytest.approx(found.map_rmse, rel=1e-6, abs=1e-9 * found.goal_std)
    assert moved.goal_std == pytest.approx(found.goal_std, rel=1e-6)


@settings(max_examples=30)
@given(pose_graphs(min_poses=2, **MODERATE), st.floats(0.1, 10))
def test_errors_scale_with_the_noise_and_with_the_unit(graph, factor):
    found = expected_errors(graph)
    noisier = expected_errors(PoseGraph(graph.poses, graph.edges, None, graph.information / factor**2))
    assert noisier.map_rmse == pytest.approx(factor * found.map_rmse, rel=1e-6, abs=1e-12)
    k = graph.group.position_dim
    unit = np.concatenate([np.full(k, factor), np.ones(graph.tangent_dim - k)])
    poses = np.column_stack([factor * graph.positions, graph.poses[:, k:]])
    scaled = expected_errors(PoseGraph(poses, graph.edges, None, graph.information / np.outer(unit, unit)))
    assert scaled.map_rmse == pytest.approx(factor * found.map_rmse, rel=1e-6, abs=1e-12)
    assert scaled.goal_std == pytest.approx(factor * found.goal_std, rel=1e-6)


@given(sessions(**MODERATE))
def test_no_measurement_makes_a_map_worse(session):
    before = expected_errors(session.graph).map_rmse
    for action in session.actions:
        assert expected_errors(session.graph, action).map_rmse <= before * (1 + 1e-7) + 1e-12


def test_a_single_pose_has_no_error():
    found = expected_errors(PoseGraph([[1, 2, 3]], [], None, np.eye(3)))
    assert (found.map_rmse, found.goal_std) == (0.0, 0.0)


def test_poses_on_one_spot_and_on_a_line_in_space():
    omega = block_isotropic(0.1, 0.1, tangent_dim=6)
    for offset in (0.0, 1.0):
        poses = [[offset * i, 0, 0, 0, 0, 0, 1] for i in range(4)]
        graph = PoseGraph(poses, [(i, i + 1) for i in range(3)], None, omega)
        assert expected_errors(graph).map_rmse == pytest.approx(error_reference(graph, graph), rel=1e-9)


def test_the_recorded_drive():
    graph = read_g2o(data_file(RECORDED))
    found = expected_errors(graph)
    assert found.map_rmse == pytest.approx(error_reference(graph, graph), rel=1e-8)
    assert expected_errors(graph, sample_size=60).map_rmse == pytest.approx(found.map_rmse, rel=0.05)


def test_what_cannot_be_answered_is_said():
    omega = np.eye(3)
    with pytest.raises(DisconnectedGraphError, match="2"):
        expected_errors(PoseGraph([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [(0, 1)], None, omega))
    with pytest.raises(InvalidInputError, match="at least 2 poses, got 1"):
        expected_errors(PoseGraph([[0, 0, 0], [1, 0, 0]], [(0, 1)], None, omega), sample_size=1)
    far = 1e14 * np.random.default_rng(0).normal(size=(4, 3))
    with pytest.raises(IllConditionedError, match=r"expected error of the map.* m\)"):
        expected_errors(PoseGraph(far, [(0, 1), (1, 2), (2, 3), (3, 0)], None, omega))


@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP])
def test_redrawn_measurements_leave_as_much_error_as_expected(group):
    """Monte Carlo where linearisation holds: optimise, align, and take the root mean square over poses and draws."""
    rng, num_draws = np.random.default_rng(11), 150
    graph = random_pose_graph(rng, Noise(group, "full", 1e4, 0.3, 2.0), 16, 8)
    factors = np.linalg.cholesky(np.linalg.inv(graph.information))
    squares = []
    for _ in range(num_draws):
        noise = np.einsum("mab,mb->ma", factors, rng.normal(size=(graph.num_edges, graph.tangent_dim)))
        measured = group.compose(graph.measurements, group.exp(noise))
        estimate = optimize(PoseGraph(graph.poses, graph.edges, measured, graph.information))
        squares.append(np.mean(np.sum(aligned_difference(estimate.positions, graph.positions) ** 2, axis=1)))
    spread = np.std(squares) / math.sqrt(num_draws)
    assert np.mean(squares) == pytest.approx(expected_errors(graph).map_rmse ** 2, abs=4 * spread)
    assert 4 * spread < 0.25 * np.mean(squares)


def aligned_difference(positions, reference):
    """After the best rotation and translation (Kabsch)."""
    p, q = positions - positions.mean(axis=0), reference - reference.mean(axis=0)
    left, _, right = np.linalg.svd(p.T @ q)
    sign = np.ones(p.shape[1])
    sign[-1] = np.sign(np.linalg.det(left @ right))
    return p @ (left * sign) @ right - q
