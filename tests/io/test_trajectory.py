"""Trajectories in TUM and KITTI format become graphs, with the noise and by the rule that are stated."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from topobelief.errors import FileError, InvalidInputError
from topobelief.io.formats import read_graph_file
from topobelief.io.reading import ReadGraph, ReadingOptions

NOISE = (0.02, math.radians(0.5))


def read(text: str, tmp_path: Path, **options) -> ReadGraph:
    path = tmp_path / "poses.txt"
    path.write_text(text)
    return read_graph_file(path, ReadingOptions(**{"noise": NOISE, **options}))


def tum(points: list[tuple[float, float]]) -> str:
    return "# timestamp x y z qx qy qz qw\n" + "".join(f"{0.1 * k} {x} {y} 0 0 0 0 1\n" for k, (x, y) in enumerate(points))


def there_and_back() -> list[tuple[float, float]]:
    """20 m along a corridor and 20 m back, 0.3 m beside, a pose every 0.1 m."""
    return [(0.1 * k, 0.0) for k in range(201)] + [(20 - 0.1 * k, 0.3) for k in range(201)]


def test_a_trajectory_is_odometry_with_the_stated_noise(tmp_path: Path):
    graph, notes = read("0.5 0 0 1 0 0 0 1\n0.6 1 0 1 0 0 0.70710678 0.70710678\n0.7 1 2 1.5 0 0 1 0\n", tmp_path)
    assert graph.poses[:, :3].tolist() == [[0, 0, 1], [1, 0, 1], [1, 2, 1.5]]
    assert graph.edges.tolist() == [[0, 1], [1, 2]]
    np.testing.assert_allclose(graph.measurements[1, :3], [2, 0, 0.5], atol=1e-7)
    np.testing.assert_allclose(np.diag(graph.information[0]), [2500] * 3 + [math.radians(0.5) ** -2] * 3)
    assert notes == (
        "took 3 of 3 poses of a trajectory for a graph with 2 odometry edges and 0 closures by rule; each measured what its "
        "poses say, with standard deviations of 0.02 m and 0.5 degrees",
    )


def test_without_a_stated_noise_it_is_refused_with_what_to_do(tmp_path: Path):
    with pytest.raises(FileError, match=r"noise=\(metres, radians\) .* `topobelief convert FILE graph.g2o --noise M DEG`"):
        read("0 0 0 0 0 0 0 1\n", tmp_path, noise=None)


def test_spacing_keeps_first_last_and_those_between(tmp_path: Path):
    graph, _ = read(tum(there_and_back()), tmp_path, spacing=0.95)
    assert graph.ids[:3].tolist() == [0, 10, 20]
    assert graph.ids[-1] == 401
    steps = np.linalg.norm(np.diff(graph.poses[:, :2], axis=0), axis=1)
    assert (steps[:-1] >= 0.95).all()


def test_closures_come_by_rule_only(tmp_path: Path):
    """Each pose on the way back joins the nearest pose of the way out, but not where the robot has just turned round."""
    graph, _ = read(tum(there_and_back()), tmp_path, spacing=0.5, closure_radius=1.0)
    closures = graph.edges[np.abs(np.diff(graph.edges, axis=1)[:, 0]) > 1]
    new, old = graph.poses[closures[:, 0], :2], graph.poses[closures[:, 1], :2]
    assert (closures[:, 0] > closures[:, 1]).all()
    assert len(closures) == np.sum((graph.ids > 200) & (20 - graph.poses[:, 0] + 20 - graph.poses[:, 0] + 0.3 >= 3))
    np.testing.assert_allclose(np.abs(new - old), np.tile([0, 0.3], (len(new), 1)), atol=0.11)
    assert graph.chi2 == pytest.approx(0, abs=1e-12)
    assert read(tum(there_and_back()), tmp_path, spacing=0.5).graph.num_edges == graph.num_poses - 1


def test_a_place_visited_often_is_joined_to_its_first_visit(tmp_path: Path):
    """However many poses stand in exactly one place, those that the robot has left since are found."""
    laps = [(x, 0.0) for _ in range(200) for x in (0.0, 2.0, 4.0, 2.0)]
    graph, _ = read(tum(laps), tmp_path, spacing=1.0, closure_radius=0.5)
    at_origin = np.flatnonzero(graph.poses[:, 0] == 0)
    assert set(map(tuple, graph.edges.tolist())) >= {(int(pose), 0) for pose in at_origin[1:]}


def kitti(rotations: Rotation, positions: np.ndarray) -> str:
    rows = np.concatenate([rotations.as_matrix(), positions[:, :, None]], axis=2).reshape(-1, 12)
    return "".join(" ".join(map(str, row)) + "\n" for row in rows.tolist())


def test_the_camera_of_kitti_is_turned_upright(tmp_path: Path):
    """10 m forward, then a turn to the right about the camera's y axis, which points down, and 5 m on."""
    yaw = Rotation.from_rotvec([[0, 0, 0], [0, np.pi / 2, 0], [0, np.pi / 2, 0]])
    graph, notes = read(kitti(yaw, np.array([[0, 0, 0], [0, 0, 10.0], [5, -1, 10]])), tmp_path)
    np.testing.assert_allclose(graph.poses[:, :3], [[0, 0, 0], [10, 0, 0], [10, -5, 1]], atol=1e-9)
    np.testing.assert_allclose(Rotation.from_quat(graph.poses[1, 3:]).as_rotvec(), [0, 0, -np.pi / 2], atol=1e-9)
    assert notes[0].startswith("turned the axes of a camera (x right, y down, z forward) to x forward, y left and z up")
    planar, _ = read(kitti(yaw, np.array([[0, 0, 0], [0, 0, 10.0], [5, -1, 10]])), tmp_path, planar=True)
    assert planar.group.name == "SE(2)"


