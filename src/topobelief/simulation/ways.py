"""Ways to a goal in the world as the robot knows it, and obstacles on one of them that its laser sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.polyline import path_length, stations
from topobelief.candidates.propose import CandidateRule, Candidates, propose
from topobelief.errors import PlanningError
from topobelief.geometry.segments import distances_to_segments
from topobelief.graph.pose_graph import PoseGraph
from topobelief.simulation.scenario import Goal
from topobelief.world import World

_NEAR = np.arange(0.05, 1.0, 0.05)  # m, in which a robot that stands too close to a wall looks for room
_DIRECTIONS = np.linspace(-np.pi, np.pi, 24, endpoint=False)
_ROOM = 1.05  # times its radius
_TIGHT = 0.95  # of a goal's clearance, where that is less
_STRAY = 0.07  # m that a robot leaves its path by at most, as was seen in bends


def known_candidates(
    belief: PoseGraph, world: World, goal: Goal, rule: CandidateRule, *, chassis: float, position_error: float
) -> Candidates:
    """Diverse paths to a goal from where the robot believes to be, its last pose, and the factors that each would add.

    Paths begin where the robot stands or, where that is too close to a wall (its estimate or its map may err), at the next
    place with room. They keep as far from walls as the rule asks for, and at least so far that a robot that strays from its
    path and errs in its position does not touch. Where the goal has less room than that, they keep what fits, but never less
    than the chassis and the error of the position take.

    Parameters
    ----------
    belief
    world
        As the robot knows it.
    goal
        It says how many paths.
    rule
    chassis
        Its radius, metres.
    position_error
        What its position may be off by, metres.

    Raises
    ------
    PlanningError
        Where there is no way.
    """
    least = chassis + position_error
    wanted = room_wanted(rule, chassis=chassis, position_error=position_error)
    radius = max(least, min(wanted, _TIGHT * float(world.clearance([goal.place])[0])))
    start = place_with_room(world, belief.positions[-1], radius)
    try:
        return propose(belief, world, start, goal.place, replace(rule, num_paths=goal.num_paths, robot_radius=radius))
    except PlanningError as error:
        raise PlanningError(
            f"{error}; paths keep room for the chassis of {chassis:g} m and a position error of {position_error:.2f} m"
        ) from None


def room_wanted(rule: CandidateRule, *, chassis: float, position_error: float) -> float:
    """How far paths keep from walls where there is room, metres: for a robot that leaves its path and errs in its position."""
    return max(rule.robot_radius, chassis + position_error + _STRAY)


def place_with_room(world: World, here: FloatArray, radius: float) -> FloatArray:
    """The place itself, or the next one with room for a radius, shape (2,); the place itself where there is none nearby."""
    if float(world.clearance(here[None])[0]) > radius:
        return here
    around = np.stack([np.cos(_DIRECTIONS), np.sin(_DIRECTIONS)], axis=1)
    for distance in _NEAR.tolist():
        places = here + distance * around
        clearances = world.clearance(places)
        if clearances.max() > _ROOM * radius:
            return places[int(np.argmax(clearances))]
    return here


def stands_in_the_way(points: FloatArray, path: FloatArray, *, radius: float, ahead: float) -> bool:
    """Whether a point is within a radius of the first metres of a path.

    Parameters
    ----------
    points : shape (k, 2)
        What the laser met, in the frame of the path.
    path : shape (waypoints, 2)
    radius, ahead
        Metres.
    """
    length = path_length(path)
    if len(path) < 2 or length == 0 or len(points) == 0:
        return False
    cut = min(ahead, length)
    end = stations(path, np.array([cut])).positions
    so_far = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
    part = np.concatenate([path[so_far < cut], end])
    near = points[np.linalg.norm(points - part[0], axis=1) <= ahead + radius]
    return any(bool(distances_to_segments(point, part[:-1], part[1:]).min() < radius) for point in near)
