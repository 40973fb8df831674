"""Corners of obstacles, which shortest paths bend around, and the tangents between them.

Among obstacles a shortest path consists of straight ways that touch the outline of what the robot's centre can reach
where they end (Lozano-Pérez and Wesley, "An algorithm for planning collision-free paths among polyhedral obstacles",
CACM 1979). Around a corner of an obstacle this outline is an arc; the places here are corners of a polygon around it.
A straight line between two places is tested only if the outline lies on one side of it at both ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree
from shapely import Polygon

from topobelief.arrays import FloatArray, IntArray
from topobelief.world import World, shapes

_TOLERANCE = 0.15  # robot radii by which the outline may be off; leaves two corners of the arc around a right angle
_CLEAR = 0.025  # robot radii to keep from the outline, which is up to 0.02 too near to obstacles (`World.component`)
_SHARPEST = np.pi / 3  # half a turn, beyond which a place would be far from its corner


class Corners(NamedTuple):
    """Places at the convex corners of obstacles.

    Attributes
    ----------
    places : shape (N, 2)
        Metres, where the robot fits.
    beside : shape (N, 2, 2)
        The corners before and after each one on the outline.
    """

    places: FloatArray
    beside: FloatArray


def find_corners(world: World, region: Polygon, ends: FloatArray, robot_radius: float, max_corners: int) -> Corners:
    """Places to bend around all obstacles within reach.

    Parameters
    ----------
    world
    region
        What the robot's centre can reach, see `World.component`.
    ends : shape (2, 2)
        Start and goal.
    robot_radius
        Metres.
    max_corners
        Where there are more, those are kept by way of which it is nearest, straight, from start to goal.
    """
    tolerance = _TOLERANCE * robot_radius
    outline, before, after = shapes.corners(region, tolerance)
    arriving, leaving = _directions(outline - before), _directions(after - outline)
    by_way = np.linalg.norm(outline[:, None] - ends, axis=2).sum(axis=1)
    convex = np.flatnonzero(_cross(arriving, leaving) < 0)  # the region is on the left
    kept = np.sort(convex[np.argsort(by_way[convex], kind="stable")[:max_corners]])
    outline, before, after, arriving, leaving = (each[kept] for each in (outline, before, after, arriving, leaving))
    half_turn = np.arccos(np.clip((arriving * leaving).sum(axis=1), -1, 1)) / 2
    off = (tolerance + _CLEAR * robot_radius) / np.cos(np.minimum(half_turn, _SHARPEST))  # moves the sides by the former
    away = _directions(arriving + leaving) @ np.array([[0, 1], [-1, 0]])
    places = outline + off[:, None] * away
    fits = world.segments_free(places, places, robot_radius)
    return Corners(places[fits], np.stack([before, after], axis=1)[fits])


def tangents(world: World, corners: Corners, robot_radius: float, nearest: range) -> IntArray:
    """Free ways between corners that touch the outline at both ends, shape (K, 2), each once.

    Parameters
    ----------
    world, corners
    robot_radius
        Metres.
    nearest
        Which neighbours of each corner are tried, counted from the nearest one, 1.
    """
    places, beside = corners
    order = np.arange(nearest.start, min(nearest.stop, len(places)))
    if not order.size:
        return np.zeros((0, 2), dtype=np.int64)
    _, neighbours = KDTree(places).query(places, k=order + 1)
    pairs = np.stack([np.repeat(np.arange(len(places)), len(order)), np.ravel(neighbours)], axis=1)
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    along = places[pairs[:, 1]] - places[pairs[:, 0]]
    touching = pairs[:, 0] != pairs[:, 1]
    for end in pairs.T:
        sides = [_cross(along, beside[end, which] - places[end]) for which in (0, 1)]
        touching &= sides[0] * sides[1] >= 0
    pairs = pairs[touching]
    return pairs[world.segments_free(places[pairs[:, 0]], places[pairs[:, 1]], robot_radius)]


def _directions(vectors: FloatArray) -> FloatArray:
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
