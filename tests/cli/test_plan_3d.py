"""`topobelief plan` in space: on the floors of a ramp, as free flight, in a voxel world, and on a plane saved in 3D."""

import json

import numpy as np
import pytest

from drives_3d import hills, measured, ramp, torus
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.g2o import write_g2o
from topobelief.io.path_formats import write_path

SOON = ("--vertices", "60", "--robot-radius", "0.3", "--candidates", "2", "--no-exact")


@pytest.fixture
def garage(tmp_path):
    """A drive up a ramp, measured with noise."""
    graph = ramp()
    file = tmp_path / "garage.g2o"
    write_g2o(measured(graph.poses, graph.edges.tolist(), metres=0.01, radians=0.01), file)
    return file


def test_a_drive_over_the_floors(topobelief, garage, tmp_path):
    """Without a map or any option of 3D: picture, page, decision and path."""
    outcome = topobelief(["plan", str(garage), "--goal", "2", *SOON, "--width", "3", "--write-path", "path.tum"])
    assert outcome.code == 0, outcome.err
    assert "for a robot that drives (--flying for one that flies)" in outcome.out
    assert "1.00 m above and below it" in outcome.out
    assert "2 paths from" in outcome.out
    document = json.loads((tmp_path / "out" / "decision.json").read_text())
    assert len(document["actions"][0]["waypoints"][0]) == 3
    chosen = np.array(document["chosen"]["x_y_z_quaternion"])
    assert chosen.shape[1] == 7
    assert document["chosen"]["length"] > 50
    np.testing.assert_allclose(np.linalg.norm(chosen[:, 3:], axis=1), 1)
    np.testing.assert_allclose(np.loadtxt("path.tum")[:, 1:], chosen)
    page = (tmp_path / "out" / "paths.html").read_text()
    assert page.count("<script>") == 2
    assert "src=" not in page.split("<script>")[0]
    assert (tmp_path / "out" / "paths.png").stat().st_size > 20_000


def test_a_flight_takes_the_short_way_up(topobelief, garage, tmp_path):
    options = ["--flying", "--width", "4", "--goal", "10", "0", "1", "--out", "fly", "--attitude", "along"]
    outcome = topobelief(["plan", str(garage), *SOON, *options])
    assert outcome.code == 0, outcome.err
    assert "for a robot that flies" in outcome.out
    document = json.loads((tmp_path / "fly" / "decision.json").read_text())
    assert document["actions"][0]["length"] < 20
    assert document["options"]["attitude"] == "along"


@pytest.mark.parametrize(
    ("graph", "goal", "told"),
    [
        (torus(windings=8, poses_per_winding=24), 20, "a robot that flies"),
        (hills(junctions=12, step=10), 30, "a robot that drives"),
    ],
    ids=["torus", "hills"],
)
def test_whether_it_drives_or_flies_is_told_by_its_poses(topobelief, tmp_path, graph, goal, told):
    """On the hull of a torus, and over the hills of a town, where the way keeps to the ground."""
    write_g2o(graph, tmp_path / "graph.g2o")
    outcome = topobelief(["plan", "graph.g2o", "--goal", str(goal), *SOON])
    assert outcome.code == 0, outcome.err
    assert told in outcome.out
    document = json.loads((tmp_path / "out" / "decision.json").read_text())
    path = np.array(document["actions"][0]["waypoints"])
    away = np.linalg.norm(path[:, None] - graph.positions, axis=2).min(axis=1)
    assert away.max() < 25
    assert document["expected_errors"]["chosen"]["map_rmse"] <= document["expected_errors"]["now"]["map_rmse"] + 1e-9


