"""Reproductions continue where they stopped, refuse to mix, and keep every number."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from reproductions import SMALLEST, copy_of_smallest_reproduction
from topobelief.errors import FileError, InvalidInputError
from topobelief.io.row_files import csv_text
from topobelief.reproduction import run as reproduction
from topobelief.reproduction.path_length import LengthRow
from topobelief.reproduction.plan import ReproductionPlan
from topobelief.reproduction.planning_sessions import ActionRow
from topobelief.reproduction.run import Part, experiments, measure, reproduce
from topobelief.runs.in_process import InProcess
from topobelief.runs.local_workers import LocalWorkers
from topobelief.runs.run import UnfinishedRunError


def without(folder: Path, *parts: str) -> None:
    """Take parts out of the journal, as if the run had been stopped before them."""
    path = folder / "journal.jsonl"
    header, *lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    path.write_text(header + "".join(line for line in lines if json.loads(line)["task"] not in parts), encoding="utf-8")


def test_a_reproduction_that_was_stopped_continues_with_the_same_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = copy_of_smallest_reproduction(tmp_path)
    table = (tmp_path / "tables" / "planning_sessions.csv").read_bytes()
    without(tmp_path, "planning_sessions/seed0-S1-xi0.1", "path_length/seed0")
    measured: list[str] = []
    monkeypatch.setattr(reproduction, "measure", lambda part: measured.append(part.id) or measure(part))
    again = reproduce(SMALLEST, tmp_path, InProcess())
    assert measured == ["planning_sessions/seed0-S1-xi0.1", "path_length/seed0"]
    assert (tmp_path / "tables" / "planning_sessions.csv").read_bytes() == table
    assert again.actions == found.actions
    assert again.times == found.times  # not timed again
    assert again.seconds > 0
    assert len(found.actions) == 3 * (9 + 20)
    assert {row.session for row in found.actions} == {"S1", "S2"}
    assert table.decode() == csv_text(ActionRow, found.actions)


def test_worker_processes_measure_the_same(tmp_path: Path) -> None:
    found = copy_of_smallest_reproduction(tmp_path)
    without(tmp_path, "path_length/seed0")
    again = reproduce(SMALLEST, tmp_path, LocalWorkers(1, one_thread=False))
    assert csv_text(LengthRow, again.lengths) == csv_text(LengthRow, found.lengths)


def test_another_plan_or_version_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    copy_of_smallest_reproduction(tmp_path)
    with pytest.raises(FileError, match="the same settings, seed 1, got seed 0; choose another --out"):
        reproduce(dataclasses.replace(SMALLEST, seed=1), tmp_path, InProcess())
    monkeypatch.setattr(reproduction, "describe_machine", lambda: {"topobelief": "another"})
    with pytest.raises(FileError, match='topobelief "another", got topobelief'):
        reproduce(SMALLEST, tmp_path, InProcess())


def test_a_file_that_changed_is_another_run(tmp_path: Path) -> None:
    plan = dataclasses.replace(SMALLEST, files=(tmp_path / "x.g2o",))
    digests = []
    for text in ("one", "another"):
        (tmp_path / "x.g2o").write_text(text)
        digests.append(reproduction._settings(plan, "1")["files"])
    assert digests[0] != digests[1]


def test_a_part_that_fails_is_named_and_tried_again(tmp_path: Path) -> None:
    """The others are measured all the same."""
    copy_of_smallest_reproduction(tmp_path / "out")
    (tmp_path / "x.g2o").write_text("no graph")
    plan = dataclasses.replace(SMALLEST, files=(tmp_path / "x.g2o",))
    (tmp_path / "out" / "journal.jsonl").write_text(
        (tmp_path / "out" / "journal.jsonl").read_text().replace('"files": {}', f'"files": {files_of(plan)}')
    )
    for _ in range(2):
        with pytest.raises(UnfinishedRunError, match=r"got 3 that failed, the first with FileError: .*x\.g2o"):
            reproduce(plan, tmp_path / "out", InProcess())


def files_of(plan: ReproductionPlan) -> str:
    return json.dumps(reproduction._settings(plan, "1")["files"])


def test_every_part_has_an_id_of_its_own() -> None:
    plan = ReproductionPlan.for_a_first_look()
    ids = [Part(plan, experiment.name, name).id for experiment in experiments(plan) for name in experiment.parts]
    assert len(set(ids)) == len(ids) > 100


def test_a_missing_pose_graph_is_named_before_any_work(tmp_path: Path) -> None:
    plan = dataclasses.replace(SMALLEST, files=(tmp_path / "none.g2o",))
    with pytest.raises(FileError, match=r"none\.g2o: expected a pose graph to read, got no such file"):
        reproduce(plan, tmp_path / "out", InProcess())
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
        ReproductionPlan(**changes)  # type: ignore[arg-type]  (wrong on purpose)
