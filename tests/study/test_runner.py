"""A study keeps every row, repeats none and stops for nothing; who plays, and in which order, does not show."""

from __future__ import annotations

import random
import threading
import time

import psutil
import pytest

from study_plays import deadly, failing, mute, quick, slow
from topobelief.errors import InvalidInputError
from topobelief.runs import worker_process
from topobelief.runs.attempt import MAX_ATTEMPTS, Finished, Outcome, attempt, with_second_chance
from topobelief.runs.local_workers import LocalWorkers
from topobelief.runs.worker_process import WorkerDiedError
from topobelief.study.dataset import Dataset, read_table, repeatable
from topobelief.study.runner import run_study


class InPlace:
    """This process, in the order of the tasks or in another; stops after some where told."""

    def __init__(self, *, shuffle: int | None = None, stop_after: int | None = None) -> None:
        self.shuffle, self.stop_after = shuffle, stop_after

    def run(self, play, tasks):
        order = list(tasks)
        if self.shuffle is not None:
            random.Random(self.shuffle).shuffle(order)
        for number, task in enumerate(order):
            if number == self.stop_after:
                raise KeyboardInterrupt
            yield Finished(task, attempt(play, task), 1)


def rows(folder) -> bytes:
    """All but the times, to the last bit."""
    table = repeatable(read_table(folder))
    batch = table.combine_chunks().to_batches()[0]
    return batch.serialize().to_pybytes()


@pytest.fixture
def reference(make_tasks, tmp_path) -> bytes:
    run_study(make_tasks(), tmp_path / "reference", InPlace(), play=quick)
    return rows(tmp_path / "reference")


@pytest.mark.parametrize("seed", [0, 1])
def test_the_order_does_not_show(make_tasks, tmp_path, reference, seed):
    run_study(make_tasks(), tmp_path / "out", InPlace(shuffle=seed), play=quick)
    assert rows(tmp_path / "out") == reference


@pytest.mark.parametrize("num_workers", [1, 3])
def test_the_number_of_workers_does_not_show(make_tasks, tmp_path, plays_folder, reference, num_workers):
    outcome = run_study(make_tasks(), tmp_path / "out", LocalWorkers(num_workers), play=quick)
    assert (outcome.num_tasks, outcome.num_done_now, outcome.num_failed) == (24, 24, 0)
    assert rows(tmp_path / "out") == reference


def test_real_sessions_give_the_same_rows_here_and_in_workers(make_tasks, tmp_path):
    tasks = make_tasks(seeds="[4]")
    run_study(tasks, tmp_path / "here", InPlace())
    run_study(tasks, tmp_path / "there", LocalWorkers(2))
    assert rows(tmp_path / "here") == rows(tmp_path / "there")
    assert set(read_table(tmp_path / "here")["status"].to_pylist()) == {"ok"}


def test_an_interrupted_study_continues_and_repeats_nothing(make_tasks, tmp_path, reference):
    tasks, played = make_tasks(), []

    def counted(task):
        played.append(task.id)
        return quick(task)

    for stop_after in (5, 0, 11):
        with pytest.raises(KeyboardInterrupt):
            run_study(tasks, tmp_path / "out", InPlace(stop_after=stop_after), play=counted)
        assert len(Dataset(tmp_path / "out")) == len(played)
    outcome = run_study(tasks, tmp_path / "out", InPlace(), play=counted)
    assert outcome.num_done_now == len(tasks) - 16
    assert sorted(played) == sorted(task.id for task in tasks)
    assert rows(tmp_path / "out") == reference
    assert run_study(tasks, tmp_path / "out", InPlace(), play=counted).num_done_now == 0


def test_what_fails_is_recorded_and_the_rest_goes_on(make_tasks, tmp_path):
    tasks = make_tasks()
    outcome = run_study(tasks, tmp_path / "out", InPlace(), play=failing)
    table = read_table(tmp_path / "out")
    errors = dict(zip(table["seed"].to_pylist(), table["error"].to_pylist(), strict=True))
    assert errors[0] is None
    assert errors[1] == "PlanningError: expected a goal, got a wall"
    assert errors[2].startswith("ZeroDivisionError: division by zero (study_plays.py:")
    assert table["status"].to_pylist().count("failed") == outcome.num_failed == 16
    assert outcome.first_error == errors[1]


def test_failed_tasks_are_played_again_only_where_asked(make_tasks, tmp_path):
    tasks = make_tasks()
    run_study(tasks, tmp_path / "out", InPlace(), play=failing)
    again = run_study(tasks, tmp_path / "out", InPlace(), play=quick)
    assert (again.num_done_now, again.num_failed) == (0, 16)
    again = run_study(tasks, tmp_path / "out", InPlace(), play=quick, retry_failed=True)
    assert (again.num_done_now, again.num_failed) == (16, 0)


