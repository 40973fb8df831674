"""How long a user waits for the first answers: start-up, exact entropy, bounds, and whole plans, in fresh processes.

Run as `make bench`. Each row is a new process, so imports and cold caches count where a user would wait for them; medians
over repetitions, beside the time that the project promises on two cores. City10000 comes from $TOPOBELIEF_DATA or from
shared/data beside the checkout; its rows are left out where it is absent.
"""

from __future__ import annotations

import os
import platform
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COMMAND = Path(sys.executable).with_name("topobelief")

TIME_CALL = """
import sys, time
import topobelief as tb
graph = tb.read_g2o(sys.argv[1])
call = {call}
start = time.perf_counter()
call(graph)
print(time.perf_counter() - start)
"""


def main() -> None:
    """Measure and print the table."""
    data = Path(os.environ.get("TOPOBELIEF_DATA", ROOT.parent / "shared" / "data"))
    city, office = data / "city10000.g2o", ROOT / "examples" / "office"
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    print(f"{'what':58} {'median':>9} {'slowest':>9} {'promised':>9} {'peak memory':>12}")
    row("topobelief --help", [str(COMMAND), "--help"], 0.5, repeat=7)
    row("import topobelief", [sys.executable, "-c", "import topobelief"], 0.3, repeat=7)
    with tempfile.TemporaryDirectory() as out:
        goal = ["--goal", "25", "-2.95", "--out", out]
        row(
            "topobelief plan, the office",
            plan(office / "office.g2o", "--map", str(office / "office.csv"), *goal),
            4.0,
            repeat=5,
        )
        if not city.exists():
            print(f"city10000.g2o is not in {data}: its rows are left out")
            return
        inner("joint_entropy of city10000 (the call alone)", "tb.joint_entropy", city, 0.3)
        inner("both Fischer bounds of city10000 (the call alone)", "tb.entropy_bounds", city, 0.2)
        goal = ["--goal", "0", "0", "--out", out]
        row("topobelief plan, city10000", plan(city, "--along-trajectory", *goal), 15.0, repeat=3)


def plan(graph: Path, *options: str) -> list[str]:
    """A planning command line."""
    return [str(COMMAND), "plan", str(graph), *options]


def row(name: str, command: list[str], promised: float, *, repeat: int) -> None:
    """Time a command as whole processes."""
    elapsed: list[float] = []
    for _ in range(repeat):
        start = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        elapsed.append(time.perf_counter() - start)
    report(name, elapsed, promised)


def inner(name: str, call: str, graph: Path, promised: float) -> None:
    """Time one call, the first in its process."""
    command = [sys.executable, "-c", TIME_CALL.format(call=call), str(graph)]
    report(name, [float(subprocess.check_output(command)) for _ in range(5)], promised)


def report(name: str, elapsed: list[float], promised: float) -> None:
    """Print a row; peak memory is that of the largest process so far."""
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6
    print(f"{name:58} {statistics.median(elapsed):7.2f} s {max(elapsed):7.2f} s {promised:7.1f} s {peak:9.2f} GB", flush=True)


if __name__ == "__main__":
    main()
