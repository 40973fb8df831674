"""Paths as polylines: arrays of shape (waypoints, dim), metres, in the plane or in space.

How long they are, and what lies where along them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray, frozen_floats
from topobelief.errors import InvalidInputError
from topobelief.geometry.planar import travel_headings
from topobelief.geometry.segments import products


class Stations(NamedTuple):
    """Places along a path."""

    positions: FloatArray  # shape (N, dim)
    headings: FloatArray  # direction of travel, seen from above, radians, shape (N,)


def checked_path(path: ArrayLike, *, name: str = "path") -> FloatArray:
    """A polyline without repeated waypoints.

    Raises
    ------
    InvalidInputError
        Where it is not an array of finite waypoints of shape (waypoints, 2) or (waypoints, 3), at least one.
    """
    array = frozen_floats(path, name=name)
    if array.ndim != 2 or array.shape[1] not in (2, 3) or len(array) == 0 or not np.isfinite(array).all():
        raise InvalidInputError(
            f"expected {name} as finite waypoints of shape (waypoints, 2) or (waypoints, 3), got {array.shape}"
        )
    return array[np.r_[True, (np.diff(array, axis=0) != 0).any(axis=1)]]


def path_length(path: ArrayLike) -> float:
    """Length of a polyline of shape (waypoints, 2) or (waypoints, 3), metres.

    Examples
    --------
    >>> path_length([(0, 0), (3, 4), (3, 5)])
    6.0
    """
    return float(_lengths_so_far(checked_path(path))[-1])


def stations(path: FloatArray, distances: FloatArray) -> Stations:
    """Where a path is after each distance, and in which direction it heads there: at a corner, the direction of arrival.

    Parameters
    ----------
    path : shape (waypoints, 2)
        At least 2 waypoints, none repeated.
    distances : shape (N,)
        Metres along the path, from 0 to its length.
    """
    so_far = _lengths_so_far(path)
    leg = np.clip(np.searchsorted(so_far, distances * (1 - 1e-12)) - 1, 0, len(path) - 2)
    step = path[leg + 1] - path[leg]
    share = (distances - so_far[leg]) / (so_far[leg + 1] - so_far[leg])
    return Stations(path[leg] + share[:, None] * step, np.arctan2(step[:, 1], step[:, 0]))


def path_poses(path: ArrayLike) -> FloatArray:
    """A path as poses: its waypoints, each with the direction in which the robot came, the first with that in which it leaves.

    Parameters
    ----------
    path : shape (waypoints, 2)
        Metres. Between two waypoints it is straight.

    Returns
    -------
    shape (waypoints, 3)
        x, y in metres and yaw in radians, world frame; repeated waypoints once. The yaw of a path of one waypoint is 0.

    Examples
    --------
    >>> path_poses([(0, 0), (2, 0), (2, 1)]).round(3).tolist()
    [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 1.571]]
    """
    waypoints = checked_path(path)
    return np.column_stack([waypoints, travel_headings(waypoints)])


def sampled(path: FloatArray, count: int) -> FloatArray:
    """Places at equal distances along a path, its ends among them; shape (count, dim)."""
    so_far = _lengths_so_far(path)
    at = so_far[-1] * (np.arange(count) / (count - 1))
    return interpolated(path, so_far, at)


def interpolated(path: FloatArray, so_far: FloatArray, at: FloatArray) -> FloatArray:
    """Places along a path, shape (N, dim).

    Parameters
    ----------
    path : shape (waypoints, dim)
    so_far : shape (waypoints,)
        Metres along the path.
    at : shape (N,)
        Metres along the path.
    """
    result = np.empty((len(at), path.shape[1]))
    for axis in range(path.shape[1]):
        result[:, axis] = np.interp(at, so_far, path[:, axis])
    return result


def subdivided(path: FloatArray, pieces: int) -> FloatArray:
    """A path with each leg cut into equal pieces; its own waypoints stay as they are, every `pieces`-th of the result."""
    shares = (np.arange(pieces) / pieces)[:, None]
    legs = path[:-1, None] + shares * (path[1:] - path[:-1])[:, None]
    return np.vstack([legs.reshape(-1, path.shape[1]), path[-1:]])


def _lengths_so_far(path: FloatArray) -> FloatArray:
    leg = path[1:] - path[:-1]
    return np.concatenate([[0.0], np.cumsum(np.sqrt(products(leg, leg)))])
