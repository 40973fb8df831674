"""Where a plan begins and where it leads: poses by their ids, or places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.start import Start, find_start
from topobelief.cli.console import Reporter
from topobelief.cli.plan_arguments import GivenPlace
from topobelief.errors import InvalidInputError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.symbols import find_node, node_name
from topobelief.world import FreeSpace


@dataclass(frozen=True, eq=False, slots=True)
class Goal:
    """A place to go to, and what to call it."""

    place: FloatArray  # shape (k,) of the graph, metres, world frame
    name: str


def choose_start(graph: PoseGraph, world: FreeSpace, reporter: Reporter, given: GivenPlace | None = None) -> Start:
    """The pose with an id, a place, or the last pose; told, and whether the robot may be elsewhere.

    Raises
    ------
    InvalidInputError
        Where the graph has no pose of that id.
    PlanningError
        Where no pose is in sight of the place.
    """
    ids: list[int] = graph.ids.tolist()
    if given is not None and given.place is not None:
        start = find_start(graph, _place(graph, given.place, "--start"), world=world)
        nearest = f"{start.distance(graph):.2f} m from pose {node_name(ids[start.pose])}, the nearest in sight"
        reporter.say(f"from {shown(start.place)}, {nearest}")
        return start
    if given is not None:
        start = find_start(graph, _index(graph, given, "--start"))
        reporter.say(f"from pose {given} at {shown(start.place)}")
        return start
    last = graph.last_pose
    start = find_start(graph, last)
    reporter.say(f"from pose {node_name(ids[last])}, the last of the file, at {shown(start.place)}")
    end = graph.odometry_end
    if end is not None and end != last:
        reporter.note(
            f"the odometry from the first pose on ends at pose {node_name(ids[end])}, not at pose {node_name(ids[last])}; "
            f"if the robot stands there, pass --start {node_name(ids[end])}"
        )
    return start


def choose_goals(graph: PoseGraph, given: Sequence[GivenPlace]) -> list[Goal]:
    """The places of poses with these ids, or the places themselves.

    Raises
    ------
    InvalidInputError
        Where the graph has no pose of an id, a place has too few or too many numbers, or two goals are one place.
    """
    goals: list[Goal] = []
    for each in given:
        if each.place is None:
            goals.append(Goal(graph.positions[_index(graph, each, "--goal")], f"pose {each}"))
        else:
            goals.append(Goal(_place(graph, each.place, "--goal"), shown(each.place)))
        for earlier in goals[:-1]:
            if (earlier.place == goals[-1].place).all():
                raise InvalidInputError(
                    f"expected different goals, got {earlier.name} and {goals[-1].name}, which are one place"
                )
    return goals


def _place(graph: PoseGraph, place: tuple[float, ...], option: str) -> FloatArray:
    if len(place) != graph.group.position_dim:
        axes = "X Y Z" if graph.group.position_dim == 3 else "X Y"
        raise InvalidInputError(
            f"expected {option} as {axes} for a graph in {graph.group.name}, got {len(place)} numbers; or name a pose by its id"
        )
    return np.array(place)


def _index(graph: PoseGraph, given: GivenPlace, option: str) -> int:
    ids: list[int] = graph.ids.tolist()
    index = find_node(ids, str(given.pose_id))
    if index is None:
        known = f"from {node_name(min(ids))} to {node_name(max(ids))}"
        raise InvalidInputError(f"expected {option} as the id of a pose of the file ({known}) or as X Y, got {given.pose_id}")
    return index


def shown(place: Sequence[float] | FloatArray) -> str:
    """A place for a person."""
    return f"({', '.join(f'{coordinate:.2f}' for coordinate in place)})"
