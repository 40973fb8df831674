"""How far a decision is, on one line that works on a terminal and in a notebook alike."""

from __future__ import annotations

import sys
import time
from typing import TextIO

from topobelief.planning.search import Progress

_INTERVAL = 0.1  # seconds between updates; a notebook keeps each of them


def progress(stream: TextIO | None = None) -> Progress:
    """What to pass as `on_progress`: shows the stage and how many actions are done, and clears the line at the end of a stage.

    Parameters
    ----------
    stream
        Where to write. Default: standard error.

    Returns
    -------
    Progress
        Called as update(stage, done, total).

    Examples
    --------
    >>> update = progress(sys.stdout)
    >>> update("bounds", 20, 20)  # nothing to show: the stage is over
    """
    out, shown, last = stream or sys.stderr, 0, -_INTERVAL

    def update(stage: str, done: int, total: int) -> None:
        nonlocal shown, last
        now = time.monotonic()
        if done >= total:
            if shown:
                out.write(f"\r{' ' * shown}\r")
                out.flush()
            shown, last = 0, -_INTERVAL
        elif now - last >= _INTERVAL:
            line = f"{stage} {done}/{total}"
            out.write(f"\r{line.ljust(shown)}")
            out.flush()
            shown, last = max(shown, len(line)), now

    return update
