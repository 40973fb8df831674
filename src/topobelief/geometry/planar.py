"""Headings in the plane: of travel along points, and as unit quaternions about the z axis."""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.geometry.se3 import SE3


def travel_headings(points: FloatArray) -> FloatArray:
    """The direction in which each point is reached from the one before it; the first one's is that in which it is left.

    Parameters
    ----------
    points : shape (N, 2)
        Where a point repeats the one before it, the heading stays.

    Returns
    -------
    shape (N,)
        Radians; 0 where no point differs from another.

    Examples
    --------
    >>> travel_headings(np.array([(0, 0), (0, 0), (2, 0), (2, 1), (2, 1)])).round(3).tolist()
    [0.0, 0.0, 0.0, 1.571, 1.571]
    """
    steps = np.diff(points, axis=0)
    moves = np.flatnonzero((steps != 0).any(axis=1))
    if moves.size == 0:
        return np.zeros(len(points))
    latest = np.searchsorted(moves, np.arange(len(points)) - 1, side="right") - 1  # last move that led to each point
    x, y = steps[moves[np.maximum(latest, 0)]].T
    return np.arctan2(y, x)


def quaternions_of_headings(headings: FloatArray) -> FloatArray:
    """Unit quaternions (x, y, z, w) that turn about z by each heading, radians; shape (N,) to (N, 4)."""
    zero = np.zeros(len(headings))
    return np.column_stack([zero, zero, np.sin(headings / 2), np.cos(headings / 2)])


def upright_poses(poses: FloatArray) -> FloatArray:
    """Poses x, y, yaw as poses in space at height 0; shape (N, 3) to (N, 7)."""
    return np.column_stack([poses[:, :2], np.zeros(len(poses)), quaternions_of_headings(poses[:, 2])])


def headings_of_quaternions(quaternions: FloatArray) -> FloatArray:
    """Direction of the x axis, seen from above, radians; unit quaternions (x, y, z, w) of shape (N, 4) to (N,)."""
    rotation = SE3().rotation_matrix(np.concatenate([np.zeros((len(quaternions), 3)), quaternions], axis=1))
    return np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
