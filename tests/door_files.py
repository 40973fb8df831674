"""Files as other programs write them: databases of RTAB-Map, and what slam_toolbox and Cartographer draw.

The schema is that of RTAB-Map 0.22, the tables that hold the graph.
"""

from __future__ import annotations

import sqlite3
import struct
import zlib
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

SCHEMA = """
CREATE TABLE Node (id INTEGER NOT NULL, map_id INTEGER NOT NULL, weight INTEGER, stamp FLOAT, pose BLOB, ground_truth_pose BLOB,
  velocity BLOB, label TEXT, gps BLOB, env_sensors BLOB, time_enter DATE, PRIMARY KEY (id));
CREATE TABLE Link (from_id INTEGER NOT NULL, to_id INTEGER NOT NULL, type INTEGER NOT NULL, information_matrix BLOB NOT NULL,
  transform BLOB, user_data BLOB, FOREIGN KEY (from_id) REFERENCES Node(id), FOREIGN KEY (to_id) REFERENCES Node(id));
CREATE TABLE Admin (version TEXT, preview_image BLOB, opt_cloud BLOB, opt_ids BLOB, opt_poses BLOB, opt_last_localization BLOB,
  opt_polygons_size INTEGER, opt_polygons BLOB, opt_tex_coords BLOB, opt_tex_materials BLOB, opt_map BLOB, opt_map_x_min FLOAT,
  opt_map_y_min FLOAT, opt_map_resolution FLOAT, time_enter DATE);
CREATE INDEX IDX_Link_from_id on Link (from_id);
INSERT INTO Admin(version) VALUES('0.22.0');
"""
INFORMATION = np.diag([100.0, 200, 300, 400, 500, 600])
INFORMATION[0, 5] = INFORMATION[5, 0] = 7


def matrix(x: float, y: float = 0, yaw: float = 0) -> bytes:
    """The upper three rows of a transform, as floats of 32 bits."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0.5]], dtype="<f4").tobytes()


def inverse(x: float) -> bytes:
    return np.array([[1, 0, 0, -x], [0, 1, 0, 0], [0, 0, 1, -0.5]], dtype="<f4").tobytes()


def compressed(array: np.ndarray) -> bytes:
    """As RTAB-Map stores an array: zlib, then rows, columns and OpenCV's type."""
    return zlib.compress(array.tobytes()) + struct.pack("<3i", 1, array.size, {"<i4": 4, "<f4": 5}[array.dtype.str])


class Database:
    """A square of four nodes, each link stored from both ends but for a closure; changed before it is written."""

    def __init__(self) -> None:
        self.nodes: list[tuple[object, ...]] = [(node, 0, matrix(node - 1)) for node in (1, 2, 3, 4)]
        self.links: list[tuple[object, ...]] = []
        for node in (1, 2, 3):
            self.links.append((node, node + 1, 0, INFORMATION.tobytes(), matrix(1)))
            self.links.append((node + 1, node, 0, INFORMATION.tobytes(), inverse(1)))
        self.links.append((4, 1, 1, INFORMATION.tobytes(), matrix(-2.9)))
        self.admin: tuple[bytes | None, bytes | None] = (None, None)
        self.schema = SCHEMA

    def optimised(self, *ids: int) -> None:
        poses = np.concatenate([np.frombuffer(matrix(10 + node, 1, 0.1), dtype="<f4") for node in ids])
        self.admin = compressed(np.array(ids, dtype="<i4")), compressed(poses)

    def write(self, path: Path) -> Path:
        with closing(sqlite3.connect(path)) as database, database:
            database.executescript(self.schema)
            database.executemany("INSERT INTO Node(id, map_id, pose) VALUES (?, ?, ?)", self.nodes)
            query = "INSERT INTO Link(from_id, to_id, type, information_matrix, transform) VALUES (?, ?, ?, ?, ?)"
            database.executemany(query, self.links)
            database.execute("UPDATE Admin SET opt_ids = ?, opt_poses = ?", self.admin)
        return path


Point = tuple[float, ...]
SPHERE, STRIP, LIST = 2, 4, 5


def marker(
    namespace: str, number: int, kind: int, points: Sequence[Point] = (), *, at: Point = (0, 0, 0), action: int = 0
) -> str:
    """One marker, as ROS 2 prints it."""
    x, y, z = (*at, 0.0)[:3]
    lines = [
        "- header:\n    stamp:\n      sec: 12\n      nanosec: 5\n    frame_id: map",
        f"  ns: {namespace}\n  id: {number}\n  type: {kind}\n  action: {action}",
        f"  pose:\n    position:\n      x: {x}\n      y: {y}\n      z: {z}",
        "    orientation:\n      x: 0.0\n      y: 0.0\n      z: 0.0\n      w: 1.0",
        "  scale:\n    x: 0.1\n    y: 0.1\n    z: 0.1\n  points:" + ("" if points else " []"),
    ]
    lines += [f"  - x: {x}\n    y: {y}\n    z: {(*rest, 0.0)[0]}" for x, y, *rest in points]
    return "\n".join([*lines, "  colors: []\n  text: ''\n  mesh_use_embedded_materials: false"]) + "\n"


def message(*markers: str) -> str:
    return "markers:\n" + "".join(markers) + "---\n"


def slam_toolbox() -> str:
    """A square of four poses as slam_toolbox draws it: what was there is cleared, then spheres and one list of lines."""
    corners = [(0.0, 0.0), (2.5, 0.0), (2.5, 2.5), (0.0, 2.5)]
    spheres = [marker("slam_toolbox", number, SPHERE, at=corner) for number, corner in enumerate(corners)]
    ends = [corners[index] for pair in ((0, 1), (1, 2), (2, 3), (0, 3)) for index in pair]
    lines = [marker("slam_toolbox_edges", 0, LIST, ends), marker("slam_toolbox_edges", 1, LIST)]
    return message(marker("''", 0, 0, action=3), *spheres, *lines)


def cartographer() -> tuple[str, str]:
    """Three poses of a trajectory and two submaps; the residual of the last constraint leads from where it ends to its pose."""
    poses = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.1)]
    trajectory = message(marker("Trajectory 0", 0, STRIP, poses))
    submaps = [(0.5, 0.5), (1.5, 0.5)]
    intra = [submaps[0], poses[0], submaps[0], poses[1], submaps[1], poses[1], submaps[1], poses[2]]
    missed = (2.0, 0.3)
    constraints = message(
        marker("Intra constraints", 0, LIST, intra),
        marker("Intra residuals", 1, LIST, [poses[0], poses[0]], at=(0, 0, 0.1)),
        marker('"Inter constraints, same trajectory"', 2, LIST, [submaps[0], missed], at=(0, 0, 0.1)),
        marker('"Inter residuals, same trajectory"', 3, LIST, [missed, poses[2]], at=(0, 0, 0.1)),
    )
    return trajectory, constraints