def test_a_body_that_moves_along_x_is_left_as_it_is(tmp_path: Path):
    graph, notes = read(kitti(Rotation.identity(2), np.array([[0, 0, 0], [3.0, 0, 0]])), tmp_path)
    assert graph.poses[1].tolist() == [3, 0, 0, 0, 0, 0, 1]
    assert len(notes) == 1


def test_one_pose_is_a_graph(tmp_path: Path):
    assert read("0 0 0 0 0 0 0 1\n", tmp_path, spacing=2.0, closure_radius=1.0).graph.num_edges == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0 0 0 0 0 0 0 1\n1 2 3\n", r"txt:2: expected finite numbers timestamp x y z qx qy qz qw, got '1 2 3'"),
        ("0 0 0 0 0 0 0 1\n0 nan 0 0 0 0 0 1\n", r"txt:2: expected finite numbers"),
        ("0 0 0 0 0 0 0 2\n", r"txt:1: expected a quaternion of length 1, got one of 2"),
        ("0 1e300 0 0 0 0 0 1\n", r"txt:1: expected positions within 1e\+09 m of the origin"),
        ("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1\n", r"txt:2: expected finite numbers r11 r12 r13 x r21"),
        ("1 0 0 0 0 1 0 0 0 0 -1 0\n", r"txt:1: expected a rotation matrix in columns 1-3, 5-7 and 9-11"),
        ("1 0 0 1e300 0 1 0 0 0 0 1 0\n", r"txt:1: expected a rotation matrix .* and a position within 1e9 m"),
    ],
)
def test_a_wrong_line_is_named(text: str, message: str, tmp_path: Path):
    with pytest.raises(FileError, match=message):
        read(text, tmp_path)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"noise": (0, 1)}, "expected a standard deviation from 1e-06 to 1e\\+06 m, got 0"),
        ({"noise": (0.1, math.nan)}, "rad, got nan"),
        ({"noise": (1, 1, 1)}, "expected two standard deviations, metres and radians, got 3"),
        ({"spacing": -1}, "expected a spacing of at least 0 m, got -1"),
        ({"closure_radius": 0}, "expected a closure radius above 0 m, got 0"),
        (
            {"closure_radius": 2, "spacing": 0.1},
            "expected a spacing of at least a tenth of the closure radius, 0.2 m, got 0.1 m",
        ),
    ],
)
def test_options_are_checked(options, message: str):
    with pytest.raises(InvalidInputError, match=message):
        ReadingOptions(**options)
