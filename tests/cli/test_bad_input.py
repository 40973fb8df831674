"""Bad input: exit code 2, exactly one line on stderr that says what to do, and no file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from topobelief.cli.app import BAD_INPUT
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.g2o import write_g2o

DISCONNECTED = """VERTEX_SE2 7 0 0 0
VERTEX_SE2 8 1 0 0
VERTEX_SE2 9 5 0 0
EDGE_SE2 7 8 1 0 0 1 0 0 1 0 1
"""


def one_line(outcome) -> str:
    assert outcome.code == BAD_INPUT
    assert outcome.err.startswith("topobelief: ")
    assert outcome.err.count("\n") == 1
    return outcome.err


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """A folder of graphs that are none."""
    (tmp_path / "empty.g2o").touch()
    (tmp_path / "binary.g2o").write_bytes(b"VERTEX_SE2\0\x01\x02")
    (tmp_path / "folder.g2o").mkdir()
    (tmp_path / "disconnected.g2o").write_text(DISCONNECTED)
    (tmp_path / "map.yaml").write_text("image: map.pgm\n")
    (tmp_path / "planes.g2o").write_text("VERTEX_PLANE 7 0 0 1 2\n" + DISCONNECTED)
    (tmp_path / "islands.g2o").write_text("EDGE_SE2 1 2 1 0 0 1 0 0 1 0 1\nEDGE_SE2 3 4 1 0 0 1 0 0 1 0 1\n")
    (tmp_path / "truncated.g2o").write_text("VERTEX_SE2 0 0 0 0\nEDGE_SE2 0 1 1 0\n")
    return tmp_path


@pytest.mark.parametrize("command", [["info"], ["plan", "--along-trajectory", "--goal", "1", "2"]], ids=["info", "plan"])
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("missing.g2o", "nothing of that name"),
        ("empty.g2o", "got an empty one"),
        ("binary.g2o", "got a binary one"),
        ("folder.g2o", "got a directory"),
        ("truncated.g2o", "truncated.g2o:2: expected"),
        ("islands.g2o", "add the missing edges or keep one component, with --component largest"),
        ("map.yaml", "map.yaml:1: expected VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT, VERTEX2, EDGE2 or FIX"),
        (
            "planes.g2o",
            "planes.g2o:1: expected poses and plain edges between them, got planes or lines (VERTEX_PLANE on line 1)",
        ),
    ],
)
def test_graph_files_that_are_wrong(topobelief, files, command, name, message):
    outcome = topobelief([command[0], str(files / name), *command[1:]])
    assert message in one_line(outcome)
    assert outcome.out == ""


def test_plan_refuses_a_disconnected_graph_and_offers_its_largest_part(topobelief, files):
    message = one_line(topobelief(["plan", str(files / "disconnected.g2o"), "--along-trajectory", "--goal", "1", "2"]))
    assert "disconnected.g2o: expected a connected graph, got 1 node(s) that node 7 does not reach: 9" in message
    assert "keep one component, with --component largest (2 of 3 poses) or --component ID" in message


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--drop", "walls"], 'expected --drop to be one of "priors", "gps"'),
        (["--drop", "robust", "--robust-as-plain"], "expected robust edges to be dropped or read as plain ones, got both"),
        (["--edge2-order", "g2o"], "'--edge2-order'"),
        (["--component", "smallest"], 'expected component to be "all", "largest" or the id of a pose, got \'smallest\''),
    ],
)
def test_options_of_reading_that_make_no_sense(topobelief, files, options, message):
    assert message in one_line(topobelief(["info", str(files / "disconnected.g2o"), *options]))


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        (("50", "5"), "expected a goal on the map"),
        (("5", "5"), "got (5, 5), in an obstacle"),
        (("10", "-0.7"), "got (10, -0.7), 0.10 m from the nearest obstacle"),
        (("nan", "5"), "'--goal': expected the id of a pose or X Y in metres, got 'nan 5'"),
    ],
)
def test_goals_that_cannot_be(topobelief, office, goal, message):
    arguments = ["plan", str(office.graph_file), "--map", str(office.map_file), "--goal", *goal]
    assert message in one_line(topobelief(arguments))


def test_a_goal_behind_walls(topobelief, office, tmp_path):
    closed = tmp_path / "closed.csv"
    closed.write_text(office.map_file.read_text() + "-1,7,11,7.2\n")
    message = one_line(topobelief(["plan", str(office.graph_file), "--map", str(closed), "--goal", "0", "5"]))
    assert "walls separate them" in message


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--spacing", "-1"], "'--spacing': expected a number above 0, got -1"),
        (["--spacing", "nan"], "'--spacing': expected a number above 0, got nan"),
        (["--robot-radius", "0"], "'--robot-radius': expected a number above 0, got 0"),
        (["--candidates", "0"], "'--candidates'"),
        (["--candidates", "many"], "'--candidates'"),
        (["--max-detour", "0.5"], "'--max-detour': expected a factor of at least 1"),
        (["--max-detour", "far"], "'--max-detour': expected a factor of at least 1"),
        (["--closure-angle", "4"], "'--closure-angle': expected at most 3.14159, got 4; angles are in radians, and 4 degrees"),
        (["--sigma-p", "0.1", "--sigma-theta", "2"], "'--sigma-theta': expected at most 1.8138, got 2; angles are in radians"),
        (["--spacing", "1", "--spacing", "2"], "'--spacing': expected it once, got it twice"),
        (["--seed", "1", "--seed", "2", "--seed", "3"], "'--seed': expected it once, got it 3 times"),
        (["--start", "21"], "expected --start as the id of a pose of the file (from 0 to 20) or as X Y, got 21"),
        (["--start", "2.5"], "'--start': expected the id of a pose or X Y in metres, got '2.5'"),
        (["--start", "nan", "1"], "'--start': expected the id of a pose or X Y in metres, got 'nan 1'"),
        (["--start", "5", "5"], "expected a start in sight of a pose of the graph, got (5, 5)"),
        (["--objective", "fame"], "'--objective'"),
        (["--proof", "optimal", "--margin", "-50"], "expected a margin or --proof optimal, got both"),
        (["--sigma-p", "0.1"], "expected both --sigma-p and --sigma-theta or neither"),
        (["--objective", "map", "--bounds", "paper", "--sigma-p", "1", "--sigma-theta", "1"], "use --bounds fischer"),
        (["--bounds", "paper"], 'expected --bounds of objective "error" to be one of "fischer", "anchored"'),
        (["--along-trajectory"], "expected one of --map FILE and --along-trajectory"),
        (["--bogus"], "No such option: --bogus"),
    ],
)
def test_options_that_make_no_sense(topobelief, office, tmp_path, options, message):
    assert message in one_line(topobelief(office.plan("--out", "result", *options)))
    assert list(tmp_path.iterdir()) == []


def test_no_world_at_all(topobelief, office):
    message = one_line(topobelief(["plan", str(office.graph_file), "--goal", "0", "5"]))
    assert "expected one of --map FILE and --along-trajectory" in message


@pytest.mark.parametrize(("name", "message"), [("gone.yaml", "nothing of that name"), ("map.png", "expected a map that ends")])
def test_maps_that_are_none(topobelief, office, name, message):
    assert message in one_line(topobelief(["plan", str(office.graph_file), "--map", name, "--goal", "0", "5"]))


@pytest.mark.parametrize("out", ["taken", "taken/below"])
def test_a_file_where_the_folder_should_be_is_noticed_before_the_work(topobelief, office, tmp_path, out):
    (tmp_path / "taken").write_text("mine")
    outcome = topobelief(office.plan("--out", tmp_path / out))
    assert "expected a folder to write to, got a file" in one_line(outcome)
    assert outcome.out == ""
    assert (tmp_path / "taken").read_text() == "mine"


def test_maps_of_the_other_dimension(topobelief, office, tmp_path):
    """A floor plan for a graph in space, a 3D map for one in the plane."""
    poses = np.array([[0, 0, 0, 0, 0, 0, 1], [1, 0, 2, 0, 0, 0, 1]])
    write_g2o(PoseGraph(poses, [(0, 1)], None, np.eye(6)), tmp_path / "space.g2o")
    np.save(tmp_path / "grid.npy", np.zeros((3, 3, 3)))
    arguments = ["plan", str(tmp_path / "space.g2o"), "--map", str(office.map_file), "--goal", "0", "5", "0"]
    message = one_line(topobelief(arguments))
    assert "expected a 3D map (.npy, .ply or .pcd) or none for a graph in SE(3)" in message
    assert "pass --planar" in message
    planar = ["plan", str(office.graph_file), "--goal", "0", "5"]
    message = one_line(topobelief([*planar, "--map", "grid.npy", "--resolution", "1"]))
    assert "expected a floor plan (.yaml or .csv) for a graph in SE(2), got the 3D map" in message


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--goal", "0", "5", "1", "--along-trajectory"], "expected --goal as X Y for a graph in SE(2), got 3 numbers"),
        (["--goal", "0", "5", "--along-trajectory", "--flying"], "expected a graph in SE(3) with --flying or --driving"),
        (["--goal", "0", "5", "--along-trajectory", "--height", "1"], "expected a graph in SE(3) with --height"),
        (["--goal", "0", "5", "--along-trajectory", "--resolution", "1"], "expected a 3D map (.npy, .ply or .pcd) with --res"),
        (["--goal", "0", "5", "--map", "grid.npy", "--origin", "1", "2"], "expected three numbers X Y Z in metres, got '1 2'"),
        (["--goal", "0", "5", "--map", "grid.npy", "--driving"], "expected no --map with --flying or --driving"),
    ],
)
def test_options_of_space_in_the_plane(topobelief, office, options, message):
    assert message in one_line(topobelief(["plan", str(office.graph_file), *options]))


@pytest.mark.parametrize("arguments", [["fly"], ["plan"], ["info", "a.g2o", "b.g2o"]])
def test_commands_that_are_none_or_incomplete(topobelief, arguments):
    assert "--help`" in one_line(topobelief(arguments))
