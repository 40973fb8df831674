"""The world of a plan: a floor plan, or what lies along the trajectory, and whether the poses are in it."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from topobelief.cli.console import Reporter
from topobelief.errors import PlanningError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io import floor_plan
from topobelief.io.ros_map import Unknown
from topobelief.world import World
from topobelief.world.trajectory import default_width

_DOUBTFUL_SHARE = 0.1  # of the poses outside free space, above which map and graph may not belong together


def read_world(
    map_file: Path | None,
    graph: PoseGraph,
    reporter: Reporter,
    *,
    width: float | None = None,
    unknown: Unknown = "occupied",
    topic: str | None = None,
) -> World:
    """The floor plan, or what lies along the trajectory where there is none."""
    with reporter.stage("world"):
        if map_file is not None:
            world, source = floor_plan.read_world(map_file, unknown=unknown, topic=topic), str(map_file)
        else:
            width = default_width(graph) if width is None else width
            world, source = World.from_trajectory(graph, width), f"within {width:.2f} m of the trajectory"
    x_min, y_min, x_max, y_max = world.bounds
    reporter.say(f"world: {source}, {x_max - x_min:.1f} × {y_max - y_min:.1f} m")
    if message := poses_outside(graph, world):
        reporter.note(message)
    return world


@contextmanager
def told_of_poses_outside(graph: PoseGraph, world: World) -> Generator[None]:
    """Where there is no way, add that poses are not in free space, which may be the cause."""
    try:
        yield
    except PlanningError as error:
        if outside := poses_outside(graph, world):
            raise PlanningError(f"{error}; {outside}") from None
        raise


def poses_outside(graph: PoseGraph, world: World) -> str | None:
    """How many poses are not in free space, and what that may mean; None where all are."""
    outside, total = int(np.count_nonzero(~world.contains(graph.positions[graph.pose_indices]))), graph.num_poses
    if not outside:
        return None
    question = ": another map or another frame?" if outside > _DOUBTFUL_SHARE * total else ""
    return f"{outside} of {total} poses {'is' if outside == 1 else 'are'} not in free space{question}"
