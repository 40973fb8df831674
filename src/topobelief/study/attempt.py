"""One attempt at a task, whose outcome is plain data: what a task raises is its result, and stops nobody."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from traceback import extract_tb
from typing import Protocol

from topobelief.errors import TopobeliefError
from topobelief.study.session import Row
from topobelief.study.tasks import Task

MAX_ATTEMPTS = 3
"""How often in a row a task is begun whose worker dies."""

Play = Callable[[Task], Row]
"""Importable by its name wherever tasks are played."""


@dataclass(frozen=True, eq=False, slots=True)
class Outcome:
    """A row, or why there is none."""

    row: Row | None
    error: str | None = None
    worker_died: bool = False  # over it, or with it for another reason: who knows


@dataclass(frozen=True, eq=False, slots=True)
class Finished:
    """A task, what became of it, and how often it was begun."""

    task: Task
    outcome: Outcome
    attempts: int


class Workers(Protocol):
    """Whoever plays tasks: processes of this machine, or a cluster."""

    def run(self, play: Play, tasks: Sequence[Task]) -> Generator[Finished]:
        """Play all tasks and give each once, as they finish; closing it early abandons the rest."""
        ...


def with_second_chance(run: Callable[[Sequence[Task]], Generator[Finished]], tasks: Sequence[Task]) -> Generator[Finished]:
    """Run tasks, and once all else is done those again, one by one, over which workers died.

    So a task is blamed only for what it does when nothing else is running: not for its neighbours, nor for bad luck.
    """
    suspects: list[Finished] = []
    with closing(run(tasks)) as first_chance:
        for finished in first_chance:
            if finished.outcome.worker_died:
                suspects.append(finished)
            else:
                yield finished
    for suspect in suspects:
        with closing(run([suspect.task])) as second_chance:
            for finished in second_chance:
                yield replace(finished, attempts=suspect.attempts + finished.attempts)


def attempt(play: Play, task: Task) -> Outcome:
    """Play a task; what it raises is recorded."""
    try:
        return Outcome(play(task))
    except TopobeliefError as error:
        return Outcome(None, f"{type(error).__name__}: {_one_line(error)}")
    except Exception as error:
        frame = extract_tb(error.__traceback__)[-1]
        place = f"{Path(frame.filename).name}:{frame.lineno}"
        return Outcome(None, f"{type(error).__name__}: {_one_line(error)} ({place})")


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
