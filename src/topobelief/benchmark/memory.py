"""Peak memory of a decision, in a process that does nothing else: `python -m topobelief.benchmark.memory`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from topobelief.benchmark.sessions import candidate_paths, city_drive
from topobelief.errors import InvalidInputError, require_choice
from topobelief.estimation import optimize
from topobelief.graph.information import block_isotropic
from topobelief.io.formats import read_pose_graph
from topobelief.planning.planner import Planner

Work = Literal["nothing", "bounds", "exact", "error"]


def peak_gigabytes(source: int | Path, num_actions: int, work: Work, *, seed: int) -> float:
    """Largest resident size of a new process that makes a session and decides it, 1e9 bytes.

    Parameters
    ----------
    source
        Poses of a generated graph, or a file, which is read and optimised.
    num_actions
    work
        "bounds": ranking with Fischer bounds. "exact": the joint entropy of all. "error": the expected
        error of all. "nothing": the session alone.
    seed

    Raises
    ------
    InvalidInputError
        Where the platform does not tell a process its peak memory.
    """
    module, kind = "topobelief.benchmark.memory", "file" if isinstance(source, Path) else "generated"
    command = [sys.executable, "-m", module, kind, str(source), str(num_actions), work, str(seed)]
    found = subprocess.run(command, check=False, capture_output=True, text=True)
    if found.returncode:
        raise InvalidInputError(f"expected a measurement of memory, got: {found.stderr.strip().splitlines()[-1:]}")
    return float(found.stdout)


def main(arguments: list[str]) -> None:
    """Print the peak resident size of this process after the work that the arguments name."""
    kind, source, work = arguments[0], arguments[1], arguments[3]
    num_actions, rng = int(arguments[2]), np.random.default_rng(int(arguments[4]))
    require_choice("work", work, get_args(Work))
    if kind == "file":
        graph = optimize(read_pose_graph(source))
    else:
        graph = city_drive(int(source), block_isotropic(0.1, 0.035), rng=rng)
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
