"""Does a graph's history tell the closures to come? The last fifth of each drive is hidden and predicted from the rest.

    python benchmarks/closure_replay.py [GRAPH.g2o ...]

Prints the table of docs/closures.md. Without arguments: the graphs of $TOPOBELIEF_DATA, or of shared/data beside the checkout,
as far as they are there, and the recorded drive of examples/office. The model is learned without walls, as few of these have
a map.
"""

from __future__ import annotations

import math
import os
import sys
import time
from pathlib import Path

import numpy as np

import topobelief as tb
from topobelief.candidates.closure_rate import closure_rate
from topobelief.candidates.closure_replay import replay_closures

ROOT = Path(__file__).resolve().parents[1]
NAMES = ("intel", "csail", "manhattan3500", "city10000", "ais2klinik", "kitti_05")


def main() -> None:
    """Replay each graph and print the table."""
    data = Path(os.environ.get("TOPOBELIEF_DATA", ROOT.parent / "shared" / "data"))
    files = [Path(name) for name in sys.argv[1:]]
    if not files:
        files = [file for name in NAMES if (file := data / f"{name}.g2o").exists()]
        files.append(ROOT / "examples" / "office" / "recorded.g2o")
    print(
        "| graph | poses | closures a pose | k | p | radius, m | angle, rad | gap | predicted | made | ratio | learned in, ms |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    factors: list[float] = []
    for file in files:
        graph = tb.optimize(tb.read_g2o(file))
        begin = time.process_time()
        tb.learn_closures(graph)
        spent = time.process_time() - begin
        replay = replay_closures(graph)
        model = replay.model
        if replay.made and replay.predicted:
            factors.append(math.exp(abs(math.log(replay.ratio))))
        print(
            f"| {file.stem} | {graph.num_poses} | {closure_rate(graph):.2f} | {model.max_per_pose} | {model.probability:.3f} | "
            f"{model.radius:.2f} | {model.angle:.2f} | {model.min_index_gap} | {replay.predicted:.0f} | {replay.made} | "
            f"{replay.ratio:.2f} | {1000 * spent:.0f} |"
        )
    if factors:
        print(f"Off by a factor of {np.median(factors):.2f} in the median, {max(factors):.1f} at most.")


if __name__ == "__main__":
    main()
