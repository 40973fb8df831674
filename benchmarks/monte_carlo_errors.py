"""Is the expected error what comes out? Measurements are drawn, graphs optimised by GTSAM, and their errors compared.

    python benchmarks/monte_carlo_errors.py [GRAPH.g2o ...] [--draws 300] [--scales 0.5,1,2,4]

Prints the table of docs/mathematics.md, section 12. The estimate of a graph is taken for the truth. Each edge is given the
graph's typical noise (`default_information`, and `closure_information` for loop closures) times a scale, its measurement is
drawn around the truth, and GTSAM's Levenberg-Marquardt starts from the truth. What is compared with `expected_errors` is the
root mean square over all draws: of positions after the best rigid alignment, and of the last pose seen from the first. The
rows "after a path" add 30 new poses with some closures and count the error of the poses that existed before.

Without files: the recorded drive of examples/office, and those of intel, csail and manhattan3500 that are in $TOPOBELIEF_DATA
or in shared/data beside the checkout. Graphs in SE(2) only.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from pathlib import Path

import gtsam
import numpy as np

import topobelief as tb
from topobelief.benchmark.sessions import candidate_paths
from topobelief.candidates.learned_closures import History
from topobelief.candidates.predicted_factors import closure_information, default_information
from topobelief.conversions.gtsam import to_gtsam

ROOT = Path(__file__).resolve().parents[1]
NAMES = ("intel", "csail", "manhattan3500")


def main() -> None:
    """Print one row a graph, belief and scale of noise."""
    parser = argparse.ArgumentParser()
    parser.add_argument("graphs", nargs="*", type=Path)
    parser.add_argument("--draws", type=int, default=300)
    parser.add_argument("--scales", default="0.5,1,2,4")
    given = parser.parse_args()
    data = Path(os.environ.get("TOPOBELIEF_DATA", ROOT.parent / "shared" / "data"))
    files = given.graphs or [ROOT / "examples" / "office" / "recorded.g2o"]
    if not given.graphs:
        files += [file for name in NAMES if (file := data / f"{name}.g2o").exists()]
    print("| graph | noise | sigma of a heading, rad | belief | E expected, m | E drawn, m | off by | goal off by | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|")
    for file in files:
        truth = typical_noise(tb.optimize(tb.read_g2o(file)))
        for scale in map(float, given.scales.split(",")):
            noisy = tb.PoseGraph(truth.poses, truth.edges, None, truth.information / scale**2)
            action = candidate_paths(noisy, 1, num_new_poses=30, num_closures=6, rng=np.random.default_rng(0))[0]
            for belief, after, chosen in (("now", noisy, None), ("after a path", tb.posterior(noisy, action), action)):
                start = time.process_time()
                expected = tb.expected_errors(noisy, chosen, sample_size=noisy.num_poses)
                squares, goals = drawn_errors(after, noisy.num_poses, given.draws)
                mean = float(np.mean(squares))
                spread = float(np.std(squares)) / math.sqrt(given.draws) / (2 * mean)
                print(
                    f"| {file.stem} | x {scale:g} | {math.sqrt(np.median(np.linalg.inv(noisy.information)[:, 2, 2])):.3g} "
                    f"| {belief} | {expected.map_rmse:.4g} | {math.sqrt(mean):.4g} "
                    f"| {percent(math.sqrt(mean) / expected.map_rmse)} ± {100 * spread:.1f} "
                    f"| {percent(math.sqrt(float(np.mean(goals))) / expected.goal_std)} | {time.process_time() - start:.0f} |",
                    flush=True,
                )


def typical_noise(graph: tb.PoseGraph) -> tb.PoseGraph:
    """The graph with its own typical noise, of odometry and of closures, measured as its poses say."""
    information = np.tile(default_information(graph), (graph.num_edges, 1, 1))
    information[History.of(graph).edges] = closure_information(graph)
    return tb.PoseGraph(graph.poses, graph.edges, None, information)


def drawn_errors(graph: tb.PoseGraph, num_existing: int, num_draws: int) -> tuple[list[float], list[float]]:
    """Mean squared error of the existing positions, and squared error of the last pose from the first, of each draw."""
    rng, group = np.random.default_rng(0), graph.group
    roots = np.linalg.cholesky(np.linalg.inv(graph.information))
    _, truth = to_gtsam(graph)
    goal = group.position(group.between(graph.poses[:1], graph.poses[-1:]))[0]
    squares, goals = list[float](), list[float]()
    for _ in range(num_draws):
        noise = np.einsum("mab,mb->ma", roots, rng.normal(size=(graph.num_edges, graph.tangent_dim)))
        measured = group.compose(graph.measurements, group.exp(noise))
        factors, _ = to_gtsam(tb.PoseGraph(graph.poses, graph.edges, measured, graph.information))
        factors.add(gtsam.NonlinearEqualityPose2(0, truth.atPose2(0)))
        found = gtsam.LevenbergMarquardtOptimizer(factors, truth).optimize()
        poses = gtsam.utilities.extractPose2(found)
        squares.append(
            float(np.mean(np.sum(aligned_difference(poses[:num_existing, :2], graph.positions[:num_existing]) ** 2, 1)))
        )
        goals.append(float(np.sum((group.position(group.between(poses[:1], poses[-1:]))[0] - goal) ** 2)))
    return squares, goals


def aligned_difference(positions: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """After the best rotation and translation."""
    p, q = positions - positions.mean(axis=0), reference - reference.mean(axis=0)
    left, _, right = np.linalg.svd(p.T @ q)
    turn = left @ np.diag([1.0, np.sign(np.linalg.det(left @ right))]) @ right
    return p @ turn - q


def percent(ratio: float) -> str:
    """The deviation from 1."""
    return f"{100 * (ratio - 1):+.1f} %"


if __name__ == "__main__":
    main()
