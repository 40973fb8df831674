"""Stand-ins for the drives of a comparison, which worker processes import by name."""

from __future__ import annotations

import os
import signal
import time

from topobelief.simulation.comparison import ComparedRun
from topobelief.simulation.strategy_comparison import SeedTask


def quick(task: SeedTask) -> list[ComparedRun]:
    """A run for each strategy, which says who drove it."""
    return [
        ComparedRun(
            seed=task.seed,
            strategy=strategy,
            outcome="arrived",
            chosen=1,
            num_candidates=2,
            planned=10.0,
            shortest=9.0,
            num_poses=30,
            num_shared=20,
            num_closures=os.getpid(),
            predicted=float("nan"),
            error_shared=0.1 + 0.2,
            error_all=0.2,
            spread_shared=0.1,
            error_before=0.5,
        )
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
