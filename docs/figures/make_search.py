"""The figure of docs/search.md: the best way found in the office, and what each metre buys."""

from __future__ import annotations

from pathlib import Path

import topobelief as tb
from topobelief.report.canvas import save_figure
from topobelief.report.search_figure import draw_search

HERE = Path(__file__).parent
OFFICE = HERE.parents[1] / "examples" / "office"


def main() -> None:
    graph = tb.optimize(tb.read_g2o(OFFICE / "recorded.g2o"))
    world = tb.read_ros_map(OFFICE / "recorded.yaml")
    closures = tb.ClosureModel(max_per_pose=1, probability=1.0)
    roadmap = tb.build_roadmap(world, graph.poses[-1], (25, -2.95))
    found = tb.search_roadmap(graph, roadmap, goal=(25, -2.95), max_detour=1.6, closures=closures, world=world, deadline=60)
    print(found)
    save_figure(draw_search(graph, world, found), HERE / "search.png")


if __name__ == "__main__":
    main()
