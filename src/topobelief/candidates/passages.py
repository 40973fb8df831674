"""Narrow passages: where two obstacles stand hardly further apart than the robot is wide.

Chance seldom puts a vertex into a doorway that leaves a few centimetres. But the shortest way across a gap joins two
points of the obstacles' outline with nothing between them, so it is (near) an edge of the Delaunay triangulation of
the outline: the middles of its short edges are where the robot has to pass, and square to them it has to come and go.
This does for every gap at once what the bridge test (Hsu et al., ICRA 2003) does by chance.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay

from topobelief.arrays import FloatArray
from topobelief.world import World

_WIDEST = 2.0  # robot diameters; what is wider, uniform sampling finds
_OUTLINE_SPACING = 1.0  # robot radii between points of the outline


def narrow_passages(world: World, robot_radius: float) -> FloatArray:
    """Places in, before and behind every narrow passage, at most one passage to a square of the robot's radius.

    Parameters
    ----------
    world
    robot_radius
        Metres. A passage is what is between 1 and 2 diameters wide.

    Returns
    -------
    shape (N, 2)
        Metres; first those in the passages, narrowest first, where the robot fits; then those before and those behind
        in the same order, some of which may be in collision. Some passages may be out of reach.
    """
    outline = world.outline(spacing=_OUTLINE_SPACING * robot_radius)
    triangles = Delaunay(outline - outline.mean(axis=0)).simplices
    sides = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    a, b = outline[np.unique(sides, axis=0)].transpose(1, 0, 2)
    width, middle = np.linalg.norm(b - a, axis=1), (a + b) / 2
    narrow = np.flatnonzero((width > 2 * robot_radius) & (width <= 2 * _WIDEST * robot_radius))
    fits = narrow[world.segments_free(middle[narrow], middle[narrow], robot_radius)]
    narrowest_first = fits[np.argsort(width[fits], kind="stable")]
    _, first = np.unique(np.floor(middle[narrowest_first] / robot_radius), axis=0, return_index=True)  # of each square
    kept = narrowest_first[np.sort(first)]
    across = (b - a)[kept] / width[kept, None]
    along = 2 * robot_radius * np.stack([-across[:, 1], across[:, 0]], axis=1)
    return np.concatenate([middle[kept], middle[kept] + along, middle[kept] - along])
