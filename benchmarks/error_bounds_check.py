"""Do the bounds of the expected error enclose it? Random graphs after random actions, against dense matrices.

    python benchmarks/error_bounds_check.py --graphs 100000

Graphs of 2 to 11 poses and up to 9 closures, every second one in SE(3); one noise for all edges, one for each, or any positive
definite matrices; xi times the length of an edge from 0.001 to 100. Each gets an action of up to 5 new poses and 6 closures.
Checked are the matrix bounds and the exact value, both from scratch; by increments the bounds are the exact value. The
reference takes the inverse by a dense QR (`tests/references.py`). A graph for which the package says that double precision
does not suffice is counted as refused.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import graphs
import references
from topobelief.bounds.options import BoundOptions
from topobelief.bounds.squared_error import fischer
from topobelief.errors import IllConditionedError
from topobelief.forms.of_graph import GraphForms
from topobelief.graph.action import posterior
from topobelief.objectives.error import OBJECTIVE

RATIOS = (0.001, 0.1, 0.35, 1.0, 10.0, 100.0)
ROUNDING = 1e-7  # relative, of the reference


def main() -> None:
    """Print what was violated, and a table of how wide the bounds were."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--graphs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    counts, widths = Counter(), []
    for number in range(options.graphs):
        widths += check(np.random.default_rng([options.seed, number]), number, counts)
        if (number + 1) % 5000 == 0:
            print(number + 1, dict(counts), f"{time.process_time():.0f} s CPU", flush=True)
    print(f"{options.graphs} graphs:", *(f"{counts[name]} {name}" for name in ("violated", "wrong", "refused")), sep="\n  ")
    ratios, lower, upper = np.array(widths).T
    print("| ξ times the length of an edge | graphs | lower bound over E, median | upper bound over E, median |")
    print("|---|---|---|---|")
    for low, high in itertools.pairwise(RATIOS):
        some = (low <= ratios) & (ratios < high)
        print(f"| {low:g} … {high:g} | {some.sum()} | {np.median(lower[some]):.3f} | {np.median(upper[some]):.3f} |")


def check(rng, number, counts):
    """One graph: counts what is wrong; returns its ratio and its matrix bounds over E, or nothing where they are refused."""
    noise = graphs.Noise(
        group=(graphs.SE2_GROUP, graphs.SE3_GROUP)[number % 2],
        kind=graphs.NOISES[number // 2 % 3],
        position_weight=10.0 ** rng.uniform(-2, 4),
        ratio=10.0 ** rng.uniform(-3, 2),
        length=10.0 ** rng.uniform(-1, 2),
    )
    graph = graphs.random_pose_graph(rng, noise, int(rng.integers(2, 12)), int(rng.integers(0, 10)))
    action = graphs.random_action(rng, graph, noise, max_new=5, max_closures=6)
    after = posterior(graph, action)
    expected = references.error_reference(graph, after)
    forms = GraphForms(after, anchor=int(rng.integers(after.num_poses)), prior=graph)
    try:
        lower, upper = OBJECTIVE.bounds(fischer, BoundOptions(), forms)
        exact = OBJECTIVE.exact(forms)
    except IllConditionedError:
        counts["refused"] += 1
        return []
    low, high = lower.value - lower.error, upper.value + upper.error
    if low > expected * (1 + ROUNDING) or high < expected * (1 - ROUNDING):
        counts["violated"] += 1
        print("violated", number, low, expected, high, noise, flush=True)
    if abs(exact.value - expected) > exact.error + ROUNDING * expected:
        counts["wrong"] += 1
        print("wrong", number, exact, expected, noise, flush=True)
    return [(noise.ratio, lower.value / expected, upper.value / expected)]


if __name__ == "__main__":
    main()
