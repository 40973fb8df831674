"""A study as a run: its tasks are sessions, and its store is the Parquet dataset of its folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from topobelief.runs.attempt import Executor, Work
from topobelief.runs.lock import alone
from topobelief.runs.run import OnProgress, RunOutcome, run_tasks
from topobelief.study.dataset import Dataset
from topobelief.study.session import Row, play
from topobelief.study.tasks import Task


def run_study(
    tasks: Sequence[Task],
    folder: Path,
    executor: Executor,
    *,
    retry_failed: bool = False,
    on_progress: OnProgress = lambda _: None,
    play: Work[Task, Row] = play,
) -> RunOutcome:
    """Play all tasks that have no row in the folder.

    Parameters
    ----------
    tasks
        Of one specification (`tasks_of`).
    folder
        For the rows; made where it does not exist. Interrupted at any moment, it holds whole rows, and the same call
        continues.
    executor
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
        Where the folder cannot be written to, another process is using it, or it holds rows of a different study.
    """
    with alone(folder):
        dataset = Dataset(folder)
        dataset.clear_remains()
        dataset.require_no_other(tasks)
        return run_tasks(tasks, play, dataset, executor, retry_failed=retry_failed, on_progress=on_progress)
