"""What the scans have seen, as an occupancy grid in log-odds.

Each scan sees the region up to what its beams met: a star around the lidar, halfway between two beams as long as the shorter
one. Its cells count as free once, the cells that beams met count as occupied once; beams without an answer see nothing.
Counts become log-odds by the inverse sensor model (Thrun, Burgard and Fox, "Probabilistic Robotics", section 9.2). Counts can
also be taken back, so a map follows the estimate: only scans whose poses moved are drawn again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.errors import InvalidInputError, require_choice, require_positive
from topobelief.geometry.se2 import wrap_angle
from topobelief.io.files import StrPath
from topobelief.io.ros_map import write_ros_map
from topobelief.simulation.scan import Scan
from topobelief.world.world import Extent, World

UnknownSpace = Literal["optimistic", "closed"]

_HIT, _MISS = math.log(0.9 / 0.1), math.log(0.19 / 0.81)  # log-odds of one scan's evidence
_LIMIT = 5.0  # of log-odds, so that a map can change its mind
_OCCUPIED, _FREE = math.log(0.65 / 0.35), math.log(0.196 / 0.804)  # the thresholds of ROS
Counts = NDArray[np.int16]

_MOVED = 0.2  # cells that a pose, or what its scan sees furthest, moves before it is drawn again


@dataclass(frozen=True, eq=False)
class OccupancyMap:
    """A grid of cells, row 0 the lowest in y.

    Attributes
    ----------
    hits, misses : shape (rows, columns)
        Scans that met something in a cell, and that saw through it.
    poses : shape (n, 3)
        At which the scans are drawn.
    origin : (x, y)
        Lower left corner of cell (0, 0), metres.
    resolution
        Side of a cell, metres.
    """

    hits: Counts
    misses: Counts
    poses: FloatArray
    origin: tuple[float, float]
    resolution: float

    @classmethod
    def from_scans(
        cls,
        poses: FloatArray,
        scans: Sequence[Scan],
        *,
        resolution: float = 0.05,
        bounds: Extent,
        previous: OccupancyMap | None = None,
    ) -> OccupancyMap:
        """The map by scans made at poses.

        Parameters
        ----------
        poses : shape (n, 3)
        scans
            One a pose.
        resolution
            Metres.
        bounds : (x_min, y_min, x_max, y_max)
            What the map shows; scans may see further.
        previous
            A map of the same resolution and bounds by the first of these scans. Those whose poses moved by less than a fifth
            of a cell are taken over from it.

        Raises
        ------
        InvalidInputError
            Where there are not as many scans as poses, the resolution is not positive, or `previous` has another grid or more
            scans.
        """
        poses = np.array(poses, dtype=np.float64).reshape(-1, 3)
        if len(poses) != len(scans):
            raise InvalidInputError(f"expected a scan for each of {len(poses)} poses, got {len(scans)}")
        require_positive("a resolution", resolution, unit="m")
        x_min, y_min, x_max, y_max = bounds
        shape = (math.ceil((y_max - y_min) / resolution - 1e-9), math.ceil((x_max - x_min) / resolution - 1e-9))
        if previous is None:
            drawn, hits, misses = poses[:0], np.zeros(shape, dtype=np.int16), np.zeros(shape, dtype=np.int16)
        else:
            if (previous.hits.shape, previous.origin, previous.resolution) != (shape, (x_min, y_min), resolution):
                raise InvalidInputError("expected a previous map of the same grid, got another one; leave it out")
            if len(previous.poses) > len(poses):
                raise InvalidInputError(f"expected a previous map of at most {len(poses)} scans, got {len(previous.poses)}")
            drawn, hits, misses = previous.poses, previous.hits.copy(), previous.misses.copy()
        kept = _unmoved(drawn, poses[: len(drawn)], scans, _MOVED * resolution)
        for index, scan in enumerate(scans):
            if index < len(drawn):
                if kept[index]:
                    poses[index] = drawn[index]
                    continue
                _count(hits, misses, drawn[index], scan, (x_min, y_min), resolution, take_back=True)
            _count(hits, misses, poses[index], scan, (x_min, y_min), resolution)
        return cls(hits=hits, misses=misses, poses=poses, origin=(x_min, y_min), resolution=resolution)

    @cached_property
    def log_odds(self) -> FloatArray:
        """Of being occupied, shape (rows, columns); 0 where no beam has been."""
        return np.clip(_HIT * self.hits + _MISS * self.misses, -_LIMIT, _LIMIT)

    @property
    def probability(self) -> FloatArray:
        """Of being occupied, shape (rows, columns); 0.5 where no beam has been."""
        return 1 / (1 + np.exp(-self.log_odds))

    @cached_property
    def occupied(self) -> BoolArray:
        """Cells that are known to be, shape (rows, columns)."""
        return self.log_odds > _OCCUPIED

    @cached_property
    def free(self) -> BoolArray:
        """Cells that are known to be, shape (rows, columns)."""
        return self.log_odds < _FREE

    def to_world(self, *, unknown: UnknownSpace = "optimistic") -> World:
        """The world to plan in.

        Parameters
        ----------
        unknown
            "optimistic": free is what is not known to be occupied. "closed": what is known to be free.

        Raises
        ------
        InvalidMapError
            Where nothing is free.
        """
        require_choice("unknown", unknown, ("optimistic", "closed"))
        cells = ~self.occupied if unknown == "optimistic" else self.free
        return World.from_cells(cells, self.resolution, (*self.origin, 0.0))

    def line_of_sight(self, starts: FloatArray, end: FloatArray) -> BoolArray:
        """Whether no occupied cell lies between each start and the end; cells beyond the map are not occupied.

        Parameters
        ----------
        starts : shape (k, 2)
        end : shape (2,)

        Returns
        -------
        shape (k,), bool
        """
        starts = np.asarray(starts, dtype=np.float64).reshape(-1, 2)
        if not len(starts):
            return np.ones(0, dtype=np.bool_)
        longest = float(np.linalg.norm(end - starts, axis=1).max())
        steps = np.linspace(0.0, 1.0, max(2, math.ceil(2 * longest / self.resolution) + 1))
        places = starts[:, None] + steps[:, None] * (end - starts)[:, None]
        column, row = _cells(places.reshape(-1, 2), self.origin, self.resolution)
        inside = _inside(row, column, self.hits.shape)
        blocked = np.zeros(row.shape, dtype=np.bool_)
        blocked[inside] = self.occupied[row[inside], column[inside]]
        return np.logical_not(blocked.reshape(len(starts), -1).any(axis=1))

    def write(self, path: StrPath) -> None:
        """Write the map for ROS map_server: a YAML file, and its image beside it.

        Raises
        ------
        FileError
            Where a file cannot be written.
        """
        occupancy = np.where(self.occupied, 100, np.where(self.free, 0, -1))
        write_ros_map(path, occupancy, resolution=self.resolution, origin=(*self.origin, 0.0))


def _unmoved(before: FloatArray, now: FloatArray, scans: Sequence[Scan], tolerance: float) -> BoolArray:
    """Whether all that each scan sees stays within a tolerance, metres, shape (len(before),)."""
    reach = np.array([scan.max_range for scan in scans[: len(before)]])
    moved = np.linalg.norm(now[:, :2] - before[:, :2], axis=1) + reach * np.abs(wrap_angle(now[:, 2] - before[:, 2]))
    return moved < tolerance


def _count(
    hits: Counts,
    misses: Counts,
    pose: FloatArray,
    scan: Scan,
    origin: tuple[float, float],
    resolution: float,
    *,
    take_back: bool = False,
) -> None:
    """Add one scan to the counts, or take it back: each cell once, and as occupied where it is both."""
    corners = _star(scan)
    if not len(corners):
        return
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    R_world_base = np.array([[cosine, -sine], [sine, cosine]])
    pixels = ((corners @ R_world_base.T + pose[:2]) - origin) / resolution - 0.5  # cell centres are whole numbers
    low = np.maximum(np.floor(pixels.min(axis=0)).astype(np.int64) - 1, 0)
    high = np.minimum(np.ceil(pixels.max(axis=0)).astype(np.int64) + 2, hits.shape[::-1])
    if (high <= low).any():
        return
    image = Image.new("L", tuple((high - low).tolist()))
    ImageDraw.Draw(image).polygon((pixels - low).ravel().tolist(), fill=1, outline=0)  # its edge may be a wall
    free = np.array(image)
    column, row = _cells(scan.points @ R_world_base.T + pose[:2], origin, resolution)
    row, column = row - low[1], column - low[0]
    inside = _inside(row, column, free.shape)
    row, column = row[inside], column[inside]
    window = slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))
    met = np.zeros_like(free)
    met[row, column] = 1
    free[row, column] = 0
    combine = np.subtract if take_back else np.add
    combine(misses[window], free, out=misses[window], casting="unsafe")
    combine(hits[window], met, out=hits[window], casting="unsafe")


def _star(scan: Scan) -> FloatArray:
    """Corners of the region that a scan sees, base frame, shape (2 B, 2); none where no beam answers."""
    reach = np.where(np.isinf(scan.ranges), scan.max_range, np.nan_to_num(scan.ranges, nan=0.0, posinf=scan.max_range))
    if not reach.any():
        return np.zeros((0, 2))
    gap = (np.roll(scan.angles, -1) - scan.angles) % (2 * math.pi)
    angles = np.stack([scan.angles, scan.angles + gap / 2], axis=1).ravel()
    reach = np.stack([reach, np.minimum(reach, np.roll(reach, -1))], axis=1).ravel()
    return reach[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _cells(places: FloatArray, origin: tuple[float, float], resolution: float) -> tuple[IntArray, IntArray]:
    """Column and row of each place, shape (k,)."""
    column, row = np.floor((places - origin) / resolution).astype(np.int64).T
    return column, row


def _inside(row: IntArray, column: IntArray, shape: tuple[int, ...]) -> BoolArray:
    return (row >= 0) & (row < shape[0]) & (column >= 0) & (column < shape[1])
