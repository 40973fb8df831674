"""Where new poses stand along a path: as a front end puts its key poses, by distance and by turn."""

from __future__ import annotations

import math

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.polyline import path_length
from topobelief.graph.pose_graph import PoseGraph

_ROUNDING = 1e-9  # relative: what differs by less counts as equal


def poses_along(graph: PoseGraph, start: int, path: FloatArray, *, spacing: float, turn: float | None) -> FloatArray:
    """New poses along a path, wherever the robot has driven or turned far enough since the last one, and at its end.

    Parameters
    ----------
    graph
    start
        Index of the pose where the path begins. There the robot turns into the path; in SE(3) the path is driven upright at
        the height of this pose.
    path : shape (waypoints, 2)
        None repeated.
    spacing
        Metres along the path after which there is a pose. It heads along the path, at a corner as it came.
    turn
        Radians after which there is a pose; several in one place at a sharp corner, each turned by this from the one before.
        The heading that counts is that of the last pose. None: by distance only.

    Returns
    -------
    shape (L, pose_size)
    """
    if path_length(path) <= _ROUNDING * spacing:
        return np.zeros((0, graph.group.pose_size))
    x_y, heading = _stops(path, _yaw(graph.poses[start]), spacing, math.inf if turn is None else turn)
    if graph.group.pose_size == 3:
        return np.column_stack([x_y, heading])
    z, zero = np.full(len(x_y), graph.positions[start, 2]), np.zeros(len(x_y))
    return np.column_stack([x_y, z, zero, zero, np.sin(heading / 2), np.cos(heading / 2)])


def _stops(path: FloatArray, first_heading: float, spacing: float, turn: float) -> tuple[FloatArray, FloatArray]:
    """Places, shape (L, 2), and headings, shape (L,), of the new poses."""
    legs = np.diff(path, axis=0)
    so_far = np.r_[0.0, np.cumsum(np.linalg.norm(legs, axis=1))]
    ends, headings = so_far[1:].tolist(), np.arctan2(legs[:, 1], legs[:, 0]).tolist()
    stops: list[tuple[float, float]] = []  # metres along the path, heading
    last, count = 0.0, 0  # where the robot last turned, and how often it drove the spacing since
    heading, turned = first_heading, 0.0  # of the robot, and by how much it has turned since the last pose
    begin = 0.0
    for end, ahead in zip(ends, headings, strict=True):
        turned += _wrapped(ahead - heading)
        heading = ahead
        while abs(turned) >= turn * (1 - _ROUNDING):
            turned -= math.copysign(turn, turned)
            last, count = begin, 0
            stops.append((begin, ahead - turned))
        while last + (count + 1) * spacing <= end + _ROUNDING * spacing:
            count += 1
            turned = 0.0
            stops.append((last + count * spacing, ahead))
        begin = end
    if last + count * spacing < begin - _ROUNDING * spacing:
        stops.append((begin, heading))
    at = np.array([distance for distance, _ in stops])
    x_y = np.column_stack([np.interp(at, so_far, path[:, 0]), np.interp(at, so_far, path[:, 1])])
    x_y[-1] = path[-1]
    return x_y, np.array([_wrapped(angle) for _, angle in stops])


def _yaw(pose: FloatArray) -> float:
    if len(pose) == 3:
        return float(pose[2])
    _, _, _, x, y, z, w = pose.tolist()
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def _wrapped(angle: float) -> float:
    """Into [-pi, pi]; what is there stays as it is."""
    return math.remainder(angle, 2 * math.pi)
