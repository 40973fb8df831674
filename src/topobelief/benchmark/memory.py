"""Peak memory of a decision, in a process that does nothing else: `python -m topobelief.benchmark.memory`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from topobelief.benchmark.sessions import candidate_paths, city_drive
from topobelief.errors import InvalidInputError, require_choice
from topobelief.graph.information import block_isotropic
from topobelief.planning.planner import Planner

Work = Literal["nothing", "bounds", "exact", "error"]


def peak_gigabytes(num_poses: int, num_actions: int, work: Work, *, seed: int) -> float:
    """Largest resident size of a new process that generates a session and decides it, 1e9 bytes.

    Parameters
    ----------
    num_poses, num_actions
    work
        "bounds": ranking with Fischer bounds. "exact": the joint entropy of all. "error": the expected
        error of all. "nothing": the session alone.
    seed

    Raises
    ------
    InvalidInputError
        Where the platform does not tell a process its peak memory.
    """
    module = "topobelief.benchmark.memory"
    command = [sys.executable, "-m", module, str(num_poses), str(num_actions), work, str(seed)]
    found = subprocess.run(command, check=False, capture_output=True, text=True)
    if found.returncode:
        raise InvalidInputError(f"expected a measurement of memory, got: {found.stderr.strip().splitlines()[-1:]}")
    return float(found.stdout)


def main(arguments: list[str]) -> None:
    """Print the peak resident size of this process after the work that the arguments name."""
    num_poses, num_actions, work, seed = int(arguments[0]), int(arguments[1]), arguments[2], int(arguments[3])
    require_choice("work", work, get_args(Work))
    rng = np.random.default_rng(seed)
    graph = city_drive(num_poses, block_isotropic(0.1, 0.035), rng=rng)
    actions = candidate_paths(graph, num_actions, rng=rng)
    if work == "bounds":
        Planner(graph).decide(actions)
    elif work == "exact":
        Planner(graph).entropies(actions)
    elif work == "error":
        Planner(graph, objective="error", signature="resistance", engine="incremental").entropies(actions)
    print(_peak_bytes() / 1e9)


def _peak_bytes() -> int:
    status = Path("/proc/self/status")
    if status.exists():  # what getrusage tells on Linux includes the process that started this one
        lines = status.read_text(encoding="ascii").splitlines()
        return 1024 * int(next(line for line in lines if line.startswith("VmHWM")).split()[1])
    import resource  # not on every platform

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


if __name__ == "__main__":
    main(sys.argv[1:])
