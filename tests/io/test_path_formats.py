"""Paths in files: what is written is read again, and each error names its line."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from topobelief.candidates.polyline import path_poses
from topobelief.errors import FileError, InvalidInputError
from topobelief.io.path_formats import read_filed_path, read_path, write_path

POSES = path_poses([(0, 0), (2.5, 0), (2.5, -1), (0.1, 0.2)])

# as `ros2 topic echo --once` prints it
ECHOED = """header:
  stamp:
    sec: 1718
    nanosec: 25
  frame_id: map
poses:
- header:
    stamp:
      sec: 0
      nanosec: 0
    frame_id: ''
  pose:
    position:
      x: 1.0
      y: 2.0
      z: 0.0
    orientation:
      x: 0.0
      y: 0.0
      z: 0.7071067811865476
      w: 0.7071067811865476
- header:
    stamp:
      sec: 0
      nanosec: 0
    frame_id: ''
  pose:
    position:
      x: 1.0
      y: 3.5
      z: 0.0
    orientation:
      x: 0.0
      y: 0.0
      z: 0.0
      w: 1.0
---
"""


def written(tmp_path: Path, name: str, text: str) -> Path:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["p.csv", "p.tum", "p.txt", "p.yaml", "p.yml", "p.json", "P.CSV"])
def test_what_is_written_is_read_again(tmp_path, name):
    write_path(tmp_path / name, POSES)
    assert np.abs(read_path(tmp_path / name) - POSES).max() < 1e-12
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_message_is_read_as_ros_prints_it(tmp_path):
    filed = read_filed_path(written(tmp_path, "path.yaml", ECHOED))
    assert filed.in_plane == pytest.approx(np.array([(1, 2, math.pi / 2), (1, 3.5, 0)]))
    assert filed.lines == (7, 22)
    as_json = json.dumps(yaml.safe_load(ECHOED.removesuffix("---\n")), indent="\t")
    assert read_path(written(tmp_path, "path.json", as_json)).tolist() == filed.in_plane.tolist()


@pytest.mark.parametrize("name", ["p.csv", "p.tum", "p.yaml", "p.json"])
def test_what_is_written_in_space_is_read_again(tmp_path, name):
    poses = np.array([(1, 2, -3, 0, 0, 0, 1), (2, 2, 0.5, 0.6, 0, 0, 0.8)])
    write_path(tmp_path / name, poses)
    np.testing.assert_allclose(read_path(tmp_path / name, in_space=True), poses, rtol=0, atol=1e-12)
    np.testing.assert_allclose(read_path(tmp_path / name)[:, :2], poses[:, :2])


def test_a_csv_of_places_in_space_is_upright_and_heads_as_it_goes(tmp_path):
    """Straight up the heading stays."""
    file = written(tmp_path, "path.csv", "x,y,z\n0,0,1\n0,2,1\n0,2,4\n")
    half = math.sqrt(0.5)
    expected = [(0, 0, 1, 0, 0, half, half), (0, 2, 1, 0, 0, half, half), (0, 2, 4, 0, 0, half, half)]
    np.testing.assert_allclose(read_path(file, in_space=True), expected, atol=1e-12)
    assert read_path(file) == pytest.approx(np.array([(0, 0, math.pi / 2), (0, 2, math.pi / 2), (0, 2, math.pi / 2)]))


def test_a_path_without_heights_is_none_in_space(tmp_path):
    with pytest.raises(FileError, match=r"p.csv:2: expected a path with heights, got x and y alone; add the column z"):
        read_path(written(tmp_path, "p.csv", "x,y\n1,2\n"), in_space=True)


def test_a_message_is_written_with_the_fields_of_ros(tmp_path):
    write_path(tmp_path / "path.yaml", POSES)
    message = yaml.safe_load((tmp_path / "path.yaml").read_text())
    first = yaml.safe_load(ECHOED.removesuffix("---\n"))["poses"][0]
    assert message["header"]["frame_id"] == "map"
    assert [set(pose["pose"]) for pose in message["poses"]] == [set(first["pose"])] * len(POSES)
    assert message["poses"][2]["pose"]["orientation"] == pytest.approx(
        {"x": 0, "y": 0, "z": -math.sqrt(0.5), "w": math.sqrt(0.5)}
    )


@pytest.mark.parametrize("header", ["", "x,y\n", "# from a planner\n\nX, Y\n"])
def test_a_csv_without_yaw_heads_as_it_goes(tmp_path, header):
    poses = read_path(written(tmp_path, "path.csv", header + "0,0\n2,0\n2,3\n"))
    assert poses == pytest.approx(np.array([(0, 0, 0), (2, 0, 0), (2, 3, math.pi / 2)]))


def test_heights_times_and_tilts_do_not_matter(tmp_path):
    tilted = "1 2 3 4 0.0998334 0 0 0.9950042\n2.5 3 3 9 0 0 1 0\n"
    poses = read_path(written(tmp_path, "path.tum", tilted))
    assert poses == pytest.approx(np.array([(2, 3, 0), (3, 3, math.pi)]), abs=1e-6)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("p.csv", "x,y\n1,2\n3,a\n", "p.csv:3: expected finite numbers x y, got '3 a'"),
        ("p.csv", "x,y,yaw\n1,2\n", "p.csv:2: expected finite numbers x y yaw, got '1 2'"),
        ("p.csv", "1,2\nnan,3\n", "p.csv:2: expected finite numbers x y, got 'nan 3'"),
        (
            "p.csv",
            "lat,lon\n1,2\n",
            "p.csv:1: expected the columns x,y or x,y,yaw, in space x,y,z or x,y,z,qx,qy,qz,qw, got 'lat,lon'",
        ),
        ("p.csv", "1 2\n", "p.csv:1: expected the columns x,y or x,y,yaw, in space x,y,z or x,y,z,qx,qy,qz,qw, got '1 2'"),
        ("p.csv", "x,y\n", "p.csv: expected at least one pose"),
        ("p.tum", "1 2 3\n", "p.tum:1: expected finite numbers timestamp x y z qx qy qz qw, got '1 2 3'"),
        ("p.tum", "# nothing\n", "p.tum: expected at least one pose"),
        ("p.tum", "0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 2\n", "p.tum:2: expected a quaternion of length 1, got one of 2"),
        ("p.tum", "0 0 0 0 0 0 0 0\n", "p.tum:1: expected a quaternion of length 1, got one of 0; give 0 0 0 1 where"),
        ("p.yaml", "header: 1\n", "p.yaml:1: expected a nav_msgs/Path with its list of poses, got no field 'poses' in it"),
        ("p.yaml", "poses: []\n", "p.yaml:1: poses: expected a list of at least one pose"),
        ("p.yaml", "a text\n", "p.yaml:1: expected a nav_msgs/Path with its list of poses, got 'a text'"),
        ("p.yaml", ECHOED.replace("y: 3.5", "y: far"), "p.yaml:30: poses[1].pose.position.y: expected a number, got 'far'"),
        ("p.yaml", ECHOED.replace("      w: 1.0\n", ""), "poses[1].pose.orientation: expected the field w, got no field 'w'"),
        ("p.yaml", ECHOED.replace("---", "- '...'"), "p.yaml:37: poses[2]: expected all poses, got a list that is cut short;"),
        ("p.yaml", ECHOED + ECHOED, "p.yaml:38: expected one message, got 2; keep one"),
        ("p.json", "{", "p.json:1: expected YAML"),
        ("p.json", "", "p.json: expected a text file, got an empty one"),
        (
            "p.bag",
            "",
            "p.bag: expected a path that ends in .csv, .tum, .txt (TUM), .yaml, .yml or .json (nav_msgs/Path), got .bag",
        ),
    ],
)
def test_files_that_are_wrong(tmp_path, name, text, message):
    path = written(tmp_path, name, text)
    with pytest.raises(FileError) as caught:
        read_path(path)
    assert message in str(caught.value)


@pytest.mark.parametrize("poses", [[(0, 0)], [(0, 0, math.nan)], np.zeros((0, 3)), [0, 0, 0]])
def test_poses_that_are_none_are_not_written(tmp_path, poses):
    with pytest.raises(InvalidInputError, match="expected finite poses x, y, yaw of shape"):
        write_path(tmp_path / "path.csv", poses)
    assert list(tmp_path.iterdir()) == []


def test_a_suffix_that_is_none_is_not_written(tmp_path):
    with pytest.raises(FileError, match="got no suffix"):
        write_path(tmp_path / "path", POSES)
