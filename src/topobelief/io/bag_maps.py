"""Maps out of bags: the last nav_msgs/OccupancyGrid of a topic.

A cell is occupied from 65 % on, free up to 25 %, and unknown between the two and at -1: the defaults of Nav2's map_saver.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from topobelief.errors import FileError, InvalidMapError
from topobelief.geometry.planar import headings_of_quaternions
from topobelief.io.bags import GRID, read_topics
from topobelief.io.filed_path import normalised
from topobelief.io.files import StrPath
from topobelief.io.ros_map import LARGEST_RESOLUTION, MAX_CELLS_AWAY, MAX_PIXELS, SMALLEST_RESOLUTION, Unknown
from topobelief.world import World

_TOPIC_OPTION = "--map-topic NAME, or of `topobelief convert` --topic NAME (in Python topic='NAME')"
_OCCUPIED, _FREE = 65, 25  # percent
_TILT = 1e-3  # of a quaternion, that a level map may have


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """Cells, 0 free, 100 occupied, -1 unknown, row 0 the lowest in y; their side, metres; the pose of the lower left corner."""

    cells: NDArray[np.int8]
    resolution: float
    origin: tuple[float, float, float]


def read_bag_grid(path: StrPath, *, topic: str | None = None) -> OccupancyGrid:
    """The last occupancy grid of a topic.

    Parameters
    ----------
    path
        A bag: a file or a folder.
    topic
        None: the only one with occupancy grids.

    Raises
    ------
    InvalidInputError
        If rosbags is not installed.
    FileError
        If the bag is damaged, has no occupancy grid, or has several topics with some and none is named; if the grid is
        malformed.
    """
    wanted = [] if topic is None else [topic]
    recording = read_topics(path, (GRID,), wanted, option=_TOPIC_OPTION)[0]
    return grid_of_message(path, recording.messages[-1], where=f"the last message of {recording.topic!r}")


def read_bag_map(path: StrPath, *, unknown: Unknown = "occupied", topic: str | None = None) -> World:
    """The world of the last occupancy grid of a topic, as `read_bag_grid` reads it.

    Raises
    ------
    FileError
        As `read_bag_grid` does, and where nothing is free.
    """
    return world_of_grid(path, read_bag_grid(path, topic=topic), unknown=unknown)


def world_of_grid(path: StrPath, grid: OccupancyGrid, *, unknown: Unknown = "occupied") -> World:
    """The world of an occupancy grid.

    Raises
    ------
    FileError
        Where nothing is free.
    """
    free = (grid.cells == 0) | ((grid.cells == -1) & (unknown == "free"))
    try:
        return World.from_cells(free, grid.resolution, grid.origin)
    except InvalidMapError as error:
        raise FileError(path, str(error)) from None


def grid_of_message(path: StrPath, message: Any, *, where: str) -> OccupancyGrid:
    """The grid of a nav_msgs/OccupancyGrid.

    Raises
    ------
    FileError
        Where it is malformed.
    """
    info = message.info
    rows, columns, resolution = info.height, info.width, float(f"{info.resolution:.7g}")  # of 32 bits
    values = np.asarray(message.data)
    if rows * columns != len(values) or len(values) == 0:
        raise FileError(path, f"expected {rows} x {columns} cells in {where}, got {len(values)}")
    if len(values) > MAX_PIXELS:
        raise FileError(
            path, f"expected at most {MAX_PIXELS / 1e6:g} million cells in {where}, got {len(values) / 1e6:.0f} million"
        )
    if not SMALLEST_RESOLUTION <= resolution <= LARGEST_RESOLUTION:
        expected = f"{SMALLEST_RESOLUTION:g} to {LARGEST_RESOLUTION:g} metres a cell"
        raise FileError(path, f"expected a resolution of {expected} in {where}, got {resolution:g}")
    corner, turned = info.origin.position, info.origin.orientation
    unit, bad, problem = normalised(np.array([[turned.x, turned.y, turned.z, turned.w]]))
    if bad is not None:
        raise FileError(path, f"{problem}, as the origin's in {where}")
    if np.abs(unit[0, :2]).max() > _TILT:
        raise FileError(path, f"expected a level map in {where}, got a tilted one")
    if not max(abs(corner.x), abs(corner.y)) <= MAX_CELLS_AWAY * resolution:
        raise FileError(path, f"expected an origin within {MAX_CELLS_AWAY:g} cells of (0, 0) in {where}, got another")
    cells = np.full(len(values), -1, dtype=np.int8)
    cells[values >= _OCCUPIED], cells[(values >= 0) & (values <= _FREE)] = 100, 0
    yaw = float(headings_of_quaternions(unit)[0])
    return OccupancyGrid(cells.reshape(rows, columns), resolution, (float(corner.x), float(corner.y), yaw))
