"""A study from start to end: what has a row is not played again, and every row is kept the moment it is there."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from topobelief.study.attempt import Finished, Play, Workers
from topobelief.study.dataset import Dataset, alone
from topobelief.study.rows import COLUMNS
from topobelief.study.session import Row, play
from topobelief.study.tasks import Task


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a study has come.

    Attributes
    ----------
    done, failed, total : int
        Tasks of the study, with those of earlier runs; the failed ones count as done.
    seconds_left : float or None
        At the rate of this run so far; None before its first task is done.
    """

    done: int
    failed: int
    total: int
    seconds_left: float | None


@dataclass(frozen=True, slots=True)
class StudyOutcome:
    """What a run did.

    Attributes
    ----------
    num_tasks : int
        Of the whole study.
    num_played : int
        In this run; the others had rows.
    num_failed : int
        Of the whole study.
    first_error : str or None
        What the first task that failed in this run raised.
    """

    num_tasks: int
    num_played: int
    num_failed: int
    first_error: str | None


def run_study(
    tasks: Sequence[Task],
    folder: Path,
    workers: Workers,
    *,
    retry_failed: bool = False,
    on_progress: Callable[[Progress], None] = lambda _: None,
    play: Play = play,
) -> StudyOutcome:
    """Play all tasks that have no row in the folder.

    Parameters
    ----------
    tasks
        Of one specification (`tasks_of`).
    folder
        For the rows; made where it does not exist. Interrupted at any moment, it holds whole rows, and the same call
        continues.
    workers
        `LocalWorkers` or `Cluster`.
    retry_failed
        Play again what failed in an earlier run.
    on_progress
        Called at the start and after each task.
    play
        What is done with a task; by default its session is played.

    Raises
    ------
    FileError
        Where the folder cannot be written to, another process is at it, or it holds rows of a different study.
    """
    with alone(folder):
        dataset = Dataset(folder)
        dataset.clear_remains()
        dataset.require_no_other(tasks)
        if retry_failed:
            dataset.drop_failed()
        todo = [task for task in tasks if task.id not in dataset]
        before, begin, first_error = len(tasks) - len(todo), time.monotonic(), None
        failed = dataset.failed(task.id for task in tasks)
        on_progress(Progress(before, failed, len(tasks), None))
        with closing(workers.run(play, todo)) as finished_tasks:
            for played, finished in enumerate(finished_tasks, start=1):
                dataset.add(_row(finished))
                if finished.outcome.row is None:
                    failed, first_error = failed + 1, first_error or finished.outcome.error
                seconds_left = (time.monotonic() - begin) / played * (len(todo) - played)
                on_progress(Progress(before + played, failed, len(tasks), seconds_left))
    return StudyOutcome(len(tasks), len(todo), failed, first_error)


def _row(finished: Finished) -> Row:
    """All columns, null where there is nothing to say."""
    task, outcome = finished.task, finished.outcome
    row = dict.fromkeys(COLUMNS) | {"task": task.id, **task.labels, **(outcome.row or {})}
    return row | {"status": "failed" if outcome.row is None else "ok", "error": outcome.error, "attempts": finished.attempts}
