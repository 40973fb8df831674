"""The walls of a world: the straight pieces of its boundary, each with the free space on its left."""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.world import World


def wall_segments(world: World) -> tuple[FloatArray, FloatArray]:
    """Starts and ends of all walls, shapes (W, 2), metres; the fence along the bounds is among them."""
    starts: list[FloatArray] = []
    ends: list[FloatArray] = []
    for polygon in world.free.geoms:
        for index, ring in enumerate((polygon.exterior, *polygon.interiors)):
            corners = np.asarray(ring.coords, dtype=np.float64)[:, :2]
            if ring.is_ccw != (index == 0):
                corners = corners[::-1]
            starts.append(corners[:-1])
            ends.append(corners[1:])
    segments = np.stack([np.concatenate(starts), np.concatenate(ends)])
    segments = segments[:, (segments[0] != segments[1]).any(axis=1)]
    return segments[0], segments[1]
