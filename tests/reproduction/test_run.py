"""Reproductions continue where they stopped, refuse to mix, and keep every number."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from reproductions import SMALLEST, copy_of_smallest_reproduction
from topobelief.errors import FileError, InvalidInputError
from topobelief.io.row_files import csv_text, read_rows, write_rows
from topobelief.reproduction import run as reproduction
from topobelief.reproduction.planning_sessions import ActionRow
from topobelief.reproduction.run import Experiment, ReproductionPlan, reproduce


@dataclasses.dataclass(frozen=True)
class Row:
    name: str
    count: int
    value: float
    fine: bool


ROWS = [Row('a, "b"\nc', 3, 0.1 + 0.2, True), Row("", -1, float("nan"), False), Row("x", 0, float("-inf"), True)]


def test_rows_read_back_to_the_last_bit(tmp_path: Path) -> None:
    write_rows(tmp_path / "new" / "rows.csv", Row, ROWS)
    read = read_rows(tmp_path / "new" / "rows.csv", Row)
    assert csv_text(Row, read) == csv_text(Row, ROWS)
    assert read[0] == ROWS[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,count\n", "rows.csv:1: expected the columns name,count,value,fine"),
        ("name,count,value,fine\na,1,2.0,True\nb,one,2.0,True\n", "rows.csv:3: expected a row of Row"),
        ("name,count,value,fine\na,1,2.0\n", "rows.csv:2: expected a row of Row"),
        ("", "rows.csv: expected a text file, got an empty one"),
    ],
)
def test_a_file_that_holds_other_rows_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "rows.csv").write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=message):
        read_rows(tmp_path / "rows.csv", Row)


class Interrupted(Exception):
    pass


def fake_experiments(measured: list[str], *, fail_at: str = "") -> tuple[Experiment[Row], ...]:
    """Two tables of two parts that note when they are measured."""

    def part(name: str) -> list[Row]:
        if name == fail_at:
            raise Interrupted
        measured.append(name)
        return [Row(name, len(measured), 0.5, True)]

    return tuple(
        Experiment(table, table, Row, {name: lambda name=f"{table}-{name}": part(name) for name in ("one", "two")})
        for table in ("first", "second")
    )


def run_parts(folder: Path, experiments: tuple[Experiment[Row], ...]) -> list[Row]:
    rows: list[Row] = []
    for experiment in experiments:
        for part, _ in reproduction._parts(experiment, folder / experiment.name, lambda *_: None):
            rows += part
    return rows


def test_a_run_that_was_stopped_continues_and_repeats_nothing(tmp_path: Path) -> None:
    measured: list[str] = []
    with pytest.raises(Interrupted):
        run_parts(tmp_path, fake_experiments(measured, fail_at="second-one"))
    assert measured == ["first-one", "first-two"]
    rows = run_parts(tmp_path, fake_experiments(measured))
    assert measured == ["first-one", "first-two", "second-one", "second-two"]
    assert [row.name for row in rows] == measured
    assert not list(tmp_path.glob("**/.*"))  # nothing half-written


def test_tables_are_the_same_whether_or_not_the_run_was_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = copy_of_smallest_reproduction(tmp_path)
    table = (tmp_path / "tables" / "planning_sessions.csv").read_bytes()
    kept = sorted((tmp_path / "parts" / "planning_sessions").glob("*.csv"))
    kept[0].unlink()
    again = reproduce(SMALLEST, tmp_path)
    assert (tmp_path / "tables" / "planning_sessions.csv").read_bytes() == table
    assert again.actions == found.actions
    assert again.times == found.times  # not timed again
    assert again.seconds >= found.seconds
    assert len(found.actions) == 3 * (9 + 20)
    assert {row.session for row in found.actions} == {"S1", "S2"}
    assert read_rows(tmp_path / "tables" / "planning_sessions.csv", ActionRow) == found.actions
    noted = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))
    assert noted["plan"]["num_seeds"] == 1
    assert noted["machine"]["topobelief"]
    with pytest.raises(InvalidInputError, match="the same settings, got others; choose another --out"):
        reproduce(dataclasses.replace(SMALLEST, seed=1), tmp_path)
    monkeypatch.setattr(reproduction, "describe_machine", lambda: {"topobelief": "another"})
    with pytest.raises(InvalidInputError, match="the same settings, got others"):
        reproduce(SMALLEST, tmp_path)


def test_a_folder_with_another_run_json_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text("[]", encoding="utf-8")
    with pytest.raises(FileError, match="expected the settings of a run"):
        reproduce(SMALLEST, tmp_path)


def test_a_missing_pose_graph_is_named_before_any_work(tmp_path: Path) -> None:
    plan = dataclasses.replace(SMALLEST, files=(tmp_path / "none.g2o",))
    with pytest.raises(FileError, match=r"none\.g2o: expected a pose graph to read, got no such file"):
        reproduce(plan, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"num_seeds": 0}, "num_seeds of at least 1, got 0"),
        ({"sizes": (100, 5)}, "sizes of at least 10, got 5"),
        ({"files": (Path("a/x.g2o"), Path("b/x.g2o"))}, "pose graphs of different names"),
    ],
)
def test_a_plan_that_cannot_be_measured_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        ReproductionPlan(**changes)  # type: ignore[arg-type]
