"""Scenarios from files: read in full, and refused by file, line and field."""

from __future__ import annotations

from pathlib import Path

import pytest

from topobelief.candidates.closures import ClosureModel
from topobelief.errors import FileError, InvalidInputError
from topobelief.simulation.scenario import Goal
from topobelief.simulation.scenario_file import scenario_of, with_detour

GOOD = """map: walls.csv
start: [1, 1, 0.5]
goals: [[9, 9], [1, 9]]
candidates: [5, 7]
max_detour: none
lidar: {max_range: 6, num_beams: 180}
robot: {wheel_slip: 0.02}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "walls.csv").write_text("# bounds: 0 0 10 10\nx_min,y_min,x_max,y_max\n4,4,6,6\n")
    return tmp_path


def write(folder: Path, text: str) -> str:
    path = folder / "room.yaml"
    path.write_text(text)
    return str(path)


def test_all_that_a_file_says_is_taken(folder):
    scenario = scenario_of(write(folder, GOOD))
    assert scenario.name == "room"
    assert scenario.start == (1.0, 1.0, 0.5)
    assert scenario.goals == (Goal((9.0, 9.0), 5), Goal((1.0, 9.0), 7))
    assert scenario.rule.max_detour is None
    assert (scenario.lidar.max_range, scenario.lidar.num_beams, scenario.lidar.rate) == (6.0, 180, 10.0)
    assert scenario.robot.wheel_slip == 0.02


def test_what_a_file_leaves_out_has_defaults(folder):
    scenario = scenario_of(write(folder, "map: walls.csv\nstart: [1, 1]\ngoals: [[9, 9]]\n"))
    assert (scenario.start[2], scenario.rule.max_detour, scenario.goals[0].num_paths) == (0.0, 1.3, 20)
    assert scenario.rule.robot_radius == pytest.approx(0.35)
    large = scenario_of(write(folder, "map: walls.csv\nstart: [1, 1]\ngoals: [[9, 9]]\nrobot: {radius: 0.5}\n"))
    assert large.rule.robot_radius == pytest.approx(0.6)


def test_closures_are_learned_or_those_of_the_paper(folder):
    least = "map: walls.csv\nstart: [1, 1]\ngoals: [[9, 9]]\n"
    for text, closures, line_of_sight in (
        ("", None, True),
        ("closures: learned\n", None, True),
        ("closures: paper\n", ClosureModel.paper(), False),
    ):
        rule = scenario_of(write(folder, least + text)).rule
        assert (rule.closures, rule.line_of_sight) == (closures, line_of_sight)
    with pytest.raises(FileError, match="closures: expected one of learned, paper, got 'all'"):
        scenario_of(write(folder, least + "closures: all\n"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("map: walls.csv\n", ""), "expected the key 'map', got none"),
        (("walls.csv", "wals.csv"), r":1: map: expected the path of a map .* which is no file"),
        (("[1, 1, 0.5]", "here"), r":2: start: expected a start \[x, y\]"),
        (("[1, 9]]", "[1]]"), r":3: goals\[1\]: expected a goal \[x, y\]"),
        (("[5, 7]", "[5]"), r":4: candidates: expected one number, or one for each of the 2 goals"),
        (("none", "0.5"), r":5: max_detour: expected a number of at least 1"),
        (("max_range", "range"), r":6: lidar.range: expected 'rate'|:6: lidar.range: expected"),
        (("180", "2"), r":6: lidar: expected settings in their ranges, got expected num_beams"),
        (("0.02", "-1"), r":7: robot: expected settings in their ranges"),
        (
            ("none", "none\nrobot_radius: 0.2"),
            r":6: robot_radius: expected at least the radius of the chassis, 0.25 m, got 0.2",
        ),
        (("[9, 9]", "[5, 5]"), r"got expected room for a robot .* at the goal 1 \(5, 5\)"),
        (("candidates", "candidate"), r"expected 'candidates', got the unknown key 'candidate'"),
    ],
)
def test_mistakes_are_named_with_their_place(folder, change, message):
    with pytest.raises(FileError, match=message) as caught:
        scenario_of(write(folder, GOOD.replace(*change)))
    assert "room.yaml" in str(caught.value)


def test_a_name_that_is_none_is_refused():
    with pytest.raises(InvalidInputError, match=r"office, lab, corridors, or a \.yaml file, got 'ofice'"):
        scenario_of("ofice")


def test_decisions_are_by_error_or_as_a_file_says(folder):
    least = "map: walls.csv\nstart: [1, 1]\ngoals: [[9, 9]]\n"
    for text, decision in (
        ("", ("error", None, None)),
        ("as_paper: true\n", ("joint", "spanning_trees", ClosureModel.paper())),
        ("as_paper: true\nobjective: map\nclosures: learned\n", ("map", "spanning_trees", None)),
        ("strategy: optimum\n", ("error", "optimum", None)),
    ):
        scenario = scenario_of(write(folder, least + text))
        assert (scenario.objective, scenario.strategy, scenario.rule.closures) == decision
    for text, message in (
        ("objective: entropy\n", ":4: objective: expected one of joint, map, per_pose, error, got 'entropy'"),
        ("strategy: best\n", ":4: strategy: expected a strategy of"),
    ):
        with pytest.raises(FileError, match=message):
            scenario_of(write(folder, least + text))


def test_detour_limits():
    office = scenario_of("office")
    assert with_detour(office, None).rule.max_detour == 1.3
    assert with_detour(office, 0).rule.max_detour is None
    assert with_detour(office, 2).rule.max_detour == 2
    with pytest.raises(InvalidInputError, match="at least 1"):
        with_detour(office, 0.5)
