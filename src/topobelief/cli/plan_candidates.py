"""The candidates of a plan: paths to each of its goals, and paths from files; what driving each would add to the graph.

A plan compares `Proposals`, wherever they come from: another source of candidates is another function that returns them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.homotopy import count_classes
from topobelief.candidates.polyline import checked_path, path_length
from topobelief.candidates.propose import CandidateRule, Routes, find_routes, predict_along
from topobelief.candidates.roadmap_graph import Roadmap
from topobelief.candidates.start import Start
from topobelief.cli.console import Reporter
from topobelief.cli.plan_ends import Goal, shown
from topobelief.cli.plan_world import told_of_poses_outside
from topobelief.errors import FileError
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.path_formats import read_filed_path
from topobelief.wording import counted
from topobelief.world import FreeSpace

_ARRIVED = 0.1  # metres; a path from a file that ends within this of a goal leads there


@dataclass(frozen=True, eq=False, slots=True)
class Proposals:
    """Candidates, shortest first.

    Attributes
    ----------
    paths
        K polylines, each of shape (waypoints, dim), metres.
    actions
        K, what driving each adds to the graph; labelled "path 0" and so on, with the goal where there are several and with
        the file where there is one.
    goals
        K, index of the goal of each among the plan's; None for a path from a file that leads elsewhere.
    """

    paths: list[FloatArray]
    actions: list[Action]
    goals: list[int | None]

    def shortest(self, index: int) -> int:
        """The shortest candidate with the same goal; of paths that lead elsewhere, the shortest of these."""
        return next(other for other, goal in enumerate(self.goals) if goal == self.goals[index])


@dataclass(frozen=True, eq=False, slots=True)
class _Way:
    """A path before it has its place among others."""

    path: FloatArray
    goal: int | None
    source: str  # file name, or empty


def find_proposals(
    graph: PoseGraph,
    world: FreeSpace,
    begin: Start,
    goals: Sequence[Goal],
    files: Sequence[Path],
    rule: CandidateRule,
    reporter: Reporter,
    *,
    cost_per_metre: float = 0.0,
    roadmap: Roadmap | None = None,
) -> Proposals:
    """Diverse paths from the start to each goal and the paths of files, with the measurements that each would add.

    Raises
    ------
    PlanningError
        Where there is no path; says also when poses are not in free space, which may be the cause.
    FileError
        Where a file is not what it should be, or its path leaves the free space of the world.
    """
    ways = [_from_file(world, begin, file, goals, rule.robot_radius) for file in files]
    with reporter.stage("paths"):
        for number, goal in enumerate(goals):
            ways += [_Way(path, number, "") for path in find_candidates(graph, world, begin, goal, rule, reporter, roadmap)]
    ways.sort(key=lambda way: path_length(way.path))
    with reporter.stage("measurements"):
        actions = predict_along(graph, world, [way.path for way in ways], rule, start=begin)
    labelled: list[Action] = []
    for index, (way, action) in enumerate(zip(ways, actions, strict=True)):
        label = f"path {index}"
        label += f" to {goals[way.goal].name}" if len(goals) > 1 and way.goal is not None else ""
        label += f", {way.source}" if way.source else ""
        labelled.append(replace(action, label=label, cost=cost_per_metre * (action.length or 0.0)))
    return Proposals([way.path for way in ways], labelled, [way.goal for way in ways])


def find_candidates(
    graph: PoseGraph,
    world: FreeSpace,
    begin: Start,
    goal: Goal,
    rule: CandidateRule,
    reporter: Reporter,
    roadmap: Roadmap | None = None,
) -> list[FloatArray]:
    """Diverse paths from the start to a goal."""
    with told_of_poses_outside(graph, world):
        routes = find_routes(world, begin, goal.place, rule, roadmap=roadmap)
    reporter.say(_described(routes, begin, goal, rule))
    return routes.paths


def _described(routes: Routes, begin: Start, goal: Goal, rule: CandidateRule) -> str:
    paths, lengths = routes.paths, routes.lengths
    if routes.roadmap.region is None:
        told = "kept apart by their distance"
    else:
        classes = count_classes(routes.roadmap, paths)
        told = ("" if classes.is_exact else "at least ") + counted(classes.number, "homotopy class", "homotopy classes")
    fewer = f" of {rule.num_paths} asked for" if len(paths) < rule.num_paths else ""
    return (
        f"{counted(len(paths), 'path')}{fewer} from {shown(begin.place)} to {goal.name}: "
        f"{told}, {lengths.min():.1f} to {lengths.max():.1f} m"
    )


def _from_file(world: FreeSpace, begin: Start, file: Path, goals: Sequence[Goal], robot_radius: float) -> _Way:
    """A path from a file, led to from the start; each of its legs must keep the robot from what is not free."""
    filed = read_filed_path(file)
    places = (filed.in_plane if world.dim == 2 else filed.in_space(file))[:, : world.dim]
    leads_in = bool((places[0] != begin.place).any())
    ends = np.vstack([begin.place, places]) if leads_in else places
    lines = [filed.lines[0], *filed.lines] if leads_in else filed.lines
    starts, stops = (ends[:-1], ends[1:]) if len(ends) > 1 else (ends, ends)
    blocked = ~world.segments_free(starts, stops, robot_radius)
    if leads_in and not world.segments_free(ends[:1], ends[:1], robot_radius)[0]:
        blocked[0] = False  # the robot stands where it should not be able to, so how it gets away cannot be judged
    if blocked.any():
        leg = int(np.flatnonzero(blocked)[0])
        a, b = starts[leg], stops[leg]
        way = "the straight way from the start to its first pose" if leads_in and leg == 0 else "one"
        raise FileError(
            file,
            f"expected a path that keeps more than the robot's radius of {robot_radius:g} m from all obstacles, got {way} "
            f"that does not between {shown(a)} and {shown(b)}, at {shown(_first_blocked(world, a, b, robot_radius))}; "
            "change the path or --robot-radius",
            line=lines[min(leg + 1, len(lines) - 1)],
        )
    goal = next((k for k, each in enumerate(goals) if np.linalg.norm(each.place - places[-1]) <= _ARRIVED), None)
    return _Way(checked_path(ends), goal, file.name)


def _first_blocked(world: FreeSpace, a: FloatArray, b: FloatArray, robot_radius: float) -> FloatArray:
    """About the first place of a segment where a disc has no room."""
    count = 2 + int(np.linalg.norm(b - a) / (0.1 * robot_radius))
    places = a + np.linspace(0, 1, min(count, 10_000))[:, None] * (b - a)
    tight = np.flatnonzero(world.clearance(places) <= robot_radius)
    return places[tight[0] if tight.size else -1]
