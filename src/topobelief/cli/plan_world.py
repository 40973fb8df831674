"""The world of a plan: a floor plan, or what lies along the trajectory, and whether the poses are in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from topobelief.cli.console import Reporter
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io import floor_plan
from topobelief.io.ros_map import Unknown
from topobelief.world import World
from topobelief.world.trajectory import default_width

_DOUBTFUL_SHARE = 0.1  # of the poses outside free space, above which map and graph may not belong together


def read_world(map_file: Path | None, graph: PoseGraph, reporter: Reporter, *, width: float | None, unknown: Unknown) -> World:
    """The floor plan, or what lies along the trajectory where there is none."""
    with reporter.stage("world"):
        if map_file is not None:
            world, source = floor_plan.read_world(map_file, unknown=unknown), str(map_file)
        else:
            width = default_width(graph) if width is None else width
            world, source = World.from_trajectory(graph, width), f"within {width:.2f} m of the trajectory"
    x_min, y_min, x_max, y_max = world.bounds
    reporter.say(f"world: {source}, {x_max - x_min:.1f} × {y_max - y_min:.1f} m")
    if message := poses_outside(graph, world):
        reporter.note(message)
    return world


def poses_outside(graph: PoseGraph, world: World) -> str | None:
    """How many poses are not in free space, and what that may mean; None where all are."""
    outside, total = int(np.count_nonzero(~world.contains(graph.positions))), graph.num_poses
    if not outside:
        return None
    question = ": another map or another frame?" if outside > _DOUBTFUL_SHARE * total else ""
    return f"{outside} of {total} poses {'is' if outside == 1 else 'are'} not in free space{question}"


def choose_start(
    graph: PoseGraph,
    world: World,
    reporter: Reporter,
    *,
    pose_id: str | None = None,
    place: tuple[float, float] | None = None,
) -> Start:
    """The pose with an id, a place, or the last pose; told, and whether the robot may be elsewhere.

    Raises
    ------
    InvalidInputError
        Where the graph has no pose of that id.
    PlanningError
        Where no pose is in sight of the place.
    """
    last = graph.num_poses - 1
    ids: list[int] = graph.ids.tolist()
    if place is not None:
        start = find_start(graph, place, world=world)
        nearest = f"{start.distance(graph):.2f} m from pose {node_name(ids[start.pose])}, the nearest in sight"
        reporter.say(f"from {_shown(start.place)}, {nearest}")
        return start
    if pose_id is not None:
        index = find_node(ids, pose_id)
        if index is None:
            known = f"from {node_name(min(ids))} to {node_name(max(ids))}"
            raise InvalidInputError(f"expected --start as the id of a pose of the file ({known}) or as X Y, got {pose_id}")
        start = find_start(graph, index)
        reporter.say(f"from pose {pose_id} at {_shown(start.place)}")
        return start
    start = find_start(graph, last)
    reporter.say(f"from pose {node_name(ids[last])}, the last of the file, at {_shown(start.place)}")
    end = graph.odometry_end
    if end is not None and end != last:
        reporter.note(
            f"the odometry from the first pose on ends at pose {node_name(ids[end])}, not at pose {node_name(ids[last])}; "
            f"if the robot stands there, pass --start {node_name(ids[end])}"
        )
    return start


def find_candidates(
    graph: PoseGraph, world: World, begin: Start, goal: Sequence[float], rule: CandidateRule, reporter: Reporter
) -> Candidates:
    """Diverse paths from the start to the goal, and the factors that each would add.

    Raises
    ------
    PlanningError
        Where there is no path; says also when poses are not in free space, which may be the cause.
    """
    try:
        with reporter.stage("paths"):
            routes = find_routes(world, begin, goal, rule)
    except PlanningError as error:
        if outside := poses_outside(graph, world):
            raise PlanningError(f"{error}; {outside}") from None
        raise
    paths, lengths = routes.paths, routes.lengths
    classes = count_classes(routes.roadmap, paths)
    at_least = "" if classes.is_exact else "at least "
    num_classes = at_least + _counted(classes.number, "homotopy class", "homotopy classes")
    fewer = f" of {rule.num_paths} asked for" if len(paths) < rule.num_paths else ""
    reporter.say(
        f"{_counted(len(paths), 'path')}{fewer} from {_shown(begin.place)} to {_shown(goal)}: "
        f"{num_classes}, {lengths.min():.1f} to {lengths.max():.1f} m"
    )
    with reporter.stage("factors"):
        return predict_candidates(graph, world, routes, rule, start=begin)
