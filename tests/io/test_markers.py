"""Graphs as slam_toolbox and Cartographer draw them, in files as `ros2 topic echo` and `rostopic echo` print them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from door_files import LIST, SPHERE, STRIP, cartographer, marker, message, slam_toolbox
from topobelief.errors import FileError
from topobelief.io.formats import read_graph_file
from topobelief.io.reading import ReadGraph, ReadingOptions


def read(text: str, tmp_path: Path, options: ReadingOptions | None = None) -> ReadGraph:
    path = tmp_path / "graph.yaml"
    path.write_text(text)
    return read_graph_file(path, options or ReadingOptions())


def test_the_graph_of_slam_toolbox_is_read(tmp_path: Path):
    graph, notes = read(slam_toolbox(), tmp_path)
    assert graph.poses[:, :2].tolist() == [[0, 0], [2.5, 0], [2.5, 2.5], [0, 2.5]]
    np.testing.assert_allclose(graph.poses[:, 2], [0, 0, np.pi / 2, -np.pi])
    assert graph.edges.tolist() == [[0, 1], [1, 2], [2, 3], [0, 3]]
    assert (graph.information == np.eye(3)).all()
    assert graph.chi2 == pytest.approx(0, abs=1e-20)
    assert len(notes) == 1
    assert "positions and edges alone" in notes[0]
    assert "convert --noise` (in Python noise=(metres, radians))" in notes[0]


def test_ids_of_spheres_are_kept_in_any_order(tmp_path: Path):
    spheres = [marker("slam_toolbox", number, SPHERE, at=(number, 0)) for number in (12, 3, 7)]
    graph, _ = read(message(*spheres, marker("edges", 0, LIST, [(3, 0), (7, 0), (12, 0), (7, 0)])), tmp_path)
    assert graph.ids.tolist() == [3, 7, 12]
    assert graph.ids[graph.edges].tolist() == [[3, 7], [12, 7]]


def test_a_stated_noise_is_the_information(tmp_path: Path):
    graph, notes = read(slam_toolbox(), tmp_path, ReadingOptions(noise=(0.1, 0.05)))
    np.testing.assert_allclose(graph.information[0], np.diag([100, 100, 400]))
    assert "every edge has the stated noise, 0.1 m and 2.86479 degrees" in notes[0]


def test_the_last_state_of_a_marker_counts(tmp_path: Path):
    """Echoed without --once, a topic repeats itself; lines drawn twice are one edge."""
    first = message(
        *(marker("slam_toolbox", n, SPHERE, at=(9 + n, 9)) for n in (0, 1)), marker("e", 0, LIST, [(9, 9), (10, 9)])
    )
    second = message(
        *(marker("slam_toolbox", n, SPHERE, at=(n, 0)) for n in (0, 1)), marker("e", 0, LIST, [(0, 0), (1, 0), (1, 0), (0, 0)])
    )
    graph, _ = read(first + second, tmp_path)
    assert graph.poses[:, :2].tolist() == [[0, 0], [1, 0]]
    assert graph.num_edges == 1


def test_the_two_topics_of_cartographer_are_read_from_one_file(tmp_path: Path):
    """Submaps come first; a constraint joins its pose, not the place where it ended; the robot is at the end of its way."""
    trajectory, constraints = cartographer()
    graph, _ = read(trajectory + constraints, tmp_path)
    assert graph.ids.tolist() == [0, 1, 1000, 1001, 1002]
    assert graph.poses[:, :2].tolist() == [[0.5, 0.5], [1.5, 0.5], [0, 0], [1, 0], [2, 0.1]]
    edges = {tuple(sorted(edge)) for edge in graph.ids[graph.edges].tolist()}
    assert edges == {(1000, 1001), (1001, 1002), (0, 1000), (0, 1001), (1, 1001), (1, 1002), (0, 1002)}
    assert graph.odometry_end == 4


def test_constraints_alone_make_the_same_graph_without_the_trajectory(tmp_path: Path):
    _, constraints = cartographer()
    graph, _ = read(constraints, tmp_path)
    assert (graph.num_poses, graph.num_edges) == (5, 5)


def test_different_heights_are_a_graph_in_space(tmp_path: Path):
    graph, _ = read(message(marker("e", 0, STRIP, [(0, 0, 0), (1, 0, 0), (1, 1, 3)])), tmp_path)
    assert (graph.group.name, graph.num_edges) == ("SE(3)", 2)
    assert graph.poses[:, 2].tolist() == [0, 0, 3]


def test_what_ros_1_prints_is_read(tmp_path: Path):
    points = "".join(f"      - \n        x: {x}\n        y: 0.0\n        z: 0.0\n" for x in (0.0, 1.0))
    text = 'markers: \n  - \n    header: \n      seq: 0\n      frame_id: "map"\n    ns: "e"\n    id: 0\n    type: 5\n'
    graph, _ = read(f"{text}    action: 0\n    points: \n{points}    text: ''\n---\n", tmp_path)
    assert graph.edges.tolist() == [[0, 1]]


def test_parts_are_components_and_isolated_poses_are_kept(tmp_path: Path):
    spheres = [marker("s", number, SPHERE, at=(number, 0)) for number in range(3)]
    text = message(*spheres, marker("e", 0, LIST, [(0, 0), (1, 0)]))
    assert read(text, tmp_path).graph.num_poses == 3
    graph, notes = read(text, tmp_path, ReadingOptions(component="largest"))
    assert graph.num_poses == 2
    assert "kept one of 2 components: 2 of 3 poses (0 … 1)" in notes


LINE = marker("e", 0, LIST, [(0, 0), (1, 0)])
WRONG = {
    "no lines": (message(marker("s", 0, SPHERE)), "expected lines between poses among the markers, got 1 marker without any"),
    "a point": (message(marker("e", 0, LIST, [(1, 1), (1, 1)])), "got 1 marker without any"),
    "a residual": (
        message(marker("c", 0, LIST, [(1, 1), (2, 1)]), marker("residuals", 1, LIST, [(1, 1), (2, 1)])),
        "got 2 markers without any",
    ),
    "nothing": ("markers: []\n", "expected lines between poses among the markers"),
    "one end": (message(marker("e", 0, LIST, [(0, 0)])), r"yaml:2: expected two points a line, got 1 points"),
    "cut short": (message(LINE + "  - '...'\n"), "got one that is cut short; print it with `ros2 topic echo --full-length`"),
    "brackets": ("markers:\n- type: 5\n  points: [{x: 1}]\n", "yaml:3: expected points .*, one number a line"),
    "number": (message(LINE.replace("x: 1\n", "x: one\n")), r"yaml:\d+: expected a number of metres for x, got 'one'"),
    "nan": (message(LINE.replace("x: 1\n", "x: .nan\n")), "expected a number of metres for x, got '.nan'"),
    "type": (message(LINE.replace("type: 5", "type: line")), "expected a whole number for type, got 'line'"),
    "own frame": (message(marker("e", 0, LIST, [(0, 0), (1, 0)], at=(3, 0, 0))), "in the frame of the map, .* pose.position.x"),
    "y before x": ("markers:\n- type: 5\n  points:\n  - y: 1\n", "yaml:4: expected a point that begins with x, got y"),
    "other text": ("markers:\n- type: 5\nsome words\n", "yaml:3: expected a message as `ros2 topic echo` prints it"),
    "deep items": ("markers:\n" + "- " * 500_000, "yaml:2: expected at most 12 levels of names, got more"),
    "deep": ("markers:\n" + "".join(" " * n + "a:\n" for n in range(99)), "expected at most 12 levels of names, got more"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named(name: str, tmp_path: Path):
    text, pattern = WRONG[name]
    with pytest.raises(FileError, match=pattern):
        read(text, tmp_path)


@pytest.mark.parametrize("head", [b"22 serialization::archive 17 0 0", b"\x16\0\0\0\0\0\0\0serialization::archive\x11\0"])
def test_an_archive_of_slam_toolbox_is_refused_with_the_way_out(head: bytes, tmp_path: Path):
    path = tmp_path / "map.posegraph"
    path.write_bytes(head + bytes(100))
    with pytest.raises(FileError, match=r"ros2 topic echo --once --full-length /slam_toolbox/graph_visualization > graph.yaml"):
        read_graph_file(path, ReadingOptions())
