"""Options that all commands have whose tasks are worked on by other processes."""

from __future__ import annotations

from typing import Annotated

import typer

from topobelief.runs.attempt import MAX_SECONDS

Timeout = Annotated[
    float,
    typer.Option(
        "--timeout",
        metavar="SECONDS",
        help="Longest time for one task, after which its process is ended; 0 for no limit.",
        min=0,
    ),
]
RetryFailed = Annotated[bool, typer.Option("--retry-failed", help="Run tasks again that failed in an earlier run.")]

DEFAULT_TIMEOUT = MAX_SECONDS
