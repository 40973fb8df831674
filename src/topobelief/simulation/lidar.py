"""A planar lidar, by casting its beams onto the walls of the world.

A beam in direction u meets the wall from a to b, both relative to the lidar, at the range t = (a x e) / (u x e), e = b - a.
Only walls that face the lidar can be seen, and each of them only by the beams between its two ends, which regular beams let
one look up: of B beams and W walls few of the B W pairs are left. Walls that share a corner round its direction alike, so
no beam slips through between them. Against the ray casting of MuJoCo this is exact on polygons and several times faster.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from topobelief.arrays import BoolArray, FloatArray
from topobelief.errors import InvalidInputError, require_positive
from topobelief.simulation.scan import Scan
from topobelief.simulation.walls import wall_segments
from topobelief.world import World


@dataclass(frozen=True, slots=True, kw_only=True)
class LidarSettings:
    """A lidar with a view of 360 degrees, whose revolutions take no time.

    Parameters
    ----------
    num_beams
        Evenly around, the first straight back, counter-clockwise.
    rate
        Revolutions per second, Hz.
    max_range
        Metres; beyond it a range is inf.
    range_noise
        Standard deviation of a range, metres.
    dead_sector : (from, to), optional
        Directions in the base frame, radians, counter-clockwise from the first to the second, in which all ranges are nan.
    nan_share
        Probability of a beam to give no answer (nan), drawn afresh for each.
    """

    num_beams: int = 360
    rate: float = 10.0
    max_range: float = 10.0
    range_noise: float = 0.01
    dead_sector: tuple[float, float] | None = None
    nan_share: float = 0.0

    def __post_init__(self) -> None:
        if self.num_beams < 4:
            raise InvalidInputError(f"expected num_beams of at least 4, got {self.num_beams}")
        require_positive("a lidar rate", self.rate)
        require_positive("a lidar max_range", self.max_range)
        if not (math.isfinite(self.range_noise) and self.range_noise >= 0):
            raise InvalidInputError(f"expected range_noise of at least 0 m, got {self.range_noise}")
        if not 0 <= self.nan_share <= 1:
            raise InvalidInputError(f"expected nan_share from 0 to 1, got {self.nan_share}")
        if self.dead_sector is not None and not all(map(math.isfinite, self.dead_sector)):
            raise InvalidInputError(f"expected a dead_sector of two finite angles, got {self.dead_sector}")


class Lidar:
    """Casts the beams; holds the walls and no state.

    Parameters
    ----------
    world
        Its boundary is what beams meet.
    settings
    """

    def __init__(self, world: World, settings: LidarSettings) -> None:
        self.settings = settings
        self._starts, self._ends = wall_segments(world)
        self._pitch = 2 * math.pi / settings.num_beams
        self._angles = -math.pi + self._pitch * np.arange(settings.num_beams, dtype=np.float64)
        self._dead = _in_sector(self._angles, settings.dead_sector)

    def ranges(self, pose: FloatArray) -> FloatArray:
        """Exact range of each beam from a pose (x, y, theta), metres, shape (B,); inf beyond `max_range`."""
        num_beams = self.settings.num_beams
        a, b = self._starts - pose[:2], self._ends - pose[:2]
        areas = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]  # free space lies to the left: a wall that faces us runs left
        a, b, areas = a[areas > 0], b[areas > 0], areas[areas > 0]
        first, last = self._beam_coordinate(a, pose), self._beam_coordinate(b, pose)
        last = np.where(last < first, last + num_beams, last)
        lowest = np.ceil(first).astype(np.int64)
        counts = np.maximum(np.floor(last).astype(np.int64) - lowest + 1, 0)
        walls = np.repeat(np.arange(len(a)), counts)
        beams = np.arange(len(walls)) + np.repeat(lowest - (np.cumsum(counts) - counts), counts)
        angles = -math.pi + self._pitch * beams + pose[2]
        edges = (b - a)[walls]
        ranges = np.full(num_beams, np.inf)
        towards = np.cos(angles) * edges[:, 1] - np.sin(angles) * edges[:, 0]
        met = np.full(len(walls), np.inf)  # by beams along a wall
        np.divide(areas[walls], towards, out=met, where=towards > 0)  # a x e = a x b
        np.minimum.at(ranges, beams % num_beams, met)
        return np.where(ranges <= self.settings.max_range, ranges, np.inf)

    def scan(self, pose: FloatArray, time: float, *, rng: np.random.Generator) -> Scan:
        """A measured revolution from a pose (x, y, theta).

        Parameters
        ----------
        pose : shape (3,)
            Where the robot truly is.
        time
            Stamp of the scan, seconds.
        rng
            Gives as many numbers each time, whatever is seen.
        """
        settings = self.settings
        noise = settings.range_noise * rng.standard_normal(settings.num_beams)
        silent = rng.random(settings.num_beams) < settings.nan_share
        ranges = np.maximum(self.ranges(pose) + noise, 0.0)
        ranges = np.where(ranges <= settings.max_range, ranges, np.inf)
        ranges[silent | self._dead] = np.nan
        return Scan(ranges, self._angles, time, settings.max_range)

    def _beam_coordinate(self, points: FloatArray, pose: FloatArray) -> FloatArray:
        """Direction of each point, shape (N, 2), in beams after the first, in [0, num_beams)."""
        directions = np.arctan2(points[:, 1], points[:, 0])
        return (directions - pose[2] + math.pi) / self._pitch % self.settings.num_beams


def _in_sector(angles: FloatArray, sector: tuple[float, float] | None) -> BoolArray:
    if sector is None:
        return np.zeros(len(angles), dtype=np.bool_)
    begin, end = sector
    width = end - begin if 0 <= end - begin <= 2 * math.pi else (end - begin) % (2 * math.pi)
    return (angles - begin) % (2 * math.pi) <= width
