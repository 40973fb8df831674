"""Does the way found depend on the roadmap's random places? One search a seed, of roadmap and search, and what they agree on.

    python benchmarks/roadmap_seeds.py office
    python benchmarks/roadmap_seeds.py GRAPH.g2o --map MAP.yaml --goal X Y
    python benchmarks/roadmap_seeds.py GRAPH.g2o --goal X Y                    # free where the robot has been

Prints the table of docs/search.md. The searches are those of `topobelief plan`, with a limit of evaluations in place of its two
seconds, so that runs are repeatable. Two ways are the same where their discrete Fréchet distance, every 0.1 m, is at most 2 m.
"same way" is how many of the ways are the same as the one that most are the same as. The spread is between the least and the
greatest value of all.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from scipy.spatial.distance import cdist

import topobelief as tb

OFFICE = Path(__file__).parents[1] / "examples" / "office"
SAME_WAY = 2.0  # metres
STEP = 0.1  # metres between the places at which ways are compared
NO_TURN = 100.0  # radians: no pose stands at a corner, as by default, and no bound takes its time
HEAD = "| graph | goal | objective | least value | spread | lengths | same way | CPU s a seed |"


def main() -> None:
    """Print a row an objective."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("graph", help='"office" or a file')
    parser.add_argument("--map", type=Path)
    parser.add_argument("--goal", nargs=2, type=float, default=(25, -2.95))
    parser.add_argument("--objectives", nargs="*", default=["error", "map"])
    parser.add_argument("--max-detour", type=float, default=1.3)
    parser.add_argument("--max-evaluations", type=int, default=1000)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--unrefined", action="store_true", help="ways through vertices of the roadmap alone")
    parser.add_argument("--verbose", action="store_true", help="a line a seed as it is done, and how far apart ways are")
    options = parser.parse_args()
    graph = tb.optimize(tb.read_g2o(OFFICE / "recorded.g2o" if options.graph == "office" else options.graph))
    file = OFFICE / "recorded.yaml" if options.graph == "office" else options.map
    world = tb.World.from_trajectory(graph) if file is None else tb.read_ros_map(file)
    print(HEAD)
    print("|" + "---|" * HEAD.count(" |"))
    for objective in options.objectives:
        print(row(graph, world, objective, options), flush=True)


def row(graph, world, objective, options):
    """Ten seeds, and what they agree on."""
    began, found = time.process_time(), []
    for seed in range(options.seeds):
        roadmap = tb.build_roadmap(world, graph.poses[-1], options.goal, seed=seed)
        found.append(
            tb.search_roadmap(
                graph,
                roadmap,
                goal=options.goal,
                max_detour=options.max_detour,
                objective=objective,
                world=world,
                max_evaluations=options.max_evaluations,
                refine=not options.unrefined,
                seed=seed,
                turn=NO_TURN,
            )
        )
        if options.verbose:
            print(seed, *(f"{found[-1]}".splitlines()[:2]), f"{found[-1].value:.6g}", sep="; ", flush=True)
    seconds = (time.process_time() - began) / options.seeds
    ways = [places(each.best.path) for each in found]
    apart = np.array([[frechet(one, other) for other in ways] for one in ways])
    same = apart <= SAME_WAY
    values, lengths = np.array([each.value for each in found]), [each.length for each in found]
    if options.verbose:
        print("metres apart:", np.round(apart, 1).tolist())
    least = f"{100 * values.min():.4g} cm" if objective == "error" else f"{values.min():.1f} nats"
    spread = f"{100 * np.ptp(values) / values.min():.1f} %" if objective == "error" else f"{np.ptp(values):.2f} nats"
    goal = "({:g}, {:g})".format(*options.goal)
    return (
        f"| {Path(options.graph).stem} | {goal} | `{objective}` | {least} | {spread} "
        f"| {min(lengths):.1f} … {max(lengths):.1f} m | {same.sum(axis=1).max()} of {len(found)} "
        f"| {seconds:.1f} |"
    )


def places(path):
    """Places every `STEP` along a path, its end among them."""
    so_far = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = np.linspace(0, so_far[-1], int(np.ceil(so_far[-1] / STEP)) + 1)
    return np.column_stack([np.interp(at, so_far, axis) for axis in path.T])


def frechet(one, other):
    """Discrete Fréchet distance of two sequences of places (Eiter and Mannila, 1994)."""
    apart = cdist(one, other)
    reach = np.maximum.accumulate(apart[0])
    for row in apart[1:]:
        before, current = np.minimum(reach, np.r_[np.inf, reach[:-1]]), np.inf
        for index, (distance, best) in enumerate(zip(row.tolist(), before.tolist(), strict=True)):
            current = max(distance, min(current, best))
            reach[index] = current
    return float(reach[-1])


if __name__ == "__main__":
    main()
