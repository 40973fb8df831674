"""Pose graphs out of bags: trajectories from nav_msgs/Odometry or Path, drawings from visualization_msgs/MarkerArray."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import FileError
from topobelief.io.bags import MARKERS, ODOMETRY, PATH, Recording, read_topics
from topobelief.io.filed_path import normalised
from topobelief.io.files import StrPath
from topobelief.io.markers import Marker, graph_of_markers
from topobelief.io.reading import ReadGraph, ReadingOptions
from topobelief.io.trajectory import graph_along
from topobelief.io.transforms import FARTHEST
from topobelief.wording import counted

_TOPIC_OPTION = "--topic NAME (in Python topic='NAME')"


def read_bag(path: StrPath, options: ReadingOptions) -> ReadGraph:
    """Read the graph of one topic of a bag, or of several that draw one graph together.

    Every message of odometry is a pose. Of a path and of markers the last message counts: SLAM programs publish them whole,
    again and again.

    Raises
    ------
    InvalidInputError
        If rosbags is not installed.
    FileError
        If the bag is damaged, or has no such topic, or several and the options name none; if a trajectory is read without a
        stated noise; if a message holds no poses.
    """
    recordings = read_topics(path, (ODOMETRY, PATH, MARKERS), tuple(options.topic), option=_TOPIC_OPTION)
    notes = [_note(recording) for recording in recordings]
    first = recordings[0]
    if first.kind == MARKERS:
        markers = [
            marker
            for recording in recordings
            for marker in markers_of_message(path, recording.messages[-1], where=repr(recording.topic))
        ]
        return graph_of_markers(path, markers, options, notes)
    poses = [stamped.pose for stamped in first.messages[-1].poses] if first.kind == PATH else first.messages
    return graph_along(path, poses_of_messages(path, poses, where=repr(first.topic)), options, notes)


def _note(recording: Recording) -> str:
    name = recording.kind.replace("/msg/", "/")
    which = "all" if recording.kind == ODOMETRY else "the last"
    return f"read {which} of {counted(recording.count, 'message')} of {recording.topic!r} ({name})"


def poses_of_messages(path: StrPath, poses: Sequence[Any], *, where: str) -> FloatArray:
    """Poses of messages geometry_msgs/Pose, shape (N, 7), N > 0.

    Raises
    ------
    FileError
        Names the first that is none.
    """
    if not poses:
        raise FileError(path, f"expected at least one pose in the last message of {where}, got none")
    positions = np.array([_point(pose.position) for pose in poses])
    turned = np.array([[getattr(pose.orientation, name) for name in "xyzw"] for pose in poses])
    far = np.flatnonzero(~(np.abs(positions).max(axis=1) <= FARTHEST))
    unit, bad, problem = normalised(turned)
    if far.size:
        bad, problem = int(far[0]), f"expected positions within {FARTHEST:.0e} m of the origin, got one beyond"
    if bad is not None:
        raise FileError(path, f"{problem} at pose {bad} of {where}")
    return np.column_stack([positions, unit])


def markers_of_message(path: StrPath, message: Any, *, where: str) -> Iterator[Marker]:
    """The markers of a visualization_msgs/MarkerArray.

    Raises
    ------
    FileError
        Names the first with a number that no graph has.
    """
    for number, each in enumerate(message.markers):
        marker = Marker(None, each.ns, each.id, each.type, each.action)
        for part, names in (("position", "xyz"), ("orientation", "xyzw")):
            marker.pose |= {f"{part}.{name}": getattr(getattr(each.pose, part), name) for name in names}
        marker.points += [_point(point) for point in each.points]
        numbers = [*marker.pose.values(), *(value for point in marker.points for value in point)]
        if not all(math.isfinite(value) and abs(value) <= FARTHEST for value in numbers):
            raise FileError(path, f"expected numbers within {FARTHEST:.0e} m, got another in marker {number} of {where}")
        yield marker


def _point(point: Any) -> list[float]:
    return [point.x, point.y, point.z]
