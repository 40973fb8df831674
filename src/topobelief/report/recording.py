"""A run as an MCAP file, which Foxglove opens: walls, robot, scans, graph, candidates and map over time.

Frames: `map` is the world, `base` the robot where it believes to be, `true_base` where it is. Needs the extra `view`.
"""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.optional import load
from topobelief.report import style
from topobelief.simulation.record import Record
from topobelief.simulation.scan import Scan
from topobelief.world import World

_NANOSECONDS = 1_000_000_000


def write_recording(record: Record, path: str | PathLike[str]) -> None:
    """Write a run as MCAP.

    Raises
    ------
    InvalidInputError
        Where foxglove-sdk is not installed.
    """
    sdk = load("foxglove", "view")
    context = sdk.Context()
    with sdk.open_mcap(Path(path), allow_overwrite=True, context=context):
        _Recorder(context).record(record)


class _Recorder:
    """Channels, and what is written to them."""

    def __init__(self, context: Any) -> None:
        self._m: Any = load("foxglove.messages", "view")
        channels: Any = load("foxglove.channels", "view")
        self._scene = {
            topic: channels.SceneUpdateChannel(topic, context=context) for topic in ("/world", "/graph", "/candidates")
        }
        self._transforms = channels.FrameTransformsChannel("/tf", context=context)
        self._scans = channels.LaserScanChannel("/scan", context=context)
        self._map = channels.GridChannel("/map", context=context)

    def record(self, record: Record) -> None:
        """Everything in the order of time."""
        times = record.history.key_poses.times
        first, last = float(times[0]), float(times[-1])
        self._world(record.scenario.world, first)
        events = [(float(row[0]), 0, index) for index, row in enumerate(record.history.track)]
        events += [(float(time), 1, index) for index, time in enumerate(times)]
        events += [
            (float(times[record.legs[each.leg].first_pose]), 2, index) for index, each in enumerate(record.deliberations)
        ]
        for time, kind, index in sorted(events):
            if kind == 0:
                self._poses(record.history.track[index], time)
            elif kind == 1:
                self._scan(record.history.key_poses.scans[index], time)
                self._graph(record, index, time)
            else:
                self._candidates(record, index, time)
        self._grid(record, last)

    def _stamp(self, time: float) -> tuple[Any, int]:
        nanoseconds = round(time * _NANOSECONDS)
        return self._m.Timestamp(*divmod(nanoseconds, _NANOSECONDS)), nanoseconds

    def _lines(self, points: FloatArray, colour: str, thickness: float, *, kind: str = "LineList", alpha: float = 1.0) -> Any:
        """Points of shape (N, 2) as segments, or as one line."""
        m = self._m
        return m.LinePrimitive(
            type=getattr(m.LinePrimitiveLineType, kind),
            thickness=thickness,
            points=[m.Point3(x=x, y=y, z=0.0) for x, y in points.reshape(-1, 2).tolist()],
            color=m.Color(**dict(zip("rgb", _rgb(colour), strict=True)), a=alpha),
        )

    def _draw(self, topic: str, name: str, lines: list[Any], time: float) -> None:
        stamp, log_time = self._stamp(time)
        entity = self._m.SceneEntity(timestamp=stamp, frame_id="map", id=name, lines=lines)
        self._scene[topic].log(self._m.SceneUpdate(entities=[entity]), log_time=log_time)

    def _world(self, world: World, time: float) -> None:
        rings = [ring for polygon in world.free.geoms for ring in (polygon.exterior, *polygon.interiors)]
        lines = [self._lines(np.asarray(ring.coords)[:, :2], style.INK, 0.05, kind="LineStrip") for ring in rings]
        self._draw("/world", "walls", lines, time)

    def _poses(self, row: FloatArray, time: float) -> None:
        stamp, log_time = self._stamp(time)
        transforms = [
            self._m.FrameTransform(
                timestamp=stamp,
                parent_frame_id="map",
                child_frame_id=frame,
                translation=self._m.Vector3(x=x, y=y, z=0.0),
                rotation=self._m.Quaternion(x=0.0, y=0.0, z=math.sin(theta / 2), w=math.cos(theta / 2)),
            )
            for frame, (x, y, theta) in (("true_base", row[1:4].tolist()), ("base", row[4:7].tolist()))
        ]
        self._transforms.log(self._m.FrameTransforms(transforms=transforms), log_time=log_time)

    def _scan(self, scan: Scan, time: float) -> None:
        stamp, log_time = self._stamp(time)
        message = self._m.LaserScan(
            timestamp=stamp,
            frame_id="base",
            pose=self._m.Pose(
                position=self._m.Vector3(x=0.0, y=0.0, z=0.0), orientation=self._m.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
            ),
            start_angle=float(scan.angles[0]),
            end_angle=float(scan.angles[-1]),
            ranges=scan.ranges.tolist(),
        )
        self._scans.log(message, log_time=log_time)

    def _graph(self, record: Record, newest: int, time: float) -> None:
        """Edges among the poses so far, at the final estimate."""
        edges = record.graph.edges[(record.graph.edges <= newest).all(axis=1)]
        closing = np.abs(edges[:, 0] - edges[:, 1]) > 1
        lines = [
            self._lines(record.graph.positions[edges[chosen]], colour, thickness)
            for chosen, colour, thickness in ((closing, style.CLOSURE, 0.02), (~closing, style.ODOMETRY, 0.04))
            if chosen.any()
        ]
        self._draw("/graph", "graph", lines, time)

    def _candidates(self, record: Record, index: int, time: float) -> None:
        each = record.deliberations[index]
        lines = [self._lines(path, style.RULED_OUT, 0.03, kind="LineStrip") for path in each.paths]
        lines.append(self._lines(each.paths[each.choice.index], style.BEST, 0.07, kind="LineStrip"))
        self._draw("/candidates", "candidates", lines, time)

    def _grid(self, record: Record, time: float) -> None:
        """The map at the end."""
        m, grid = self._m, record.occupancy
        stamp, log_time = self._stamp(time)
        cells = np.ascontiguousarray(grid.probability, dtype=np.float32)
        x, y = grid.origin
        message = m.Grid(
            timestamp=stamp,
            frame_id="map",
            pose=m.Pose(position=m.Vector3(x=x, y=y, z=-0.01), orientation=m.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)),
            column_count=cells.shape[1],
            cell_size=m.Vector2(x=grid.resolution, y=grid.resolution),
            row_stride=4 * cells.shape[1],
            cell_stride=4,
            fields=[m.PackedElementField(name="occupancy", offset=0, type=m.PackedElementFieldNumericType.Float32)],
            data=cells.tobytes(),
        )
        self._map.log(message, log_time=log_time)


def _rgb(colour: str) -> tuple[float, float, float]:
    """Shares of red, green and blue of "#RRGGBB"."""
    red, green, blue = (int(colour[place : place + 2], 16) / 255 for place in (1, 3, 5))
    return red, green, blue
