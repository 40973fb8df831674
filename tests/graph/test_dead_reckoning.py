"""Dead reckoning: poses composed along a spanning tree that prefers odometry."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from graphs import SE2_GROUP, SE3_GROUP, pose_graphs
from topobelief.graph.dead_reckoning import dead_reckoned_poses
from topobelief.graph.pose_graph import PoseGraph


@given(graph=pose_graphs())
def test_consistent_measurements_give_the_poses_back(graph: PoseGraph):
    """Where measurements are what the poses predict, any spanning tree composes to these poses."""
    start = graph.num_poses // 2
    poses = dead_reckoned_poses(
        graph.group, graph.num_poses, graph.edges, graph.measurements, known=[start], known_poses=graph.poses[start][None]
    )
    residuals = graph.group.residual(graph.poses, poses)
    scale = 1 + np.abs(graph.positions).max()
    assert np.abs(residuals).max() < 1e-12 * scale


@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP])
def test_a_chain_is_composed_one_by_one(group):
    """A chain with wrong closures listed first is the obvious loop over its odometry, both ways from the start."""
    rng = np.random.default_rng(0)
    n, start = 300, 117
    steps = group.exp(0.1 * rng.normal(size=(n - 1, group.tangent_dim)))
    odometry = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    backwards = np.arange(n - 1) % 3 == 0
    measured = np.where(backwards[:, None], group.inverse(steps), steps)
    odometry[backwards] = odometry[backwards][:, ::-1]
    closures = np.array([(0, 250), (299, 3)])
    wrong = group.exp(rng.normal(size=(2, group.tangent_dim)))
    poses = dead_reckoned_poses(
        group,
        n,
        np.concatenate([closures, odometry]),
        np.concatenate([wrong, measured]),
        known=[start],
        known_poses=group.identity()[None],
    )
    expected = np.empty_like(poses)
    expected[start] = group.identity()
    for i in range(start, n - 1):
        expected[i + 1] = group.compose(expected[i], steps[i])
    for i in range(start, 0, -1):
        expected[i - 1] = group.compose(expected[i], group.inverse(steps[i - 1]))
    assert np.abs(group.residual(expected, poses)).max() < 1e-12


def test_of_parallel_edges_the_first_counts():
    edges, measured = np.array([(0, 1), (1, 0), (0, 1)]), np.array([[1.0, 0, 0], [5.0, 0, 0], [9.0, 0, 0]])
    poses = dead_reckoned_poses(SE2_GROUP, 2, edges, measured, known=[0], known_poses=np.zeros((1, 3)))
    assert poses[1].tolist() == [1, 0, 0]


def test_known_poses_stay_though_edges_contradict_them():
    """Several poses may be known; each other pose hangs on the one that the tree reaches it from."""
    edges = np.array([(0, 1), (1, 2), (2, 3)])
    known_poses = np.array([[0.0, 0, 0], [10.0, 0, 0]])
    poses = dead_reckoned_poses(SE2_GROUP, 4, edges, np.tile([1.0, 0, 0], (3, 1)), known=[0, 2], known_poses=known_poses)
    assert poses[:, 0].tolist() == [0, 1, 10, 11]


def test_unreached_poses_are_nan():
    edges = np.array([(0, 1), (2, 3)])
    poses = dead_reckoned_poses(SE2_GROUP, 5, edges, np.ones((2, 3)), known=[0], known_poses=np.zeros((1, 3)))
    assert np.isnan(poses).all(axis=1).tolist() == [False, False, True, True, True]