@pytest.mark.parametrize("name", ["own.csv", "own.tum", "own.yaml"])
def test_a_path_of_ones_own_is_a_candidate(topobelief, garage, tmp_path, name):
    """Down the ramp along the poses of the graph, judged and predicted at their heights; beside others, with their goal."""
    poses = np.array(ramp().poses[:1:-1])
    write_path(tmp_path / name, poses)
    outcome = topobelief(["plan", str(garage), "--goal", "2", *SOON, "--path", name, "--width", "3", "--no-optimize"])
    assert outcome.code == 0, outcome.err
    actions = json.loads((tmp_path / "out" / "decision.json").read_text())["actions"]
    assert len(actions) == 3
    (own,) = [action for action in actions if action["label"].endswith(name)]
    assert own["goal"] == 0
    np.testing.assert_allclose(own["waypoints"], poses[:, :3], atol=1e-9)


def test_a_search_in_a_voxel_world(topobelief, garage, tmp_path):
    """Around the ramp everything is free; a search needs no more options than in the plane."""
    pytest.importorskip("numba")
    np.save(tmp_path / "hall.npy", np.zeros((14, 14, 8), dtype=bool))
    arguments = ["plan", str(garage), "--map", "hall.npy", "--resolution", "2", "--origin", "-14", "-14", "-4"]
    arguments += ["--goal", "30", "--vertices", "40", "--spacing", "4", "--max-evaluations", "10"]
    outcome = topobelief(arguments)
    assert outcome.code == 0, outcome.err
    assert "world: hall.npy, 28.0 × 28.0 × 16.0 m" in outcome.out
    assert "No walk of the roadmap" in outcome.out or "Proven" in outcome.out
    assert json.loads((tmp_path / "out" / "decision.json").read_text())["search"]["lower_bound"] is not None


def test_a_plane_saved_in_3d_is_projected(topobelief, tmp_path):
    poses = np.array([[x, 0, 2, 0, 0, 0, 1] for x in range(8)], dtype=float)
    write_g2o(PoseGraph(poses, [(i, i + 1) for i in range(7)], None, 100 * np.eye(6)), tmp_path / "flat.g2o")
    outcome = topobelief(["plan", "flat.g2o", "--along-trajectory", "--goal", "0", "0", "--width", "1", *SOON])
    assert outcome.code == 0, outcome.err
    assert (
        "the graph lies in a plane and is projected onto the plane: dropped heights from 2 to 2 m" in outcome.out + outcome.err
    )
    assert "x_y_yaw" in json.loads((tmp_path / "out" / "decision.json").read_text())["chosen"]


def test_info_says_whether_a_place_on_a_floor_is_free(topobelief, garage):
    outcome = topobelief(["info", str(garage), "--goal", "10", "0", "0.5", "--goal", "0", "0", "1.5", "--no-optimize"])
    assert outcome.code == 0, outcome.err
    assert "goal (10.00, 0.00, 0.50)" in outcome.out
    assert "free, " in outcome.out
    assert "the nearest free place is " in " ".join(outcome.out.split())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--goal", "1", "2"], "expected --goal as X Y Z for a graph in SE(3), got 2 numbers"),
        (["--goal", "0", "0", "0"], "choose the nearest free place"),
        (["--goal", "2", "--path", "flat.csv"], "flat.csv:1: expected a path with heights, got x and y alone"),
        (["--path", "through.csv"], "through.csv:3: expected a path that keeps more than the robot's radius of 0.35 m"),
        (["--goal", "2", "--driving", "--height", "5", "--width", "3"], "expected --height below --width"),
        (["--goal", "2", "--flying", "--map", "cloud.pcd"], "expected no --map with --flying or --driving"),
        (["--goal", "2", "--map", "cloud.pcd"], "nothing of that name"),
        (["--goal", "2", "--map", "grid.npy"], "give --resolution"),
    ],
)
def test_what_makes_no_sense_in_space(topobelief, garage, tmp_path, options, message):
    np.save(tmp_path / "grid.npy", np.zeros((2, 2, 2)))
    (tmp_path / "flat.csv").write_text("1,2\n")
    (tmp_path / "through.csv").write_text("x,y,z\n10,0,6\n10,0,3\n")
    outcome = topobelief(["plan", str(garage), *options, "--vertices", "50", "--out", "result"])
    assert outcome.code == 2
    assert outcome.err.count("\n") == 1
    assert message in outcome.err
    assert not (tmp_path / "result").exists()
