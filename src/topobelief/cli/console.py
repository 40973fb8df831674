"""Where a command speaks: its answer on stdout, progress on stderr while it lasts, and how long each stage took."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager

from rich.console import Console, RenderableType
from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, TaskID, TextColumn, TimeElapsedColumn

from topobelief.cli.run_progress import RunProgress

Update = Callable[[int, int], None]
"""Called with how much is done, and out of how much."""

_PIPE_WIDTH = 160  # columns where there is no terminal to ask


class Reporter:
    """Prints for a person, or, for a program, prints one JSON document and nothing else.

    Parameters
    ----------
    as_json
        Whether a program listens.
    shows_progress
        Whether stages show while they last, where a terminal can show them; a terminal shows one at a time.
    """

    def __init__(self, *, as_json: bool, shows_progress: bool = True) -> None:
        self.as_json, self._shows_progress = as_json, shows_progress
        self.seconds: dict[str, float] = {}
        self.notes: list[str] = []
        self._answer = Console(width=None if sys.stdout.isatty() else _PIPE_WIDTH, highlight=False)
        self._progress = Console(stderr=True)

    def say(self, *renderables: RenderableType) -> None:
        """Print for a person; text is taken as it is, not as markup."""
        if not self.as_json:
            for renderable in renderables:
                self._answer.print(renderable, markup=False, soft_wrap=isinstance(renderable, str))

    def warn(self, text: str) -> None:
        """Print a line on stderr, with or without --json."""
        print(f"topobelief: {text}", file=sys.stderr)

    def note(self, text: str) -> None:
        """Print what a person should know before relying on the answer, and keep it for the document of a program."""
        self.notes.append(text)
        self.say(text)

    def answer(self, document: Mapping[str, object]) -> None:
        """Print for a program."""
        if self.as_json:
            print(json.dumps(document, indent=2, allow_nan=False))

    @contextmanager
    def stage(self, name: str) -> Generator[Update]:
        """Time a stage and show it on stderr while it lasts, where that is a terminal."""
        with self._timed(name, BarColumn()) as (bar, task):
            yield lambda done, total: bar.update(task, completed=done, total=total, description=f"{name} {done}/{total}")

    @contextmanager
    def activity(self, name: str) -> Generator[Callable[[str], None]]:
        """As `stage`, for work whose parts have names in place of numbers."""
        with self._timed(name) as (bar, task):
            yield lambda part: bar.update(task, description=f"{name} {part}")

    @contextmanager
    def run(self, name: str, what: str) -> Generator[RunProgress]:
        """As `stage`, for a run of many tasks, which are called this."""
        begin = time.perf_counter()
        with RunProgress(what) as progress:
            yield progress
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - begin

    @contextmanager
    def _timed(self, name: str, *columns: ProgressColumn) -> Generator[tuple[Progress, TaskID]]:
        begin = time.perf_counter()
        shown = (SpinnerColumn(), TextColumn("{task.description}"), *columns, TimeElapsedColumn())
        with Progress(
            *shown, console=self._progress, transient=True, disable=not (self._shows_progress and self._progress.is_terminal)
        ) as bar:
            yield bar, bar.add_task(name, total=None)
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - begin

    def time_taken(self) -> str:
        """Seconds in all and by stage."""
        stages = ", ".join(f"{name} {seconds:.1f}" for name, seconds in self.seconds.items())
        return f"{sum(self.seconds.values()):.1f} s: {stages}"
