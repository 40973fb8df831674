"""Floor plans in CSV, and any map by its suffix."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from data_files import map_file
from topobelief.errors import FileError, InvalidMapError
from topobelief.io.floor_plan import read_walls, read_world
from topobelief.world import World

PLAN = "x_min,y_min,x_max,y_max\n1,1,2,2\n\n# a comment\n3, 3, 4.5, 4\n"


def write(folder: Path, text: str) -> Path:
    path = folder / "plan.csv"
    path.write_text(text)
    return path


def test_walls_are_boxes_and_the_plan_ends_where_they_end(tmp_path: Path) -> None:
    world = read_walls(write(tmp_path, PLAN))
    assert world.bounds == (1, 1, 4.5, 4)
    assert world.free.equals(World.from_boxes([(1, 1, 2, 2), (3, 3, 4.5, 4)]).free)


@pytest.mark.parametrize("line", ["# bounds: 0 -1 6 5", "#bounds : 0, -1, 6, 5"])
def test_a_comment_may_say_what_the_plan_shows(tmp_path: Path, line: str) -> None:
    assert read_walls(write(tmp_path, f"{line}\n{PLAN}")).bounds == (0, -1, 6, 5)
    assert read_walls(write(tmp_path, f"{PLAN}{line}\n")).bounds == (0, -1, 6, 5)


def test_a_plan_may_have_bounds_and_no_wall(tmp_path: Path) -> None:
    assert read_walls(write(tmp_path, "# bounds: 0 0 3 2\nx_min,y_min,x_max,y_max\n")).free.area == 6


def test_bounds_given_prevail(tmp_path: Path) -> None:
    path = write(tmp_path, f"# bounds: 0 -1 6 5\n{PLAN}")
    assert read_walls(path, bounds=(0, 0, 10, 10)).bounds == (0, 0, 10, 10)


def test_the_office_of_the_papers_sessions() -> None:
    """Start, first and second goal have 2.1, 0.8 and 1.3 m of clearance."""
    world = read_walls(map_file("willow_walls.csv"), bounds=(7, -9, 29, 9.5))
    clearance = world.clearance([(20, 0), (26, 8), (25, -2.95)])
    np.testing.assert_allclose(clearance, [2.1, 0.8, 1.3], atol=0.35)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty"),
        ("1,1,2,2\n", r"plan\.csv:1: expected the header x_min,y_min,x_max,y_max, got '1,1,2,2'"),
        ("# only a comment\n", "got no line but comments"),
        ("x_min,y_min,x_max,y_max\n1,1,2\n", r"plan\.csv:2: expected a wall as four numbers"),
        ("x_min,y_min,x_max,y_max\n1,1,2,2,3\n", r"plan\.csv:2: "),
        ("x_min,y_min,x_max,y_max\n1,1,2,2\n1,1,two,2\n", r"plan\.csv:3: .* got '1 1 two 2'"),
        ("x_min,y_min,x_max,y_max\n1,1,nan,2\n", r"plan\.csv:2: "),
        (
            "# bounds: 0 0 1e308 9\nx_min,y_min,x_max,y_max\n1,1,2,2\n",
            r"plan\.csv:1: expected bounds as four numbers .* within 1e9 m",
        ),
        ("x_min,y_min,x_max,y_max\n1,1,1,2\n", r"plan\.csv:2: .* min < max"),
        ("# bounds: 0 0 1\nx_min,y_min,x_max,y_max\n1,1,2,2\n", r"plan\.csv:1: expected bounds"),
        ("# bounds: 0 0 9 9\n# bounds: 0 0 5 5\nx_min,y_min,x_max,y_max\n", r"plan\.csv:2: expected bounds once"),
        ("x_min,y_min,x_max,y_max\n", "for a world without walls"),
        ("# bounds: 0 0 1 1\nx_min,y_min,x_max,y_max\n-1,-1,2,2\n", r"plan\.csv: expected a world with free space"),
    ],
)
def test_what_is_no_plan_is_refused_by_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        read_walls(write(tmp_path, text))


def test_bounds_given_that_are_none_are_the_callers_fault(tmp_path: Path) -> None:
    with pytest.raises((FileError, InvalidMapError), match="min < max"):
        read_walls(write(tmp_path, PLAN), bounds=(0, 0, -1, 1))


class TestBySuffix:
    def test_csv_and_yaml(self, tmp_path: Path) -> None:
        path = write(tmp_path, PLAN)
        assert read_world(path).free.equals(read_walls(path).free)
        assert read_world(path.rename(path.with_suffix(".CSV"))).bounds == (1, 1, 4.5, 4)
        assert read_world(map_file("tb3_sandbox.yaml")).bounds[2] == pytest.approx(9.2)

    @pytest.mark.parametrize("name", ["map.pgm", "map"])
    def test_anything_else_is_refused(self, tmp_path: Path, name: str) -> None:
        with pytest.raises(FileError, match=r"ends in \.yaml, \.yml \(ROS map\) or \.csv"):
            read_world(tmp_path / name)

    def test_an_image_leads_to_its_yaml_file(self, tmp_path: Path) -> None:
        with pytest.raises(FileError, match=r"got \.png; name the YAML file that belongs to the image"):
            read_world(tmp_path / "map.png")

    def test_a_missing_file_is_named(self, tmp_path: Path) -> None:
        for suffix in ("csv", "yaml", "yml"):
            with pytest.raises(FileError, match=f"nothing.{suffix}: expected a file to read"):
                read_world(tmp_path / f"nothing.{suffix}")
