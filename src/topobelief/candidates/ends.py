"""Start and goal of a path, checked: places where the robot has room."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray, frozen_floats
from topobelief.errors import InvalidInputError, PlanningError, require_positive
from topobelief.world import FreeSpace
from topobelief.world.free_places import nearest_free_place

SAME_PLACE = 1e-9  # metres


def checked_ends(world: FreeSpace, start: ArrayLike, goal: ArrayLike, robot_radius: float) -> FloatArray:
    """Start and goal as rows of an array of shape (2, dim).

    Raises
    ------
    PlanningError
        Where one of them is out of bounds or in collision, or both are the same place.
    """
    require_positive("a robot radius", robot_radius, unit="m")
    ends = np.stack([checked_place(world, start, "start"), checked_place(world, goal, "goal")])
    _require_room(world, "start", ends[0], robot_radius)
    _require_room(world, "goal", ends[1], robot_radius, reachable_from=ends[0])
    if np.linalg.norm(ends[1] - ends[0]) <= SAME_PLACE:
        raise PlanningError(f"expected a goal away from the start, got {shown_place(ends[1])} for both; choose another goal")
    return ends


def _require_room(
    world: FreeSpace, name: str, place: FloatArray, robot_radius: float, *, reachable_from: FloatArray | None = None
) -> None:
    """Raise where a place is out of bounds or in collision; names the nearest one that is not."""
    clearance = float(world.clearance(place[None])[0])
    if clearance > robot_radius:
        return
    if outside := _outside(world, place):
        problem = outside
    else:
        where = "in an obstacle or unknown space" if clearance <= 0 else f"{clearance:.2f} m from the nearest obstacle"
        problem = f"with more clearance than the robot's radius of {robot_radius:g} m, got {shown_place(place)}, {where}"
    nearest = nearest_free_place(world, place, robot_radius, reachable_from=reachable_from)
    if nearest is None:
        advice = "choose a smaller radius: there is no room for the robot anywhere"
    else:
        numbers = " ".join(f"{coordinate:g}" for coordinate in nearest.tolist())
        advice = f"choose the nearest free place, {numbers}, {np.linalg.norm(nearest - place):.2f} m away"
    raise PlanningError(f"expected a {name} {problem}; {advice}")


def _outside(world: FreeSpace, place: FloatArray) -> str:
    """What is wrong with a place that is not on the map; empty for one that is."""
    low, high = world.corners
    if ((place >= low) & (place <= high)).all():
        return ""
    spans = [f"{axis} {a:g} to {b:g}" for axis, a, b in zip("xyz", low.tolist(), high.tolist(), strict=False)]
    return f"on the map, {', '.join(spans[:-1])} and {spans[-1]}, got {shown_place(place)}"


def checked_place(world: FreeSpace, place: ArrayLike, name: str) -> FloatArray:
    """A finite place of shape (dim,); in the plane a heading is dropped."""
    array = frozen_floats(place, name=name)
    if world.dim == 2 and array.shape in ((2,), (3,)) and np.isfinite(array).all():
        return array[:2]
    if world.dim == 3 and array.shape in ((3,), (7,)) and np.isfinite(array).all():
        return array[:3]
    expected = "(x, y) or (x, y, theta)" if world.dim == 2 else "(x, y, z), metres, or a pose in SE(3)"
    raise InvalidInputError(f"expected a finite {name} {expected}, got {array.tolist()}")


def shown_place(place: Sequence[float] | FloatArray) -> str:
    """A place in a message."""
    return f"({', '.join(f'{coordinate:g}' for coordinate in place)})"
