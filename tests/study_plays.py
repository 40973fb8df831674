"""Stand-ins for a session, which worker processes import by name; what each does follows from the task's seed."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from topobelief.errors import PlanningError
from topobelief.study.session import Row
from topobelief.study.tasks import Task


def quick(task: Task) -> Row:
    """A number that only the task can know."""
    return {"value": float(task.rng.random()), "num_poses": task.seed, "decision_seconds": time.perf_counter()}


def slow(task: Task) -> Row:
    """Long enough to be killed in."""
    time.sleep(0.1)
    return quick(task)


def failing(task: Task) -> Row:
    """Seed 1 finds no path, seed 2 meets a bug."""
    if task.seed == 1:
        raise PlanningError("expected a goal,\n got a wall")
    if task.seed == 2:
        return {"value": 1 / 0}
    return quick(task)


def deadly(task: Task) -> Row:
    """Seed 1 kills its process whenever it is played; seed 2 only the first time."""
    marker = Path(os.environ["STUDY_PLAYS_FOLDER"], task.id)
    if task.seed == 1 or (task.seed == 2 and not marker.exists()):
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return quick(task)


def mute(task: Task) -> Row:
    """Ends the process without a signal, with words on stderr."""
    os.write(2, b"out of luck\n")
    os._exit(3)


def hanging(task: Task) -> Row:
    """Seed 1 takes for ever."""
    if task.seed == 1:
        time.sleep(1000)
    return quick(task)
