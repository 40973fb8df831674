"""Trajectory errors are free of where a trajectory lies, and measure what is left."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief.errors import InvalidInputError
from topobelief.geometry import SE2_GROUP
from topobelief.graph.pose_graph import PoseGraph
from topobelief.simulation.metrics import (
    aligned,
    alignment,
    chained,
    from_start,
    position_covariances,
    position_errors,
    trajectory_error,
    trajectory_errors,
)

INFORMATION = np.diag([400.0, 100.0, 2500.0])


@pytest.fixture
def truth():
    steps = np.random.default_rng(3).normal([1.0, 0.0, 0.1], [0.1, 0.1, 0.4], size=(40, 3))
    poses = [np.array([2.0, -1.0, 0.7])]
    for step in steps:
        poses.append(SE2_GROUP.compose(poses[-1], step))
    return np.array(poses)


def test_a_rigid_motion_is_no_error(truth):
    T = np.array([5.0, -3.0, 2.5])
    moved = SE2_GROUP.compose(np.broadcast_to(T, truth.shape), truth)
    assert trajectory_error(moved, truth) < 1e-12
    np.testing.assert_allclose(alignment(truth, moved), T, atol=1e-12)
    np.testing.assert_allclose(aligned(moved, truth), truth, atol=1e-12)


def test_no_other_motion_fits_better(truth):
    """The closed form against small changes of it."""
    rng = np.random.default_rng(0)
    estimate = truth + rng.normal(0, 0.3, truth.shape)
    error = trajectory_error(estimate, truth)
    best = alignment(estimate, truth)
    for change in rng.normal(0, 0.01, (50, 3)):
        poses = SE2_GROUP.compose(np.broadcast_to(best + change, estimate.shape), estimate)
        assert np.sqrt(np.mean(np.sum((poses - truth)[:, :2] ** 2, axis=1))) >= error


def test_the_first_poses_are_aligned_by_themselves(truth):
    estimate = truth.copy()
    estimate[20:, 0] += 5.0
    assert trajectory_error(estimate, truth, num_poses=20) < 1e-12
    assert trajectory_error(estimate, truth) > 1.0
    assert position_errors(estimate, truth).shape == (41,)


def test_from_the_start_on_errors_grow_from_nothing(truth):
    """Bent at one joint: before it there is no error, and after it there is."""
    estimate = truth.copy()
    estimate[20:] = SE2_GROUP.compose(
        truth[20], SE2_GROUP.compose(np.array([0.0, 0.0, 0.1]), SE2_GROUP.between(truth[20], truth[20:]))
    )
    moved = SE2_GROUP.compose(np.broadcast_to([5.0, -3.0, 2.5], truth.shape), estimate)
    errors = np.linalg.norm(from_start(moved, truth)[:, :2] - truth[:, :2], axis=1)
    np.testing.assert_allclose(errors[:21], 0, atol=1e-9)
    assert errors[25] > 0.1


def test_counts_must_agree(truth):
    with pytest.raises(InvalidInputError, match="got 41 and 40"):
        trajectory_error(truth[:-1], truth)


def test_chaining_leaves_closures_out(truth):
    edges = [*((i, i + 1) for i in range(40)), (0, 30)]
    exact = PoseGraph(truth, edges, None, INFORMATION)
    wrong = exact.measurements.copy()
    wrong[-1] += 10
    graph = PoseGraph(truth + 0.1, edges, wrong, INFORMATION)
    np.testing.assert_allclose(trajectory_error(chained(graph), truth), 0, atol=1e-12)
    errors = trajectory_errors(graph, exact, truth + np.linspace(0, 1, 41)[:, None], truth)
    assert errors.scan_odometry < 1e-12
    assert errors.wheel_odometry > 0.1


def test_covariances_are_those_of_the_estimates_errors():
    """A chain by hand: position 2 swings with the heading of pose 1; checked against first-order sampling."""
    poses = np.array([(0, 0, 0), (1, 0, np.pi / 2), (1, 2, np.pi / 2)])
    graph = PoseGraph(poses, [(0, 1), (1, 2)], None, INFORMATION)
    rng = np.random.default_rng(1)
    sigma = 0.1 / np.sqrt(np.diagonal(INFORMATION))
    noise = rng.standard_normal((100_000, 2, 3)) * sigma
    steps = SE2_GROUP.compose(np.broadcast_to(graph.measurements, noise.shape), SE2_GROUP.exp(noise))
    ends = SE2_GROUP.compose(steps[:, 0], steps[:, 1])
    sampled = np.cov(ends[:, :2].T) / 0.1**2
    covariances = position_covariances(graph)
    np.testing.assert_allclose(covariances[0], 0)
    np.testing.assert_allclose(covariances[1], np.diag([1 / 100, 1 / 400]), atol=1e-12)  # noise lives in the frame of pose 1
    np.testing.assert_allclose(covariances[2], sampled, atol=2e-4)
