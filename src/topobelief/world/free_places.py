"""The nearest place where a robot has room, for a place where it has not."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray
from topobelief.errors import InvalidMapError
from topobelief.world import shapes
from topobelief.world.space import FreeSpace
from topobelief.world.world import World
from topobelief.world.world_3d import World3D

_SLACK = 0.03  # of the radius: erosions are off by up to 0.02 of it
_DIGITS = 2  # of the coordinates of a place: centimetres, which a person can type
_ROUNDING = 0.01  # metres by which rounding may move a place, and more


def nearest_free_place(
    world: FreeSpace, place: ArrayLike, robot_radius: float, *, reachable_from: ArrayLike | None = None
) -> FloatArray | None:
    """About the nearest place where the centre of a robot can be, in whole centimetres.

    Parameters
    ----------
    world
    place : shape (dim,)
        Metres, anywhere.
    robot_radius
        Metres.
    reachable_from : shape (dim,), optional
        Where given, the robot can drive from there to the place; not heeded in space.

    Returns
    -------
    shape (dim,), or None where no room is found
        Its clearance is above the radius. There may be nearer places with hardly more room than the radius, by some 3 % of
        it and a centimetre.

    Examples
    --------
    >>> room = World.from_boxes([(4, 4, 6, 6)], bounds=(0, 0, 10, 10))
    >>> nearest_free_place(room, (4.5, 5), 0.3).tolist()
    [3.68, 5.0]
    """
    target = np.asarray(place, dtype=np.float64)
    if isinstance(world, World3D):
        found = world.nearest_free_place(target, robot_radius * (1 + _SLACK) + _ROUNDING)
        return None if found is None else np.round(found, _DIGITS)
    if not isinstance(world, World):
        raise TypeError(f"expected a World or a World3D, got {type(world).__name__}")
    room = robot_radius * (1 + _SLACK) + _ROUNDING
    if reachable_from is None:
        free = shapes.eroded(world.free, room)
    else:
        try:
            free = world.component(reachable_from, room)
        except InvalidMapError:
            return None
    if not shapes.polygons(free):
        return None
    found = np.round(shapes.nearest_place(free, target), _DIGITS)
    return found if world.clearance(found[None])[0] > robot_radius else None
