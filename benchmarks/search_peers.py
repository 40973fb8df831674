"""The search over a whole roadmap against what else there is, at the same limits: value, evaluations, seconds of CPU.

    python benchmarks/search_peers.py office
    python benchmarks/search_peers.py GRAPH.g2o --goal X Y

Peers: k diverse paths, shortest ways through one and through two via-vertices, greedy insertion by gain per metre. The graph
has a map beside it (the office) or is free where the robot has been.
"""

from __future__ import annotations

import argparse
import itertools
import time
from pathlib import Path

import numpy as np

import topobelief as tb
from topobelief.search.evaluations import Evaluations
from topobelief.search.walks import Walks

OFFICE = Path(__file__).parents[1] / "examples" / "office"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("graph", help='"office" or a file')
    parser.add_argument("--goal", nargs=2, type=float)
    parser.add_argument("--objective", default="map")
    parser.add_argument("--max-detour", type=float, default=1.3)
    parser.add_argument("--max-per-pose", type=int, default=1)
    parser.add_argument("--num-vertices", type=int, default=1000)
    parser.add_argument("--equal-noise", action="store_true", help="0.1 m and 0.035 rad for all edges")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--paths", nargs="*", type=int, default=[20, 200])
    parser.add_argument("--deadlines", nargs="*", type=float, default=[0.1, 1.0, 10.0])
    options = parser.parse_args()
    if options.graph == "office":
        graph, world = tb.read_g2o(OFFICE / "recorded.g2o"), tb.read_ros_map(OFFICE / "recorded.yaml")
        goal = options.goal or (25, -2.95)
    else:
        graph = tb.read_pose_graph(options.graph)
        world, goal = tb.World.from_trajectory(graph), options.goal
    if options.equal_noise:
        omega = np.diag([0.1**-2, 0.1**-2, 0.035**-2])
        graph = tb.PoseGraph(graph.poses, graph.edges, graph.measurements, omega)
    closures = tb.ClosureModel(max_per_pose=options.max_per_pose, probability=1.0)
    start = graph.poses[-1]
    roadmap = tb.build_roadmap(world, start, goal, options.num_vertices, seed=options.seed)
    limit = options.max_detour * roadmap.distances_to(1)[0]
    planner = tb.Planner(graph, objective=options.objective, engine="incremental")

    def predict(paths):
        return tb.predict_actions(graph, paths, closures=closures, turn=None, world=world)

    now = planner.entropies([tb.Action(np.zeros((0, 3)), np.zeros((0, 2)), np.eye(3))])[0]
    planner.entropies(predict([roadmap.vertices[roadmap.shortest_path()]] * 2))  # kernels are loaded
    print(f"{limit / options.max_detour:.1f} m to the goal, limit {limit:.1f} m, {len(roadmap.vertices)} vertices")
    print(f"{'':38s}{'gain':>10s}{'evaluations':>13s}{'CPU s':>8s}")

    def row(name, value, evaluations, seconds):
        print(f"{name:38s}{now - value:10.4g}{evaluations:13d}{seconds:8.2f}", flush=True)

    for count in options.paths:
        began = time.process_time()
        paths = tb.diverse_paths(roadmap, start, goal, count, options.max_detour)
        values = planner.entropies(predict(paths))
        row(f"best of {len(paths)} diverse paths", values.min(), len(paths), time.process_time() - began)
    for name, candidates in vias_through(roadmap, limit):
        began = time.process_time()
        evaluations = Evaluations(planner, predict, roadmap.vertices, 0.0)
        walks = Walks(roadmap, 1, limit)
        evaluations.evaluate([walks.walk(vias) for vias in candidates if walks.length(vias) <= walks.limit])
        row(name, evaluations.value(evaluations.best()), len(evaluations), time.process_time() - began)
    began = time.process_time()
    evaluations = greedy(Walks(roadmap, 1, limit), Evaluations(planner, predict, roadmap.vertices, 0.0))
    row(
        "greedy insertion by gain per metre",
        evaluations.value(evaluations.best()),
        len(evaluations),
        time.process_time() - began,
    )
    for deadline in options.deadlines:
        began = time.process_time()
        result = tb.search_roadmap(
            graph,
            roadmap,
            goal=goal,
            max_length=limit,
            objective=options.objective,
            closures=closures,
            world=world,
            deadline=deadline,
        )
        row(f"search_roadmap, {deadline:g} s", result.value, result.num_evaluations, time.process_time() - began)
        print(f"    no walk gains more than {now - result.lower_bound:.4g}; stopped by {result.stopped_by}")


def vias_through(roadmap, limit):
    """All walks through one via-vertex, and through two of thirty."""
    through = roadmap.distances_to(0) + roadmap.distances_to(1)
    reach = np.flatnonzero(through <= limit)
    yield "shortest ways through one via-vertex", [(via,) for via in reach.tolist()]
    some = reach[np.linspace(0, len(reach) - 1, 30).astype(int)].tolist()
    yield "shortest ways through two of thirty", list(itertools.permutations(some, 2))


def greedy(walks, evaluations):
    """Insert the via-vertex that gains most per metre, again and again."""
    reach = np.flatnonzero(walks.in_reach)[::4].tolist()
    vias = ()
    evaluations.evaluate([walks.walk(vias)])
    while True:
        base = walks.walk(vias)
        longer = [(*vias[:place], via, *vias[place:]) for place in range(len(vias) + 1) for via in reach if via not in vias]
        longer = [each for each in longer if walks.length(each) <= walks.limit]
        evaluations.evaluate([walks.walk(each) for each in longer])
        rates = {each: rate(evaluations, base, walks.walk(each)) for each in longer}
        best = max(rates, key=rates.get, default=None)
        if best is None or rates[best] <= 0:
            return evaluations
        vias = best


def rate(evaluations, base, walk):
    metres = max(evaluations.lengths[walk] - evaluations.lengths[base], 0.1)
    return (evaluations.value(base) - evaluations.value(walk)) / metres


if __name__ == "__main__":
    main()
