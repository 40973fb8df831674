"""How far a run is and how long it will take: a bar on a terminal, a line now and then in a log."""

from __future__ import annotations

import sys
import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar

from topobelief.runs.run import Progress

_SECONDS_BETWEEN_LINES = 30.0


class RunProgress:
    """Reports on stderr while a run lasts.

    Parameters
    ----------
    what
        The name of its tasks, in the plural.
    """

    def __init__(self, what: str) -> None:
        self._what = what
        console = Console(stderr=True)
        columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
        self._bar = Bar(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._task = self._bar.add_task(what, total=None)
        self._spoke = time.monotonic()

    def __enter__(self) -> RunProgress:
        self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._bar.stop()

    def update(self, progress: Progress) -> None:
        """Report progress."""
        text = description(progress, self._what)
        self._bar.update(self._task, completed=progress.done, total=progress.total, description=text)
        if self._bar.disable and time.monotonic() - self._spoke > _SECONDS_BETWEEN_LINES:
            self._spoke = time.monotonic()
            print(f"topobelief: {text}", file=sys.stderr)


def description(progress: Progress, what: str) -> str:
    """Such as "tasks 40/120, 2 failed, some 3 min left"."""
    failed = f", {progress.failed} failed" if progress.failed else ""
    left = f", {_duration(progress.seconds_left)} left" if progress.seconds_left else ""
    return f"{what} {progress.done}/{progress.total}{failed}{left}"


def _duration(seconds: float) -> str:
    """One unit is enough for an estimate."""
    if seconds < 90:
        return f"some {max(1, round(seconds))} s"
    if seconds < 90 * 60:
        return f"some {round(seconds / 60)} min"
    return f"some {seconds / 3600:.1f} h"
