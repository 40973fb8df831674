"""Let a simulated robot drive through the office and keep what it knew: recorded.g2o and its map, recorded.yaml and .pgm.

The tour is that of make_graph.py, but here wheels slip, a laser looks, scans are matched, and loops are closed by what was
seen. Needs the extra sim. Run as `python examples/office/record_drive.py`; the same seed on the same machine writes the same
files.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import topobelief as tb
from topobelief.simulation.episode import Episode
from topobelief.simulation.record import Record, RunOptions
from topobelief.simulation.scenario import Goal, Scenario

HERE = Path(__file__).resolve().parent
START = (20.0, 0.0, math.pi)
TOUR = [(13.5, -1.8), (13.5, 2.0), (22.0, 3.5), (21.0, -2.0), (13.5, 5.5), (26.0, 8.0)]


def driven(*, seed: int) -> Record:
    """The tour, by the shortest ways."""
    goals = tuple(Goal(place, num_paths=1) for place in TOUR)
    scenario = Scenario("office tour", tb.read_world(HERE / "office.csv"), START, goals)
    return Episode(scenario, RunOptions(strategy="shortest", seed=seed)).run()


def main() -> None:
    """Write the files."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=HERE)
    arguments = parser.parse_args()
    record = driven(seed=arguments.seed)
    tb.write_g2o(record.graph, arguments.out / "recorded.g2o")
    record.occupancy.write(arguments.out / "recorded.yaml")
    print(f"{record.graph.num_poses} key poses, {record.graph.num_edges} measurements, {record.outcome}; {arguments.out}")


if __name__ == "__main__":
    main()