def test_a_worker_that_dies_costs_only_its_task(make_tasks, tmp_path, plays_folder):
    tasks = make_tasks(strategies="[random]")[:12:4]
    assert [task.seed for task in tasks] == [0, 1, 2]
    outcome = run_study(tasks, tmp_path / "out", LocalWorkers(2), play=deadly)
    table = read_table(tmp_path / "out")
    found = {
        seed: (status, error, attempts)
        for seed, status, error, attempts in zip(
            *(table[name].to_pylist() for name in ("seed", "status", "error", "attempts")), strict=True
        )
    }
    assert found[0] == ("ok", None, 1)
    assert found[1][0] == "failed"
    assert found[1][1].startswith("WorkerDiedError: a worker died (SIGKILL)")
    assert found[1][2] == 2 * MAX_ATTEMPTS
    assert found[2] == ("ok", None, 2)
    assert outcome.num_failed == 1


def test_bad_luck_is_not_blamed(make_tasks, tmp_path):
    """Workers that die over a task while others play are forgiven if it does no harm alone."""
    tasks, calls = make_tasks()[:3], []

    class Unlucky(InPlace):
        def run(self, play, tasks):
            return with_second_chance(lambda some: self.once(play, some), tasks)

        def once(self, play, tasks):
            calls.append([task.id for task in tasks])
            for finished in super().run(play, tasks):
                lucky = len(tasks) == 1 or finished.task is not tasks[1]
                yield finished if lucky else Finished(finished.task, Outcome(None, "dead", worker_lost=True), 3)

    outcome = run_study(tasks, tmp_path / "out", Unlucky(), play=quick)
    assert outcome.num_failed == 0
    assert calls == [[task.id for task in tasks], [tasks[1].id]]
    attempts = dict(zip(*(read_table(tmp_path / "out")[name].to_pylist() for name in ("task", "attempts")), strict=True))
    assert [attempts[task.id] for task in tasks] == [1, 4, 1]


def test_the_last_words_of_a_worker_are_kept(make_tasks, tmp_path, plays_folder):
    outcome = run_study(make_tasks()[:1], tmp_path / "out", LocalWorkers(1), play=mute)
    assert outcome.first_error == "WorkerDiedError: a worker died (exit code 3): out of luck"


def test_workers_killed_at_random_lose_and_repeat_no_row(make_tasks, tmp_path, plays_folder, reference):
    over, rng = threading.Event(), random.Random(8)

    def kill_some() -> None:
        for _ in range(2 * MAX_ATTEMPTS - 1):  # so that no task can be unlucky each time
            over.wait(rng.uniform(0.1, 0.7))
            children = [child for child in psutil.Process().children() if "worker" in " ".join(child.cmdline())]
            if children and not over.is_set():
                rng.choice(children).kill()

    killer = threading.Thread(target=kill_some)
    killer.start()
    try:
        outcome = run_study(make_tasks(), tmp_path / "out", LocalWorkers(2), play=slow)
    finally:
        over.set()
        killer.join()
    assert outcome.num_failed == 0
    assert rows(tmp_path / "out") == reference


def test_workers_that_cannot_start_end_the_study(make_tasks, tmp_path, monkeypatch):
    monkeypatch.setattr(worker_process.sys, "executable", "/bin/false")
    with pytest.raises(WorkerDiedError, match=r"expected worker processes that start, got: a worker died \(exit code 1\)"):
        run_study(make_tasks(), tmp_path / "out", LocalWorkers(2))


def test_no_worker_outlives_a_study_that_stops(make_tasks, tmp_path, plays_folder):
    def interrupt(progress) -> None:
        if progress.done == 2:
            raise KeyboardInterrupt

    before = set(psutil.Process().children())
    with pytest.raises(KeyboardInterrupt):
        run_study(make_tasks(), tmp_path / "out", LocalWorkers(2), play=slow, on_progress=interrupt)
    assert set(psutil.Process().children()) <= before
    assert len(Dataset(tmp_path / "out")) == 2


def test_progress_counts_and_estimates(make_tasks, tmp_path, monkeypatch):
    clock = iter(float(second) for second in range(0, 1000, 10))
    monkeypatch.setattr(time, "monotonic", lambda: next(clock))
    seen = []
    with pytest.raises(KeyboardInterrupt):
        run_study(make_tasks(), tmp_path / "out", InPlace(stop_after=4), play=failing, on_progress=seen.append)
    run_study(make_tasks(), tmp_path / "out", InPlace(stop_after=None), play=failing, on_progress=seen.append)
    assert [one.done for one in seen] == [0, 1, 2, 3, 4, 4, *range(5, 25)]
    assert {one.total for one in seen} == {24}
    assert seen[0].seconds_left is None
    assert seen[1].seconds_left == pytest.approx(230)  # one task in 10 s, 23 to go
    assert seen[6].seconds_left == pytest.approx(190)  # this run's rate, what it has left
    assert (seen[-1].seconds_left, seen[-1].failed) == (0, 16)


def test_at_least_one_worker():
    with pytest.raises(InvalidInputError, match="expected at least 1 worker, got 0"):
        LocalWorkers(0)
