"""One attempt at a task, whose outcome is plain data: an error that the work raises is recorded, and ends nothing else."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from traceback import extract_tb
from typing import Generic, Protocol, TypeVar

from topobelief.errors import InvalidInputError, TopobeliefError

MAX_ATTEMPTS = 3
"""How often in a row a task is begun whose worker dies."""

MAX_SECONDS = 3600.0
"""How long a worker may take for one task, where nothing else is said."""


class Task(Protocol):
    """Complete in itself, so that it can be sent to another process."""

    @property
    def id(self) -> str:
        """The same for the same task in every run, and different for different tasks."""
        ...


T = TypeVar("T", bound=Task)
R = TypeVar("R")

Work = Callable[[T], R]
"""What is done with a task; importable by its name wherever that happens."""


@dataclass(frozen=True, eq=False, slots=True)
class Outcome(Generic[R]):
    """What the work returned, or why it returned nothing.

    Attributes
    ----------
    result : R or None
    error : str or None
        One line; None where there is a result.
    seconds : float
        Spent on the work.
    worker_lost : bool
        Whether the worker died or had to be ended. Whether the task was the reason is not known.
    """

    result: R | None
    error: str | None = None
    seconds: float = 0.0
    worker_lost: bool = False


@dataclass(frozen=True, eq=False, slots=True)
class Finished(Generic[T, R]):
    """A task, its outcome, and how often it was begun."""

    task: T
    outcome: Outcome[R]
    attempts: int

    @property
    def failed(self) -> bool:
        """Whether there is no result."""
        return self.outcome.error is not None


class Executor(Protocol):
    """What has tasks worked on: this process, other processes of this machine, or a cluster."""

    def run(self, work: Work[T, R], tasks: Sequence[T]) -> Generator[Finished[T, R]]:
        """Work on all tasks and give each once, as they finish; closing it early abandons the rest."""
        ...


def with_second_chance(
    run: Callable[[Sequence[T]], Generator[Finished[T, R]]], tasks: Sequence[T]
) -> Generator[Finished[T, R]]:
    """Run tasks, and once all else is done run those again, one by one, that lost their workers.

    So a task is recorded as failed only for what it does when nothing else is running, and not for what its neighbours did.
    """
    suspects: list[Finished[T, R]] = []
    with closing(run(tasks)) as first_chance:
        for finished in first_chance:
            if finished.outcome.worker_lost:
                suspects.append(finished)
            else:
                yield finished
    for suspect in suspects:
        with closing(run([suspect.task])) as second_chance:
            for finished in second_chance:
                yield replace(finished, attempts=suspect.attempts + finished.attempts)


def attempt(work: Work[T, R], task: T) -> Outcome[R]:
    """Work on a task; an error that this raises is recorded."""
    begin = time.perf_counter()
    try:
        return Outcome(work(task), seconds=time.perf_counter() - begin)
    except TopobeliefError as error:
        return Outcome(None, f"{type(error).__name__}: {_one_line(error)}", time.perf_counter() - begin)
    except Exception as error:  # whatever a task does, the run goes on and its row says what went wrong
        frame = extract_tb(error.__traceback__)[-1]
        place = f"{Path(frame.filename).name}:{frame.lineno}"
        return Outcome(None, f"{type(error).__name__}: {_one_line(error)} ({place})", time.perf_counter() - begin)


def checked_seconds(max_seconds: float | None) -> float | None:
    """A limit for the time of one task; None for no limit.

    Raises
    ------
    InvalidInputError
        For a limit that is not above 0.
    """
    if max_seconds is not None and not max_seconds > 0:
        raise InvalidInputError(f"expected a time limit above 0 s for a task, got {max_seconds:g}")
    return max_seconds


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
