"""Several goals, goals by pose, own candidates, and the chosen path in files."""

from __future__ import annotations

import json

import numpy as np
import pytest

from topobelief.candidates.polyline import path_length
from topobelief.io.path_formats import read_path, write_path


def document(topobelief, arguments: list[str]) -> dict:
    outcome = topobelief([*arguments, "--json"])
    assert outcome.err == ""
    assert outcome.code == 0
    return json.loads(outcome.out)


def bare(office, *options: object) -> list[str]:
    """Arguments without a goal."""
    files = [str(office.graph_file), "--map", str(office.map_file)]
    return ["plan", *files, "--vertices", "100", "--candidates", "3", *map(str, options)]


def test_several_goals_are_compared_each_with_its_own_candidates(topobelief, office):
    """Shortest first over all goals, and labels say where each leads."""
    plan = document(topobelief, bare(office, "--goal", 0, 5, "--goal", 3, "--goal=9 2"))
    places = [goal["place"] for goal in plan["goals"]]
    assert [goal["name"] for goal in plan["goals"]] == ["(0.00, 5.00)", "pose 3", "(9.00, 2.00)"]
    assert {action["goal"] for action in plan["actions"]} == {0, 1, 2}
    for index, action in enumerate(plan["actions"]):
        assert action["waypoints"][-1] == places[action["goal"]]
        assert action["label"] == f"path {index} to {plan['goals'][action['goal']]['name']}"
    lengths = [action["length"] for action in plan["actions"]]
    assert lengths == sorted(lengths)


def test_a_goal_can_be_a_pose(topobelief, office):
    plan = document(topobelief, bare(office, "--goal", 3, "--no-optimize"))
    assert plan["goals"] == [{"name": "pose 3", "place": [3, 0]}]
    assert {action["label"] for action in plan["actions"]} == {"path 0", "path 1", "path 2"}


def test_metres_cost_what_they_are_said_to(topobelief, office):
    """With a price that no map is worth, the shortest path is chosen."""
    plan = document(topobelief, bare(office, "--goal", 0, 5, "--max-detour", 2, "--cost-per-metre", 1000))
    assert plan["best"] == 0
    for action in plan["actions"]:
        assert action["cost"] == pytest.approx(1000 * action["length"])


@pytest.mark.parametrize("name", ["own.csv", "own.tum", "own.yaml", "own.json"])
def test_a_path_of_ones_own_is_a_candidate(topobelief, office, tmp_path, name):
    """By itself, without a goal; it is led to from where the robot stands."""
    write_path(tmp_path / name, [(9, 9, 0), (2, 9, 3), (1, 5, 2)])
    plan = document(topobelief, bare(office, "--path", name, "--no-optimize"))
    (action,) = plan["actions"]
    assert action["label"] == f"path 0, {name}"
    assert action["goal"] is None
    assert action["waypoints"] == [[10, 10], [9, 9], [2, 9], [1, 5]]


def test_own_paths_and_others_are_compared(topobelief, office, tmp_path):
    """One that ends at the goal counts among the paths to it."""
    write_path(tmp_path / "there.csv", [(10, 10, 0), (2, 9, 0), (0, 5, 0)])
    write_path(tmp_path / "elsewhere.csv", [(10, 10, 0), (9, 9, 0)])
    plan = document(topobelief, bare(office, "--goal", 0, 5, "--path", "there.csv", "--path", "elsewhere.csv", "--no-optimize"))
    goals = {action["label"].partition(", ")[2]: action["goal"] for action in plan["actions"]}
    assert goals == {"": 0, "there.csv": 0, "elsewhere.csv": None}
    assert len(plan["actions"]) == 5


@pytest.mark.parametrize("name", ["chosen.csv", "chosen.tum", "chosen.yaml", "chosen.json"])
def test_the_chosen_path_is_written_with_a_heading_at_every_pose(topobelief, office, tmp_path, name):
    plan = document(topobelief, bare(office, "--goal", 0, 5, "--write-path", name))
    assert [path.name for path in tmp_path.iterdir()] == [name]
    poses = read_path(tmp_path / name)
    assert np.abs(poses - plan["chosen"]["x_y_yaw"]).max() < 1e-12
    assert path_length(poses[:, :2]) == pytest.approx(plan["chosen"]["length"])


def test_a_written_path_and_the_pictures_go_together(topobelief, office, tmp_path):
    outcome = topobelief(bare(office, "--goal", 0, 5, "--write-path", "chosen.csv"))
    assert outcome.code == 0
    assert "Chosen path, with a heading at every pose: chosen.csv" in outcome.out
    assert {path.name for path in tmp_path.iterdir()} == {"out", "chosen.csv"}


WALKS = {
    "through.csv": "x,y\n10,10\n9,9\n1,2\n",
    "behind.csv": "x,y\n1,5\n0,5\n",
    "close.csv": "x,y\n10,10\n9,9\n7.2,9\n7.2,1\n",
}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ["--path", "through.csv"],
            "through.csv:4: expected a path that keeps more than the robot's radius of 0.35 m",
        ),
        (["--path", "through.csv"], "got one that does not between (9.00, 9.00) and (1.00, 2.00), at (7."),
        (["--path", "behind.csv"], "behind.csv:2: expected a path that keeps more than"),
        (["--path", "behind.csv"], "the straight way from the start to its first pose that does not between (10.00, 10.00)"),
        (["--path", "close.csv"], "close.csv:5: expected a path that keeps more than"),
        (["--path", "none.csv"], "none.csv: expected a file to read, got nothing of that name"),
        (["--path", "walk.bag"], "walk.bag: expected a path that ends in .csv, .tum, .txt (TUM)"),
        (["--goal", "21"], "expected --goal as the id of a pose of the file (from 0 to 20) or as X Y, got 21"),
        (["--goal", "2.5"], "'--goal': expected the id of a pose or X Y in metres, got '2.5'"),
        (
            ["--goal", "1", "2", "--goal", "1", "2"],
            "expected different goals, got (1.00, 2.00) and (1.00, 2.00)",
        ),
        (["--goal", "5", "5"], "choose the nearest free place, "),
        (["--goal", "50", "5"], "choose the nearest free place, 10.44 5, 39.56 m away"),
        (["--goal", "0", "5", "--write-path", "a.bag"], "a.bag: expected a path that ends in"),
        (
            ["--goal", "0", "5", "--write-path", "no/a.csv"],
            "expected a file to write, got a folder that does not exist",
        ),
        (["--goal", "0", "5", "--cost-per-metre", "-1"], "'--cost-per-metre': expected a number of at least 0, got -1"),
        (["--goal", "0", "5", "--why", "7"], "expected --why as the number of a path (0 to 2) or its label, got '7'"),
        (["--goal", "0", "5", "--closures", "none"], "'--closures'"),
        (["--goal", "0", "5", "--closures", "learned", "--closure-radius", "1"], "expected --closures learned without numbers"),
        ([], "expected --goal ID or X Y, a candidate of your own by --path FILE, or --max-length M"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(topobelief, office, tmp_path, options, message):
    for name, text in WALKS.items():
        (tmp_path / name).write_text(text)
    outcome = topobelief(bare(office, "--no-optimize", "--out", "result", *options))
    assert outcome.code == 2
    assert outcome.err.count("\n") == 1
    assert message in outcome.err
    assert {path.name for path in tmp_path.iterdir()} == set(WALKS)
