"""Planar graphs saved in 3D become planar again."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from topobelief.entropy import joint_entropy
from topobelief.errors import InvalidGraphError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.projection import projected_to_plane

PLANAR = [0, 1, 5]


def lifted(poses: np.ndarray, height: float, tilt: float = 0.0) -> np.ndarray:
    """Planar poses in space, tilted about their x axes."""
    rotations = Rotation.from_euler("z", poses[:, 2:]) * Rotation.from_euler("x", tilt)
    return np.column_stack([poses[:, :2], np.full(len(poses), height), rotations.as_quat()])


@pytest.fixture
def planar() -> PoseGraph:
    rng = np.random.default_rng(5)
    poses = rng.uniform(-3, 3, size=(6, 3))
    edges = [(k, k + 1) for k in range(5)] + [(5, 0)]
    roots = rng.normal(size=(6, 3, 3))
    measurements = rng.uniform(-3, 3, size=(6, 3))
    return PoseGraph(poses, edges, measurements, roots @ roots.transpose(0, 2, 1) + np.eye(3), ids=range(10, 16), fixed=(2,))


def test_a_lifted_graph_comes_back(planar: PoseGraph):
    """Whatever the information says about height and tilt, also together with the plane."""
    rest = np.random.default_rng(6).normal(size=(6, 6, 6))
    information = rest @ rest.transpose(0, 2, 1) + 40 * np.eye(6)
    information[:, np.array(PLANAR)[:, None], PLANAR] = planar.information + 40 * np.eye(3)
    poses, measured = lifted(planar.poses, 0.7), lifted(planar.measurements, 0.1)
    graph = PoseGraph(poses, planar.edges, measured, information, ids=planar.ids, fixed=planar.fixed)
    back, dropped = projected_to_plane(graph)
    np.testing.assert_allclose(back.poses, planar.poses, atol=1e-12)
    np.testing.assert_allclose(back.measurements, planar.measurements, atol=1e-12)
    np.testing.assert_allclose(back.information, planar.information + 40 * np.eye(3))
    assert (back.ids.tolist(), back.fixed) == (planar.ids.tolist(), (2,))
    assert "heights from 0.7 to 0.7 m, tilts of up to 0 degrees" in dropped


def test_the_entropy_is_that_given_height_and_tilt(planar: PoseGraph):
    """Rows of the information of all poses that belong to heights and tilts are left out, those of the plane stay."""
    information = np.zeros((6, 6, 6))
    information[:, np.array(PLANAR)[:, None], PLANAR] = planar.information
    information[:, [2, 3, 4], [2, 3, 4]] = 1e-9
    graph = PoseGraph(lifted(planar.poses, 0.0), planar.edges, lifted(planar.measurements, 0.0), information)
    assert joint_entropy(projected_to_plane(graph)[0]) == pytest.approx(joint_entropy(planar), abs=1e-9)


def test_what_is_not_upright_is_refused(planar: PoseGraph):
    poses, measured = lifted(planar.poses, 0.0), lifted(planar.measurements, 0.0)
    tilted = poses.copy()
    tilted[3] = lifted(planar.poses[3:4], 0.0, np.deg2rad(90))[0]
    for arguments, message in (
        ((tilted, planar.edges, measured), "expected poses within 30 degrees of upright .*, got pose 13 at 90 degrees"),
        ((poses, planar.edges, lifted(planar.measurements, 0.0, 0.6)), "measurements .*, got the edge 10 - 11 at 34 degrees"),
    ):
        with pytest.raises(InvalidGraphError, match=message):
            projected_to_plane(PoseGraph(*arguments, np.eye(6), ids=planar.ids))
    with pytest.raises(InvalidGraphError, match=r"expected a graph in SE\(3\)"):
        projected_to_plane(planar)
