"""The command as a shell sees it: rows, a table, pictures; one line for what is wrong; a study that survives being killed."""

from __future__ import annotations

import csv
import json
import os
import random
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import sleep

import pyarrow.dataset
import pytest
from PIL import Image

from topobelief.cli import app, run_progress
from topobelief.cli.app import BAD_INPUT
from topobelief.cli.run_progress import RunProgress, description
from topobelief.runs.run import Progress
from topobelief.study.dataset import read_table, repeatable

KILLS = int(os.environ.get("TOPOBELIEF_KILLS", "2"))
"""How often a study is killed; set it higher to try harder."""

SPECIFICATION = """worlds: {room: room.csv}
sessions:
  across: {start: [1, 1], goals: [[11, 11]], candidates: 4}
noises: [{sigma_p: 0.1, sigma_theta: 0.035}]
strategies: [spanning_trees, shortest]
seeds: SEEDS
rule: {num_vertices: 100, max_detour: none}
"""


@pytest.fixture
def specification(tmp_path: Path) -> Callable[[int], Path]:
    """A study of two strategies with so many seeds."""

    def write(seeds: int) -> Path:
        (tmp_path / "room.csv").write_text("# bounds: 0 0 12 12\nx_min,y_min,x_max,y_max\n3,3,7,7\n")
        path = tmp_path / "study.yaml"
        path.write_text(SPECIFICATION.replace("SEEDS", str(seeds)))
        return path

    return write


def test_a_study_and_its_report(topobelief, specification, tmp_path):
    outcome = topobelief(["study", str(specification(2)), "--workers", "1"])
    assert outcome.code == 0
    assert "out/study: 4 tasks, 4 of them now" in outcome.out
    assert pyarrow.dataset.dataset(tmp_path / "out/study/rows").to_table().num_rows == 4

    again = topobelief(["study", str(specification(3)), "--workers", "1", "--json"])
    document = json.loads(again.out)
    assert (document["num_tasks"], document["num_played"], document["num_failed"]) == (6, 2, 0)

    report = topobelief(["study-report", "out/study"])
    assert report.code == 0
    assert re.search(r"spanning_trees +\d+% +\d+–\d+ +[\d.]+ +[\d.]+ +[-\d.]+ +0\.0 +[\d.]+ +3 +–", report.out)
    folder = tmp_path / "out/study/report"
    figures = {f"{name}.{suffix}" for name in ("choices", "losses", "orders", "times") for suffix in ("png", "pdf")}
    assert {path.name for path in folder.iterdir()} == figures | {"summary.csv"}
    for name in ("choices", "losses", "orders", "times"):
        with Image.open(folder / f"{name}.png") as image:
            assert image.width > 1000
    with (folder / "summary.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert [(line["strategy"], line["num_ok"]) for line in lines] == [("shortest", "3"), ("spanning_trees", "3")]

    groups = json.loads(topobelief(["study-report", "out/study", "--json"]).out)["groups"]
    assert [group["loss_mean"] for group in groups] == pytest.approx([float(line["loss_mean"]) for line in lines])


def test_failures_are_told(topobelief, specification):
    path = specification(1)
    path.write_text(path.read_text().replace("[11, 11]", "[5, 5]"))
    outcome = topobelief(["study", str(path), "--workers", "1"])
    assert outcome.code == 0
    assert "2 failed, see the column error; the first one now: PlanningError: expected a goal with more" in outcome.out
    assert topobelief(["study-report", "out/study"]).code == 0  # of what is there: nothing but failures


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["study", "nowhere.yaml"], "nowhere.yaml: expected a file to read, got nothing of that name"),
        (["study", "study.yaml", "--workers", "0"], "Input should be greater than or equal to 1"),
        (["study", "study.yaml", "--workers", "2", "--scheduler", "tcp://127.0.0.1:9"], "expected one of --workers and"),
        (["study", "study.yaml", "--out", "room.csv"], "room.csv: expected a folder to write to, got a file"),
        (["study", "study.yaml", "--scheduler", "no address"], "expected a dask scheduler at no address"),
        (["study-report", "nowhere"], "nowhere: expected the folder of a study, got one without rows"),
    ],
)
def test_bad_input_is_one_line(topobelief, specification, tmp_path, arguments, message):
    specification(1)
    outcome = topobelief(arguments)
    assert outcome.code == BAD_INPUT
    assert message in outcome.err
    assert outcome.err.count("\n") == 1
    assert outcome.out == ""
    assert not list(tmp_path.rglob("*.parquet"))


