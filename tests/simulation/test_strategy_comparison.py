"""A comparison as a run: seeds in processes that die, hang and are interrupted, and a folder that continues."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from compared_plays import deadly, quick, slow
from topobelief.errors import FileError, InvalidInputError
from topobelief.io.row_files import csv_text
from topobelief.runs import local_workers
from topobelief.runs.in_process import InProcess
from topobelief.runs.local_workers import LocalWorkers
from topobelief.runs.run import UnfinishedRunError
from topobelief.simulation import strategy_comparison
from topobelief.simulation.comparison import HINDSIGHT, ComparedRun
from topobelief.simulation.episode import Episode
from topobelief.simulation.noise import InjectedNoise
from topobelief.simulation.record import RunOptions
from topobelief.simulation.strategy_comparison import ComparisonTask, SeedTask, compare, play


@pytest.fixture
def task(tmp_path: Path) -> ComparisonTask:
    """One goal behind a pillar, and two ways to it."""
    (tmp_path / "walls.csv").write_text("# bounds: 0 0 6 6\nx_min,y_min,x_max,y_max\n2.5,2.5,3.5,3.5\n")
    (tmp_path / "room.yaml").write_text("map: walls.csv\nstart: [1, 1]\ngoals: [[5, 5]]\ncandidates: 2\n")
    return ComparisonTask(
        scenario=str(tmp_path / "room.yaml"),
        max_detour=0,
        strategies=("shortest", "path-1"),
        options=RunOptions(noise=InjectedNoise.of_ratio(0.35)),
        num_redraws=2,
    )


def workers() -> list[psutil.Process]:
    return [child for child in psutil.Process().children() if "topobelief.runs.worker" in child.cmdline()]


def test_strategies_of_a_seed_share_the_start(task):
    """With one goal they share the first pose alone, on which no error is left."""
    shortest, second = play(SeedTask(task, 0))
    assert (shortest.seed, shortest.strategy, second.strategy) == (0, "shortest", "path-1")
    assert shortest.outcome == second.outcome == "arrived"
    assert shortest.planned == shortest.shortest < second.planned
    assert shortest.num_shared == 1
    assert shortest.error_shared < 1e-9 < shortest.error_all


def test_each_candidate_is_driven_once(task, monkeypatch):
    """Strategies that choose the same path share its drive, and hindsight drives the rest."""
    driven = []
    drive = Episode.run
    monkeypatch.setattr(Episode, "run", lambda episode, **options: driven.append(episode) or drive(episode, **options))
    names = ("shortest", "optimum", "spanning_trees:joint", HINDSIGHT)
    runs = play(SeedTask(replace(task, strategies=names), 0))
    assert len(driven) == 2
    by_name = {run.strategy: run for run in runs}
    assert list(by_name) == [*names, "path-0", "path-1"]
    assert replace(by_name["path-0"], strategy="shortest") == by_name["shortest"]
    assert [by_name[name].chosen for name in ("path-0", "path-1")] == [0, 1]
    assert by_name[HINDSIGHT].error_shared == min(by_name[f"path-{k}"].error_shared for k in range(2))


def test_the_summary_is_of_the_strategies_that_were_asked_for(task, tmp_path, monkeypatch):
    monkeypatch.setattr(strategy_comparison, "play", lambda seed: [*quick(seed), replace(quick(seed)[0], strategy="path-7")])
    found = compare(task, 1, tmp_path, InProcess())
    assert [run.strategy for run in found.runs] == ["shortest", "path-1", "path-7"]
    assert [each.strategy for each in found.summaries] == ["shortest", "path-1"]


def test_physical_noise_is_refused(task):
    with pytest.raises(InvalidInputError, match="expected injected noise"):
        replace(task, options=RunOptions())


def test_processes_give_what_this_one_gives(task, tmp_path):
    here, there = (compare(task, 1, tmp_path / str(n), executor) for n, executor in enumerate((InProcess(), LocalWorkers(2))))
    assert here.runs == there.runs
    assert [run.outcome for run in here.runs] == ["arrived", "arrived"]


def test_a_comparison_continues_and_grows(task, tmp_path, monkeypatch):
    played = []
    monkeypatch.setattr(strategy_comparison, "play", lambda seed: played.append(seed.seed) or quick(seed))
    alone = compare(task, 1, tmp_path, InProcess())
    again = compare(task, 2, tmp_path, InProcess())
    assert played == [0, 1]
    assert (alone.num_seeds_now, again.num_seeds_now) == (1, 1)
    assert csv_text(ComparedRun, again.runs[:2]) == csv_text(ComparedRun, alone.runs)
    assert [(run.seed, run.strategy) for run in again.runs] == [(s, name) for s in (0, 1) for name in task.strategies]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"num_redraws": 3}, "num_redraws 3, got num_redraws 2; choose another --out"),
        ({"strategies": ("shortest",)}, "strategies"),
    ],
)
def test_another_comparison_is_refused(task, tmp_path, monkeypatch, change, message):
    monkeypatch.setattr(strategy_comparison, "play", quick)
    compare(task, 1, tmp_path, InProcess())
    with pytest.raises(FileError, match=message):
        compare(replace(task, **change), 1, tmp_path, InProcess())


def test_another_map_under_the_same_name_is_refused(task, tmp_path, monkeypatch):
    monkeypatch.setattr(strategy_comparison, "play", quick)
    compare(task, 1, tmp_path, InProcess())
    walls = tmp_path / "walls.csv"
    walls.write_text(walls.read_text().replace("2.5,2.5", "2.4,2.5"))
    with pytest.raises(FileError, match=r"content .*, got content"):
        compare(task, 1, tmp_path, InProcess())


def test_a_worker_killed_in_the_middle_costs_nothing(task, tmp_path, monkeypatch, importing_workers):
    """Its seed is begun again, and the seeds after it are driven too."""
    monkeypatch.setattr(strategy_comparison, "play", slow)
    killed: list[int] = []

    def kill_the_worker(progress) -> None:
        if progress.done == 1:
            (worker,) = workers()
            worker.kill()
            killed.append(worker.pid)

    found = compare(task, 3, tmp_path, LocalWorkers(1), on_progress=kill_the_worker)
    assert found.failed == {}
    drove = [run.num_closures for run in found.runs[::2]]  # see compared_plays
    assert drove[0] == killed[0] != drove[1] == drove[2]


def test_seeds_that_always_kill_or_hang_fail_and_are_named(task, tmp_path, monkeypatch, importing_workers):
    monkeypatch.setattr(strategy_comparison, "play", deadly)
    monkeypatch.setattr(local_workers, "MAX_ATTEMPTS", 1)  # each of the more is a process to start
    found = compare(task, 4, tmp_path, LocalWorkers(2, max_seconds=5))
    assert {run.seed for run in found.runs} == {0, 3}
    assert found.failed == {
        1: "WorkerDiedError: a worker died (SIGKILL)",
        2: "WorkerTooSlowError: a worker took more than 5 s over one task",
    }
    assert compare(task, 4, tmp_path, InProcess()).num_seeds_now == 0
    monkeypatch.setattr(strategy_comparison, "play", quick)
    again = compare(task, 4, tmp_path, InProcess(), retry_failed=True)
    assert (again.num_seeds_now, again.failed) == (2, {})


def test_an_interruption_keeps_the_seeds_that_are_done_and_no_worker(task, tmp_path, monkeypatch, importing_workers):
    monkeypatch.setattr(strategy_comparison, "play", slow)

    def interrupt(progress) -> None:
        if progress.done == 2:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        compare(task, 5, tmp_path, LocalWorkers(2), on_progress=interrupt)
    assert workers() == []
    assert compare(task, 5, tmp_path, InProcess()).num_seeds_now == 3


def test_a_comparison_without_a_seed_that_works_is_an_error(task, tmp_path, monkeypatch):
    monkeypatch.setattr(strategy_comparison, "play", lambda seed: 1 / 0)
    with pytest.raises(UnfinishedRunError, match="got 2 that failed, the first with ZeroDivisionError"):
        compare(task, 2, tmp_path, InProcess())
