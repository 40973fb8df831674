"""Whether a robot can stand at a goal, how much room it has there, and where the nearest free place is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from topobelief.cli.graph_facts import Fact
from topobelief.cli.plan_ends import Goal, shown
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world import FreeSpace
from topobelief.world.free_places import nearest_free_place
from topobelief.world.space import seen_by


def describe_goals(graph: PoseGraph, world: FreeSpace, goals: Sequence[Goal], robot_radius: float) -> Iterator[Fact]:
    """A line for each goal; nearest free places are such that the robot can drive there from the last pose."""
    found: list[dict[str, object]] = []
    for goal in goals:
        goal_place = seen_by(world, goal.place)
        clearance = float(world.clearance(goal_place[None])[0])
        free = clearance > robot_radius
        where = "in an obstacle, unknown or off the map" if clearance <= 0 else f"{clearance:.2f} m from the nearest obstacle"
        text, place = f"free, {where}", goal_place
        if not free:
            place = nearest_free_place(world, goal_place, robot_radius, reachable_from=seen_by(world, graph.positions[-1]))
            numbers = "" if place is None else " ".join(f"{coordinate:g}" for coordinate in place.tolist())
            nearest = f"the nearest free place is {numbers}" if numbers else "there is no free place"
            text = f"not free for a robot of radius {robot_radius:g} m, {where}; {nearest}"
        nearest_free = None if place is None else place.tolist()
        found.append({"place": goal_place.tolist(), "free": free, "clearance": clearance, "nearest_free": nearest_free})
        yield Fact("", None, goal.name if goal.name != shown(goal.place) else f"goal {goal.name}", text)
    yield Fact("goals", found, "", "")
