"""A worker that dies or hangs costs its task some attempts, and the other tasks nothing."""

from __future__ import annotations

from contextlib import closing

import psutil
import pytest

from topobelief.errors import InvalidInputError
from topobelief.runs.attempt import MAX_ATTEMPTS, Finished
from topobelief.runs.local_workers import LocalWorkers
from works import Number, attempts, squared


def worked_on(tasks, **options) -> dict[int, Finished]:
    with closing(LocalWorkers(2, **options).run(squared, tasks)) as finished:
        return {each.task.value: each for each in finished}


def test_a_worker_killed_costs_an_attempt(marks):
    tasks = [Number(value, str(marks), ("die",) if value == 2 else ()) for value in range(5)]
    found = worked_on(tasks)
    assert {value: each.outcome.result for value, each in found.items()} == {value: value**2 for value in range(5)}
    assert {value: each.attempts for value, each in found.items()} == attempts(marks) == {0: 1, 1: 1, 2: 2, 3: 1, 4: 1}


def test_a_task_that_kills_every_worker_fails_alone(marks):
    tasks = [Number(value, str(marks), ("die",) * 99 if value == 0 else ()) for value in range(4)]
    found = worked_on(tasks)
    assert [value for value, each in found.items() if each.failed] == [0]
    assert found[0].outcome.error == "WorkerDiedError: a worker died (SIGKILL)"
    assert found[0].attempts == attempts(marks)[0] == 2 * MAX_ATTEMPTS


@pytest.mark.parametrize("deed", ["hang", "stop"])
def test_a_worker_that_hangs_is_ended(marks, deed):
    """Its task has one more chance when nothing else is running."""
    tasks = [Number(0, str(marks), (deed,) * 99), Number(1, str(marks), (deed,)), *(Number(value) for value in range(2, 6))]
    before = set(psutil.Process().children())
    found = worked_on(tasks, max_seconds=0.5)
    assert found[0].outcome.error == "WorkerTooSlowError: a worker took more than 0.5 s over one task"
    assert (found[1].outcome.result, found[1].attempts) == (1, 2)
    assert attempts(marks) == {0: 2, 1: 2}
    assert [found[value].outcome.result for value in range(2, 6)] == [4, 9, 16, 25]
    assert set(psutil.Process().children()) <= before


def test_no_limit_is_none(marks):
    assert worked_on([Number(3)], max_seconds=None)[3].outcome.result == 9
    with pytest.raises(InvalidInputError, match="expected a time limit above 0 s for a task, got 0"):
        LocalWorkers(max_seconds=0)
