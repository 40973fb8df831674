"""A run from start to end: a task that is finished is not worked on again, and every result is kept as soon as it is there.

Interrupted at any moment, a run leaves a store of whole results, and the same call with that store continues.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Protocol

from topobelief.errors import TopobeliefError
from topobelief.runs.attempt import Executor, Finished, R, T, Work


class Store(Protocol[T, R]):
    """Where finished tasks are kept."""

    def __contains__(self, task: str, /) -> bool:
        """Whether the task of this id is finished, with a result or failed."""
        ...

    def failed(self, tasks: Iterable[str], /) -> int:
        """How many of the tasks have failed."""
        ...

    def add(self, finished: Finished[T, R], /) -> None:
        """Keep it, whole or not at all."""
        ...

    def drop_failed(self) -> None:
        """Forget the tasks that failed, so that they are worked on again."""
        ...


class UnfinishedRunError(TopobeliefError):
    """Too many tasks of a run failed to make anything of the others."""


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a run has come.

    Attributes
    ----------
    done, failed, total : int
        Tasks of the whole run, earlier sessions of it included; the failed ones count as done.
    seconds_left : float or None
        At the rate of this session so far; None before its first task is done.
    """

    done: int
    failed: int
    total: int
    seconds_left: float | None


OnProgress = Callable[[Progress], None]


@dataclass(frozen=True, slots=True)
class RunOutcome:
    """What one call of `run_tasks` did.

    Attributes
    ----------
    num_tasks : int
        Of the whole run.
    num_done_now : int
        In this call; the others were finished before.
    num_failed : int
        Of the whole run.
    first_error : str or None
        Of the first task that failed in this call.
    """

    num_tasks: int
    num_done_now: int
    num_failed: int
    first_error: str | None


def run_tasks(
    tasks: Sequence[T],
    work: Work[T, R],
    store: Store[T, R],
    executor: Executor,
    *,
    retry_failed: bool = False,
    on_progress: OnProgress = lambda _: None,
) -> RunOutcome:
    """Work on all tasks that the store does not have.

    Parameters
    ----------
    tasks
        Each with an id of its own.
    work
        What is done with each.
    store
        Of this run alone (see `lock.alone`).
    executor
        What has them worked on.
    retry_failed
        Whether tasks that failed earlier are worked on again.
    on_progress
        Called at the start and after each task.
    """
    if retry_failed:
        store.drop_failed()
    todo = [task for task in tasks if task.id not in store]
    before, begin, first_error = len(tasks) - len(todo), time.monotonic(), None
    failed = store.failed(task.id for task in tasks)
    on_progress(Progress(before, failed, len(tasks), None))
    with closing(executor.run(work, todo)) as finished_tasks:
        for number, finished in enumerate(finished_tasks, start=1):
            store.add(finished)
            if finished.failed:
                failed, first_error = failed + 1, first_error or finished.outcome.error
            seconds_left = (time.monotonic() - begin) / number * (len(todo) - number)
            on_progress(Progress(before + number, failed, len(tasks), seconds_left))
    return RunOutcome(len(tasks), len(todo), failed, first_error)
