"""Compile every kernel, of decisions and of searches, before it is needed: `python -m topobelief.search.compile_kernels`."""

from __future__ import annotations

import numpy as np

from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.roadmap import build_roadmap
from topobelief.graph.pose_graph import PoseGraph
from topobelief.optional import has_kernels
from topobelief.planning import compile_kernels as of_decisions
from topobelief.search.layers import Arcs
from topobelief.search.rewards import allowed_arcs
from topobelief.search.roadmap_search import search_roadmap
from topobelief.world import World


def compile_kernels() -> None:
    """Those of decisions, of one small search to a goal and one to anywhere, and of parts of walks."""
    of_decisions.compile_kernels()
    none = np.zeros(1, np.int32)
    allowed_arcs(Arcs(none, none, none, none, none, none, none), none, np.ones(1, dtype=bool))
    x_y = [(1.0 + x, 1.0, 0.0) for x in range(8)]
    graph = PoseGraph(x_y, [(i, i + 1) for i in range(7)], None, np.diag([400.0, 400.0, 1600.0]))
    world = World.from_boxes([(4, 3, 6, 4)], bounds=(0, 0, 10, 6))
    closures = ClosureModel(max_per_pose=1, probability=0.5)
    roadmap = build_roadmap(world, (8, 1), (8, 5), num_vertices=20, robot_radius=0.3)
    for goal in ((8, 5), None):
        for objective in ("error", "map"):
            search_roadmap(
                graph, roadmap, goal=goal, max_length=8, closures=closures, world=world, objective=objective, max_evaluations=60
            )


if __name__ == "__main__":
    if has_kernels():
        compile_kernels()
