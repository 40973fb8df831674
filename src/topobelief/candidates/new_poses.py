"""Where new poses stand along a path: as a front end puts its key poses, by distance and by turn."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from topobelief.arrays import FloatArray
from topobelief.candidates.attitude import Legs
from topobelief.candidates.polyline import interpolated, path_length
from topobelief.geometry.planar import quaternions_of_headings
from topobelief.graph.pose_graph import PoseGraph

_ROUNDING = 1e-9  # relative: what differs by less counts as equal


def poses_along(
    graph: PoseGraph, start: int, path: FloatArray, *, spacing: float, turn: float | None, legs: Legs
) -> FloatArray:
    """New poses along a path, wherever the robot has driven or turned far enough since the last one, and at its end.

    Parameters
    ----------
    graph
    start
        Index of the pose where the path begins. There the robot turns into the path.
    path : shape (waypoints, k)
        None repeated.
    spacing
        Metres along the path after which there is a pose. It heads along the path, at a corner as it came.
    turn
        Radians after which there is a pose; several in one place at a sharp corner, each turned by this from the one before.
        The orientation that counts is that of the last pose. None: by distance only.
    legs
        How the robot is turned along the path's legs.

    Returns
    -------
    shape (L, pose_size)
    """
    if path_length(path) <= _ROUNDING * spacing:
        return np.zeros((0, graph.group.pose_size))
    so_far = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
    limit = math.inf if turn is None else turn
    if legs.attitude == "upright":
        at, headings = _stops(so_far, legs.headings(np.diff(path, axis=0)), _yaw(graph.poses[start]), spacing, limit)
        rotations = headings[:, None] if graph.group.pose_size == 3 else quaternions_of_headings(headings)
    else:
        along = legs.rotations(path[:-1], path[1:])
        at, rotations = _stops_in_space(so_far, along, Rotation.from_quat(graph.poses[start, 3:]), spacing, limit)
    places = interpolated(path, so_far, at)
    places[-1] = path[-1]
    return np.column_stack([places, rotations])


def _stops(
    so_far: FloatArray, ahead_on_legs: FloatArray, first_heading: float, spacing: float, turn: float
) -> tuple[FloatArray, FloatArray]:
    """Metres along the path and headings of the new poses, shape (L,) each.

    Parameters
    ----------
    so_far : shape (waypoints,)
        Metres along the path.
    ahead_on_legs : shape (waypoints - 1,)
        Headings.
    first_heading, spacing, turn
    """
    stops: list[tuple[float, float]] = []  # metres along the path, heading
    last, count = 0.0, 0  # where the robot last turned, and how often it drove the spacing since
    heading, turned = first_heading, 0.0  # of the robot, and by how much it has turned since the last pose
    begin = 0.0
    for end, ahead in zip(so_far[1:].tolist(), ahead_on_legs.tolist(), strict=True):
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
    return np.array([distance for distance, _ in stops]), np.array([_wrapped(angle) for _, angle in stops])


def _stops_in_space(
    so_far: FloatArray, along: Rotation, first: Rotation, spacing: float, turn: float
) -> tuple[FloatArray, FloatArray]:
    """As `_stops`, with orientations on the legs: metres along the path, shape (L,), and quaternions, shape (L, 4)."""
    at: list[float] = []
    found: list[FloatArray] = []
    last, count, begin, latest = 0.0, 0, 0.0, first
    for end, ahead in zip(so_far[1:].tolist(), along, strict=True):
        while True:
            remaining = (latest.inv() * ahead).as_rotvec()
            angle = float(np.linalg.norm(remaining))
            if angle < turn * (1 - _ROUNDING):
                break
            latest = latest * Rotation.from_rotvec(remaining * min(turn / angle, 1.0))
            last, count = begin, 0
            at.append(begin)
            found.append(latest.as_quat(canonical=True))
        while last + (count + 1) * spacing <= end + _ROUNDING * spacing:
            count += 1
            latest = ahead
            at.append(last + count * spacing)
            found.append(ahead.as_quat(canonical=True))
        begin = end
    if last + count * spacing < begin - _ROUNDING * spacing:
        at.append(begin)
        found.append(along[-1].as_quat(canonical=True))
    return np.array(at), np.array(found)


def _yaw(pose: FloatArray) -> float:
    if len(pose) == 3:
        return float(pose[2])
    _, _, _, x, y, z, w = pose.tolist()
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def _wrapped(angle: float) -> float:
    """Into [-pi, pi]; what is there stays as it is."""
    return math.remainder(angle, 2 * math.pi)
