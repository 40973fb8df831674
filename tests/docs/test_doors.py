"""The recipes of the page on doors run, on files as its programs write them; only the commands of ROS are left out."""

from __future__ import annotations

import doctest
import re
from pathlib import Path

import numpy as np
import pytest

from bag_files import Messages, write_bag
from door_files import INFORMATION, LIST, SPHERE, STRIP, Database, marker, message
from topobelief.cli.app import run
from topobelief.geometry import SE2_GROUP
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.g2o import write_g2o
from topobelief.io.toro import write_toro

PAGE = Path(__file__).resolve().parents[2] / "docs" / "doors.md"
RECIPES = re.findall(r"^## ([^\n]+)\n|^```sh\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def recipes() -> list[tuple[str, list[str]]]:
    """Each block of commands with the heading that it stands under."""
    found, heading = [], ""
    for title, block in RECIPES:
        heading = title or heading
        if block:
            found.append((heading, block.splitlines()))
    return found


def drive() -> np.ndarray:
    """Once around a square of 6 m and half of it again, a pose every 0.5 m."""
    side = np.arange(0, 6, 0.5)
    zero, far = np.zeros(12), np.full(12, 6.0)
    lap = np.column_stack([np.concatenate([side, far, 6 - side, zero]), np.concatenate([zero, side, far, 6 - side])])
    lap = np.column_stack([lap, np.repeat([0, np.pi / 2, np.pi, -np.pi / 2], 12)])
    return np.concatenate([lap, lap[:24]])


def closures(poses: np.ndarray) -> list[tuple[int, int]]:
    return [(index, index - 48) for index in range(48, len(poses), 4)]


def write_files(recipe: str) -> None:
    """What the program of this recipe leaves behind."""
    poses = drive()
    places = [tuple(map(float, pose[:2])) for pose in poses]
    steps = [(index, index + 1) for index in range(len(poses) - 1)]
    graph = PoseGraph(poses, steps + closures(poses), None, np.diag([400.0, 400, 3000]))
    write_g2o(graph, "graph.g2o")
    write_toro(graph, "graph.toro")
    write_g2o(_with_trees(graph), "park.g2o")
    database = Database()
    database.nodes = [(index + 1, 0, _matrix(pose)) for index, pose in enumerate(poses)]
    measured = zip(graph.edges.tolist(), graph.measurements, strict=True)
    database.links = [(i + 1, j + 1, int(abs(i - j) > 1), INFORMATION.tobytes(), _matrix(pose)) for (i, j), pose in measured]
    database.write(Path("rtabmap.db"))
    if recipe == "Cartographer":
        submaps = [(x + 0.25, y + 0.25) for x, y in places[::8]]
        ends = [point for index, place in enumerate(places) for point in (submaps[index // 8], place)]
        ends += [point for new, old in closures(poses) for point in (submaps[old // 8], places[new])]
        text = message(marker("Trajectory 0", 0, STRIP, places)) + message(marker("Intra constraints", 0, LIST, ends))
    else:
        spheres = [marker("slam_toolbox", index, SPHERE, at=place) for index, place in enumerate(places)]
        ends = [places[index] for edge in graph.edges.tolist() for index in edge]
        text = message(*spheres, marker("slam_toolbox_edges", 0, LIST, ends))
    Path("graph.yaml").write_text(text)
    if recipe.startswith("Bags"):
        made = Messages()
        spots = [(x + 0.01 * (index >= 48), y) for index, (x, y) in enumerate(places)]
        bodies = [made.marker("poses", index, SPHERE, at=spot) for index, spot in enumerate(spots)]
        lines = made.marker("edges", 0, LIST, [spots[index] for edge in graph.edges.tolist() for index in edge])
        grid = made.grid(np.zeros((20, 20)), 0.5, (-2, -2))
        topics = {"/odom": [made.odometry(*pose) for pose in poses.tolist()], "/map": [grid]}
        topics["/slam_toolbox/graph_visualization"] = [made.markers(*bodies, lines)]
        write_bag(Path(), "ROS 2 MCAP", made, topics)
    half = poses[:, 2] / 2
    tum = np.column_stack([np.arange(len(poses)), poses[:, :2], 0 * half, 0 * half, 0 * half, np.sin(half), np.cos(half)])
    np.savetxt("poses.tum", tum, fmt="%.9f")
    np.savetxt("kitti.txt", [np.frombuffer(_matrix(pose), dtype="<f4") for pose in poses], fmt="%.9f")
    odometry = zip(steps, graph.measurements.tolist(), strict=False)
    lines = [f"EDGE2 {i} {j} {x} {y} {theta} 20 0 0 20 0 50" for (i, j), (x, y, theta) in odometry]
    Path("isam.txt").write_text("\n".join(lines) + "\n")


def _with_trees(graph: PoseGraph) -> PoseGraph:
    """A tree beside each side of the square, seen by every second pose that is near it."""
    trees = np.array([[3.0, -1.0], [7.0, 3.0], [3.0, 7.0], [-1.0, 3.0]])
    n = graph.num_poses
    near = np.linalg.norm(graph.positions[::2, None] - trees, axis=2) < 3
    seen = [(2 * pose, n + tree) for pose, tree in np.argwhere(near).tolist()]
    poses = np.concatenate([graph.poses, np.column_stack([trees, np.zeros(4)])])
    kinds = ["pose"] * n + ["landmark"] * 4
    return PoseGraph(poses, [*graph.edges.tolist(), *seen], None, graph.information[0], kinds)


def _matrix(pose: np.ndarray) -> bytes:
    rotation = SE2_GROUP.rotation_matrix(pose)
    matrix = np.eye(4)
    matrix[:2, :2], matrix[:2, 3] = rotation, pose[:2]
    return matrix[:3].astype("<f4").tobytes()


@pytest.mark.parametrize(("recipe", "commands"), recipes(), ids=[title.partition(":")[0] for title, _ in recipes()])
def test_a_recipe_leads_to_an_answer_in_at_most_three_commands(recipe, commands, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_files(recipe)
    assert 1 <= len(commands) <= 3
    for command in commands:
        program, *arguments = command.split()
        if program == "ros2":
            assert command.split(">")[0].split()[1:5] == ["topic", "echo", "--once", "--full-length"]
            continue
        assert program == "topobelief"
        assert run(arguments) == 0, capsys.readouterr().err
    assert capsys.readouterr().out


def test_the_example_for_gtsam_gives_what_the_page_prints():
    results = doctest.testfile(str(PAGE), module_relative=False, encoding="utf-8")
    assert results.attempted > 0
    assert results.failed == 0
