"""Drive the office once and write what a SLAM front end would have made of it: examples/office/office.g2o.

A kinematic robot follows a tour through the office, keeps a key pose every metre, and measures odometry and loop closures
(anything within 2 m, in line of sight, at least five key poses apart) with Gaussian noise. The file holds dead reckoning, as
most public files do. Run as `python examples/office/make_graph.py`; the same seed writes the same file.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import topobelief as tb

HERE = Path(__file__).resolve().parent
START = (20.0, 0.0)  # of the first planning session of Kitanov and Indelman, arXiv 1903.00927
TOUR = [
    (13.5, -1.8),
    (13.5, 2.0),
    (22.0, 3.5),
    (21.0, -2.0),
    (13.5, 5.5),
    (26.0, 8.0),
]  # ends where their second session starts
SIGMA_POSITION = 0.1  # m
SIGMA_HEADING = 0.02  # rad
SPACING = 1.0  # m


def driven(world: tb.World, *, seed: int) -> tb.PoseGraph:
    """The tour as a pose graph at its true poses, with the measurements that the geometry predicts."""
    information = np.diag([SIGMA_POSITION**-2, SIGMA_POSITION**-2, SIGMA_HEADING**-2])
    graph = tb.PoseGraph([(*START, np.pi)], [], [], information)
    for goal in TOUR:
        roadmap = tb.build_roadmap(world, graph.poses[-1], goal, seed=seed)
        paths = tb.diverse_paths(roadmap, graph.poses[-1], goal, num_paths=1, seed=seed)
        (leg,) = tb.predict_actions(
            graph, paths, information=information, spacing=SPACING, turn=None, closures=tb.ClosureModel.by_hand(), world=world
        )
        graph = tb.posterior(graph, leg)
    return graph


def measured(graph: tb.PoseGraph, *, rng: np.random.Generator) -> tb.PoseGraph:
    """The same graph with noisy measurements, at dead-reckoned poses."""
    deviations = np.sqrt(1 / np.diagonal(graph.information, axis1=1, axis2=2))
    noise = graph.group.exp(deviations * rng.standard_normal(deviations.shape))
    measurements = graph.group.compose(graph.measurements, noise)
    odometry = {tuple(edge): index for index, edge in enumerate(graph.edges.tolist())}
    poses = [graph.poses[0]]
    for index in range(1, graph.num_poses):
        poses.append(graph.group.compose(poses[-1], measurements[odometry[index - 1, index]]))
    return tb.PoseGraph(poses, graph.edges, measurements, graph.information)


def main() -> None:
    """Write the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=HERE / "office.g2o")
    arguments = parser.parse_args()
    world = tb.read_world(HERE / "office.csv")
    graph = measured(driven(world, seed=arguments.seed), rng=np.random.default_rng(arguments.seed))
    tb.write_g2o(graph, arguments.out)
    print(f"{graph.num_poses} key poses, {graph.num_edges} measurements, {arguments.out}")


if __name__ == "__main__":
    main()
