"""Free space of cubes: an occupancy grid in space, taken as the cubes it is; what lies outside of the grid is not free.

Distances are exact. A distance field between the centres of cubes (scipy's Euclidean distance transform) tells each of them to
within a cube's diagonal, which answers most questions at once; where it does not, the cubes nearby are measured one by one.
Lines of sight are cut at every face between cubes.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, cast

import numpy as np
from scipy import ndimage
from scipy.spatial import KDTree

from topobelief.arrays import BoolArray, FloatArray, IntArray, frozen_floats
from topobelief.errors import InvalidMapError
from topobelief.world.parts import Parts, pairs_of_lists, wholly_covered

MOST_CELLS = 30_000_000

_AT_ONCE = 20_000  # ways that are held in memory together
_BISECTIONS = 50
_ROUNDING = 1e-9  # of a cube
_FIELD_ERROR = 1e-3  # of a cube, of the distance field in single precision
_DIAGONAL = math.sqrt(3.0)  # of a cube of side 1
_NEAREST_TRIED = 512  # cubes with room, tried for the nearest free place
_ndimage = cast("Any", ndimage)


class Voxels:
    """A grid of cubes that are free or not.

    Parameters
    ----------
    free : shape (nx, ny, nz), bool
    resolution
        Side of a cube, metres.
    origin : (x, y, z)
        Lowest corner of cube (0, 0, 0).

    Raises
    ------
    InvalidMapError
        Where shape, resolution or origin is wrong, no cube is free, or there are too many of them.
    """

    def __init__(self, free: BoolArray, resolution: float, origin: FloatArray) -> None:
        if free.ndim != 3 or free.size == 0 or free.dtype != np.bool_:
            raise InvalidMapError(f"expected boolean cells of shape (nx, ny, nz), got {free.dtype} of {free.shape}")
        if free.size > MOST_CELLS:
            raise InvalidMapError(f"expected at most {MOST_CELLS} cells, got {free.size}; choose a larger resolution")
        if not (np.isfinite(resolution) and resolution > 0):
            raise InvalidMapError(f"expected a resolution above 0 m, got {resolution}")
        corner = frozen_floats(origin, name="origin")
        if corner.shape != (3,) or not np.isfinite(corner).all():
            raise InvalidMapError(f"expected a finite origin (x, y, z), got {corner.tolist()}")
        if not free.any():
            raise InvalidMapError("expected free cells in the grid, got none")
        self.free = np.pad(free, 1)  # a layer around it that is not free
        self.resolution = float(resolution)
        self._corner = corner - resolution  # of the layer

    @property
    def corners(self) -> FloatArray:
        """Opposite corners of the grid, shape (2, 3)."""
        low = self._corner + self.resolution
        return np.stack([low, low + self.resolution * (np.array(self.free.shape) - 2)])

    @cached_property
    def field(self) -> FloatArray:
        """Distance from the centre of each cube, also of the layer around them, to that of the nearest which is not free."""
        return _ndimage.distance_transform_edt(self.free, sampling=self.resolution).astype(np.float32)

    @cached_property
    def walls(self) -> FloatArray:
        """Centres of the cubes that are not free and have a free neighbour, shape (M, 3)."""
        return self._centres(np.argwhere(_beside(self.free) & ~self.free))

    @cached_property
    def _near_walls(self) -> Any:
        return KDTree(self.walls)

    @cached_property
    def _rims(self) -> FloatArray:
        """Centres of the free cubes that have a neighbour which is not."""
        return self._centres(np.argwhere(_beside(~self.free) & self.free))

    @cached_property
    def _near_rims(self) -> Any:
        return KDTree(self._rims)

    def _centres(self, cells: IntArray) -> FloatArray:
        return self._corner + self.resolution * (cells + 0.5)

    def _cells(self, places: FloatArray) -> IntArray:
        """The cube that each place is in; those outside of the grid are in the layer around it."""
        cells = np.floor((places - self._corner) / self.resolution)
        return np.clip(cells, 0, np.array(self.free.shape) - 1).astype(np.int64)

    def contains(self, points: FloatArray) -> BoolArray:
        """Whether each point is free, shape (N,)."""
        return self.free[tuple(self._cells(points).T)]

    def clearance(self, points: FloatArray) -> FloatArray:
        """Distance to the nearest cube that is not free; to the nearest free one, negative, where a point is in none."""
        inside = self.contains(points)
        result = np.empty(len(points))
        result[inside] = self._to_cubes(points[inside], self._near_walls, self.walls)
        result[~inside] = -self._to_cubes(points[~inside], self._near_rims, self._rims)
        return result

    def _to_cubes(self, places: FloatArray, tree: Any, centres: FloatArray) -> FloatArray:
        """Distance from each place to the nearest of some cubes.

        That one's centre is no further than that of the cube whose centre is nearest and half a diagonal.
        """
        result = np.full(len(places), np.inf)
        for first in range(0, len(places), _AT_ONCE):
            part = places[first : first + _AT_ONCE]
            nearest, _ = tree.query(part)
            reach = nearest + (_DIAGONAL / 2 + _ROUNDING) * self.resolution
            which, cube = pairs_of_lists(tree.query_ball_point(part, reach))
            outside = np.maximum(np.abs(part[which] - centres[cube]) - self.resolution / 2, 0.0)
            np.minimum.at(result, which + first, np.linalg.norm(outside, axis=1))
        return result

    def segments_free(self, starts: FloatArray, ends: FloatArray, radius: float) -> BoolArray:
        """Whether a ball may move along each straight way, shapes (N, 3), without touching a cube that is not free."""
        free = [np.zeros(0, dtype=bool)]
        for first in range(0, len(starts), _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            ways = starts[part], ends[part]
            free.append(self._unblocked(*ways, radius) if radius else wholly_covered(self._parts(*ways), len(ways[0])))
        return np.concatenate(free)

    def _unblocked(self, starts: FloatArray, ends: FloatArray, radius: float) -> BoolArray:
        """Pieces of each way, up to a cube long, are judged by the distance field, and those that it leaves open one by one."""
        h = self.resolution
        pieces = np.maximum(np.ceil(np.linalg.norm(ends - starts, axis=1) / h), 1).astype(np.int64)
        way = np.repeat(np.arange(len(starts)), pieces)
        piece = np.arange(len(way)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        along = (ends - starts)[way] / pieces[way, None]
        begin = starts[way] + piece[:, None] * along
        middle, half = begin + along / 2, np.linalg.norm(along, axis=1) / 2
        apart = self.field[tuple(self._cells(middle).T)]
        tight = ~self.contains(begin) | (apart + _DIAGONAL / 2 * h <= radius)  # from anywhere in the cube to a centre, and more
        result = np.ones(len(starts), dtype=bool)
        result[way[tight]] = False
        open_ = np.flatnonzero(result[way] & (apart - (_DIAGONAL + _FIELD_ERROR) * h - half <= radius))
        lists = self._near_walls.query_ball_point(middle[open_], half[open_] + radius + (_DIAGONAL / 2 + _ROUNDING) * h)
        which, cube = pairs_of_lists(lists)
        nearest = _to_cube(begin[open_][which] - self.walls[cube], along[open_][which], h / 2)
        result[way[open_[which[nearest <= radius + _ROUNDING * h]]]] = False
        return result

    def free_parts(self, starts: FloatArray, ends: FloatArray) -> Parts:
        """Parts of straight ways in free cubes, one for each cube."""
        found: list[Parts] = []
        for first in range(0, max(len(starts), 1), _AT_ONCE):
            parts = self._parts(starts[first : first + _AT_ONCE], ends[first : first + _AT_ONCE])
            found.append(Parts(parts.which + first, parts.lower, parts.upper))
        return Parts(*(np.concatenate(columns) for columns in zip(*found, strict=True)))

    def _parts(self, starts: FloatArray, ends: FloatArray) -> Parts:
        """Ways are cut where they cross the faces of cubes; between two cuts each is in the cube of the middle."""
        a, along = (starts - self._corner) / self.resolution, (ends - starts) / self.resolution
        ways = np.arange(len(starts))
        which, shares = [ways, ways], [np.zeros(len(ways)), np.ones(len(ways))]
        shape = np.array(self.free.shape, dtype=np.float64)
        for axis in range(3):
            low, high = np.sort(np.clip(np.stack([a[:, axis], a[:, axis] + along[:, axis]]), 0.0, shape[axis]), axis=0)
            first = np.ceil(low).astype(np.int64)
            count = np.maximum(np.floor(high).astype(np.int64) - first + 1, 0)
            count[along[:, axis] == 0] = 0
            way = np.repeat(ways, count)
            face = first[way] + np.arange(len(way)) - np.repeat(np.cumsum(count) - count, count)
            which.append(way)
            shares.append(np.clip((face - a[way, axis]) / along[way, axis], 0.0, 1.0))
        way, share = np.concatenate(which), np.concatenate(shares)
        order = np.lexsort([share, way])
        way, share = way[order], share[order]
        same = np.flatnonzero((way[1:] == way[:-1]) & ((share[1:] > share[:-1]) | (share[1:] == 1.0)))
        middle = (share[same] + share[same + 1]) / 2
        free = self.contains(starts[way[same]] + middle[:, None] * (ends - starts)[way[same]])
        kept = same[free]
        return Parts(way[kept], share[kept], share[kept + 1])

    def nearest_free_place(self, place: FloatArray, radius: float) -> FloatArray | None:
        """The centre of a cube with more room than a radius that is about nearest; None where none has."""
        cells = np.argwhere(self.field > radius + self.resolution / 2)  # nearer than that to a centre is too near for certain
        centres = self._centres(cells)
        near = np.argsort(np.linalg.norm(centres - place, axis=1), kind="stable")[:_NEAREST_TRIED]
        room = np.flatnonzero(self.clearance(centres[near]) > radius)
        return centres[near[room[0]]] if room.size else None

    def drawn(self, count: int, radius: float, centre: FloatArray, reach: float, *, rng: np.random.Generator) -> FloatArray:
        """Random places within `reach` of a centre along each axis, in cubes that have about as much room as a radius."""
        low, high = self._cells(np.stack([centre - reach, centre + reach]))
        part = self.field[low[0] : high[0] + 1, low[1] : high[1] + 1, low[2] : high[2] + 1]
        cells = np.flatnonzero(part > radius)
        if cells.size == 0:
            return np.zeros((0, 3))
        chosen = np.stack(np.unravel_index(rng.choice(cells, size=count), part.shape), axis=1) + low
        return self._corner + self.resolution * (chosen + rng.uniform(size=(count, 3)))

    def backbone(self, radius: float) -> tuple[FloatArray, IntArray]:
        """No places that a roadmap should have: none is known to be on a way."""
        return np.zeros((0, 3)), np.zeros((0, 2), dtype=np.int64)


def _beside(cells: BoolArray) -> BoolArray:
    """Which cells have one of these among their 26 neighbours, or are one."""
    return _ndimage.binary_dilation(cells, structure=np.ones((3, 3, 3), dtype=bool))


def _to_cube(offset: FloatArray, along: FloatArray, half: float) -> FloatArray:
    """Least distance from segments, offset + t along with t from 0 to 1, to a cube around the origin; shapes (N, 3), (N,).

    The squared distance is convex along a way: bisection finds where its slope changes sign.
    """
    low, high = np.zeros(len(offset)), np.ones(len(offset))
    for _ in range(_BISECTIONS):
        t = (low + high) / 2
        place = offset + t[:, None] * along
        beyond = place - np.clip(place, -half, half)
        falls = np.sum(beyond * along, axis=1) < 0
        low, high = np.where(falls, t, low), np.where(falls, high, t)
    place = offset + ((low + high) / 2)[:, None] * along
    return np.linalg.norm(place - np.clip(place, -half, half), axis=1)