def test_a_mistake_in_the_specification_makes_no_folder(topobelief, specification, tmp_path):
    path = specification(1)
    path.write_text(path.read_text().replace("seeds: 1", "seeds: one"))
    outcome = topobelief(["study", str(path)])
    assert outcome.err == f"topobelief: {path}:6: seeds: expected a whole number of at least 1, got 'one'\n"
    assert not (tmp_path / "out").exists()


def test_another_rule_needs_another_folder(topobelief, specification):
    path = specification(1)
    topobelief(["study", str(path), "--workers", "1"])
    path.write_text(path.read_text().replace("num_vertices: 100", "num_vertices: 101"))
    outcome = topobelief(["study", str(path), "--workers", "1"])
    assert outcome.code == BAD_INPUT
    assert "got one of another map, session or rule for across in room; choose another --out" in outcome.err


def test_missing_extras_are_named(topobelief, specification, monkeypatch):
    path = specification(1)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert "pip install 'topobelief[study]'" in topobelief(["study", str(path)]).err
    monkeypatch.undo()
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "pip install 'topobelief[cluster]'" in topobelief(["study", str(path), "--scheduler", "tcp://127.0.0.1:9"]).err


def run(path: Path, out: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", "from topobelief.cli import main; main()", "study", str(path), "--out", str(out)]
    return subprocess.Popen([*command, "--workers", "2"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def row_count(out: Path) -> int:
    return pyarrow.dataset.dataset(out / "rows").count_rows() if (out / "rows").exists() else 0


def test_a_study_killed_at_random_loses_and_repeats_no_row(specification, tmp_path):
    path, out, rng = specification(10 + 10 * KILLS), tmp_path / "killed", random.Random(5)
    total, kept = 2 * (10 + 10 * KILLS), 0
    for _ in range(KILLS):
        process = run(path, out)
        while process.poll() is None and row_count(out) <= kept:  # until it plays
            sleep(0.02)
        sleep(rng.uniform(0.0, 0.1))
        process.kill()
        process.communicate()
        now = row_count(out)
        assert kept <= now
        kept = now
    assert 0 < kept < total
    for folder in (out, tmp_path / "whole"):
        process = run(path, folder)
        assert process.communicate() == (None, b"")
        assert process.returncode == 0
    killed, whole = (repeatable(read_table(folder)) for folder in (out, tmp_path / "whole"))
    assert killed.num_rows == total
    assert len(set(killed["task"].to_pylist())) == total
    assert killed.equals(whole)


def test_ctrl_c_leaves_whole_rows(specification, tmp_path):
    path, out = specification(40), tmp_path / "stopped"
    process = run(path, out)
    while process.poll() is None and row_count(out) < 3:
        sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate()
    assert process.returncode == app.INTERRUPTED
    assert said.decode() == "topobelief: interrupted; nothing was left half-written\n"
    assert 3 <= row_count(out) < 80


def test_progress_is_a_sentence():
    assert description(Progress(0, 0, 120, None), "tasks") == "tasks 0/120"
    assert description(Progress(40, 2, 120, 61.2), "tasks") == "tasks 40/120, 2 failed, some 61 s left"
    assert description(Progress(40, 0, 120, 250.0), "tasks") == "tasks 40/120, some 4 min left"
    assert description(Progress(40, 0, 120, 9000.0), "tasks") == "tasks 40/120, some 2.5 h left"
    assert description(Progress(120, 0, 120, 0.0), "tasks") == "tasks 120/120"


def test_a_log_gets_a_line_now_and_then(capsys, monkeypatch):
    clock = iter([0.0, 10.0, 31.0, 31.0, 40.0])
    monkeypatch.setattr(run_progress.time, "monotonic", lambda: next(clock))
    with RunProgress("tasks") as progress:
        for done in range(3):
            progress.update(Progress(done, 0, 9, None))
    assert capsys.readouterr().err == "topobelief: tasks 1/9\n"
