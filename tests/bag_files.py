"""Bags as ROS records them, in each of its formats, written by rosbags."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

FORMATS = ("ROS 1", "ROS 2 SQLite", "ROS 2 MCAP")
_POINT, _QUATERNION, _POSE = "geometry_msgs/msg/Point", "geometry_msgs/msg/Quaternion", "geometry_msgs/msg/Pose"


@cache
def _store(release: str) -> Any:
    return get_typestore(Stores[release])


class Messages:
    """Makes messages of one release of ROS."""

    def __init__(self, release: str = "ROS2_HUMBLE") -> None:
        self.store = _store(release)
        self.ros_1 = release.startswith("ROS1")

    def make(self, kind: str, **fields: Any) -> Any:
        """A message with these fields, each other one empty or 0."""
        package, _, name = kind.partition("/msg/")
        values = {field: self._empty(description) for field, description in self.store.fielddefs[f"{package}/msg/{name}"][1]}
        return self.store.types[kind](**(values | fields))

    def _empty(self, description: Any) -> Any:
        node, inner = description
        if node.name == "NAME":
            return self.make(inner)
        if node.name == "BASE":
            return "" if inner[0] == "string" else False if inner[0] == "bool" else 0.0 if "float" in inner[0] else 0
        (child, kind), length = inner
        if child.name == "NAME":
            return [self.make(kind) for _ in range(length or 0)]
        return np.zeros(length or 0, dtype={"float64": np.float64, "float32": np.float32}.get(kind[0], np.int8))

    def pose(self, x: float, y: float, yaw: float = 0.0, z: float = 0.0) -> Any:
        turned = self.make(_QUATERNION, z=float(np.sin(yaw / 2)), w=float(np.cos(yaw / 2)))
        return self.make(_POSE, position=self.point(x, y, z), orientation=turned)

    def point(self, x: float, y: float, z: float = 0.0) -> Any:
        return self.make(_POINT, x=float(x), y=float(y), z=float(z))

    def odometry(self, x: float, y: float, yaw: float = 0.0) -> Any:
        carried = self.make("geometry_msgs/msg/PoseWithCovariance", pose=self.pose(x, y, yaw))
        return self.make("nav_msgs/msg/Odometry", pose=carried)

    def path(self, poses: Iterable[tuple[float, ...]]) -> Any:
        stamped = [self.make("geometry_msgs/msg/PoseStamped", pose=self.pose(*pose)) for pose in poses]
        return self.make("nav_msgs/msg/Path", poses=stamped)

    def grid(self, cells: np.ndarray, resolution: float = 0.5, origin: tuple[float, ...] = (0.0, 0.0)) -> Any:
        rows, columns = cells.shape
        info = self.make(
            "nav_msgs/msg/MapMetaData", resolution=resolution, width=columns, height=rows, origin=self.pose(*origin)
        )
        return self.make("nav_msgs/msg/OccupancyGrid", info=info, data=cells.astype(np.int8).ravel())

    def marker(self, namespace: str, number: int, kind: int, points: Iterable[tuple[float, ...]] = (), **fields: Any) -> Any:
        at = fields.pop("at", (0.0, 0.0))
        return self.make(
            "visualization_msgs/msg/Marker",
            **fields,
            ns=namespace,
            id=number,
            type=kind,
            pose=self.pose(*at),
            points=[self.point(*point) for point in points],
            text="a label",
        )

    def markers(self, *markers: Any) -> Any:
        return self.make("visualization_msgs/msg/MarkerArray", markers=list(markers))


def messages_for(format_name: str) -> Messages:
    return Messages("ROS1_NOETIC" if format_name == "ROS 1" else "ROS2_HUMBLE")


def write_bag(
    folder: Path, format_name: str, made: Messages, topics: dict[str, list[Any]], *, compression: str | None = None
) -> Path:
    """A bag with these messages, one a second, topic after topic; a folder for ROS 2.

    Compression is "lz4" or "bz2" for ROS 1, "file" or "message" for ROS 2, and there "storage" for MCAP.
    """
    if format_name == "ROS 1":
        path, writer = folder / "drive.bag", Writer1(folder / "drive.bag")
    else:
        plugin = StoragePlugin.MCAP if format_name.endswith("MCAP") else StoragePlugin.SQLITE3
        path, writer = folder / "drive", Writer2(folder / "drive", version=9, storage_plugin=plugin)
    if compression is not None:
        if isinstance(writer, Writer1):
            writer.set_compression(Writer1.CompressionFormat[compression.upper()])
        else:
            writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    encode = made.store.serialize_ros1 if made.ros_1 else made.store.serialize_cdr
    second = 0
    with writer:
        for topic, messages in topics.items():
            kind = messages[0].__msgtype__ if messages else "nav_msgs/msg/Path"
            connection = writer.add_connection(topic, kind, typestore=made.store)
            for message in messages:
                second += 1
                writer.write(connection, second * 10**9, encode(message, message.__msgtype__))
    return path
