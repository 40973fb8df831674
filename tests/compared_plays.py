"""Stand-ins for the drives of a comparison, which worker processes import by name."""

from __future__ import annotations

import math
import os
import signal
import time
from dataclasses import replace
from typing import Any

from topobelief.simulation.comparison import ComparedRun
from topobelief.simulation.strategy_comparison import SeedTask


def compared_run(seed: int, strategy: str, **changes: Any) -> ComparedRun:
    """A drive that arrived."""
    run = ComparedRun(
        seed=seed,
        strategy=strategy,
        outcome="arrived",
        chosen=1,
        num_candidates=2,
        planned=10.0,
        shortest=9.0,
        num_poses=30,
        num_shared=20,
        num_closures=4,
        predicted=0.1,
        error_shared=0.1 + 0.2,
        error_all=0.2,
        spread_shared=0.0,
        error_before=0.5,
    )
    return replace(run, **changes)


def quick(task: SeedTask) -> list[ComparedRun]:
    """A run for each strategy, which says who drove it."""
    return [
        compared_run(task.seed, strategy, num_closures=os.getpid(), predicted=math.nan, spread_shared=0.1)
        for strategy in task.comparison.strategies
    ]


def slow(task: SeedTask) -> list[ComparedRun]:
    """Long enough to be killed in."""
    time.sleep(0.3)
    return quick(task)


def deadly(task: SeedTask) -> list[ComparedRun]:
    """Seed 1 kills every process that drives it, seed 2 stops it."""
    if task.seed in (1, 2):
        os.kill(os.getpid(), signal.SIGKILL if task.seed == 1 else signal.SIGSTOP)
    return quick(task)
