"""A planar world as its free region: polygons with holes, whatever the world was made from.

Boxes, polygons, an occupancy grid and a trajectory all become the same thing, the open set of places that are free.
Its boundary is everything that can be hit, so one exact distance (to the boundary) answers every question: the
clearance of a point, whether a disc may move along a segment, whether two points see each other. What lies beyond
the bounds is not free. Coordinates are metres in the world frame of the pose graph.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b

import numpy as np
from numpy.typing import ArrayLike
from shapely import MultiPolygon, Polygon, box

from topobelief.arrays import BoolArray, FloatArray, IntArray, frozen_floats
from topobelief.errors import InvalidInputError, InvalidMapError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world import shapes
from topobelief.world.cells import region_of_cells
from topobelief.world.space import checked_places, checked_radius
from topobelief.world.trajectory import region_of_trajectory

Extent = tuple[float, float, float, float]  # x_min, y_min, x_max, y_max

_EROSION_SLACK = 0.02  # of the radius: twice the error of an erosion


@dataclass(frozen=True, eq=False, init=False)
class World:
    """The places that are free, and answers to where a robot may move and what it can see among them.

    Parameters
    ----------
    free
        Polygon or multipolygon; the robot's centre may be anywhere in its interior.
    bounds : (x_min, y_min, x_max, y_max), optional
        What a map shows. Default: the extent of `free`.

    Raises
    ------
    InvalidMapError
        Where nothing is free, or `free` is not a valid region.

    Examples
    --------
    >>> room = World.from_boxes([(4, 4, 6, 6)], bounds=(0, 0, 10, 10))
    >>> room.clearance([(5, 2), (5, 5), (5, -1)]).tolist()
    [2.0, -1.0, -1.0]
    >>> room.visible([(1, 5), (1, 1)], [(9, 5), (9, 1)]).tolist()
    [False, True]
    """

    free: MultiPolygon
    bounds: Extent

    def __init__(self, free: shapes.Shape, bounds: Sequence[float] | FloatArray | None = None) -> None:
        if problem := shapes.problem(free):
            raise InvalidMapError(f"expected a valid free region, got {problem}")
        polygons = shapes.polygons(free)
        if not polygons:
            raise InvalidMapError("expected a world with free space, got none: everything is occupied or out of bounds")
        region = MultiPolygon(polygons)
        object.__setattr__(self, "free", region)
        object.__setattr__(self, "bounds", _checked_bounds(shapes.extent(region) if bounds is None else bounds))

    def __repr__(self) -> str:
        x_min, y_min, x_max, y_max = self.bounds
        return f"World({x_max - x_min:.1f} × {y_max - y_min:.1f} m, {self.free.area:.1f} m² free)"

    @classmethod
    def from_boxes(cls, boxes: ArrayLike, bounds: Sequence[float] | None = None) -> World:
        """A floor plan of axis-aligned walls, closed by a fence along its bounds.

        Parameters
        ----------
        boxes : shape (N, 4)
            x_min, y_min, x_max, y_max of each wall; they may touch, overlap and reach beyond the bounds.
        bounds : (x_min, y_min, x_max, y_max), optional
            Default: the extent of the boxes.

        Raises
        ------
        InvalidMapError
            Names the first box that is not finite or has no area.
        """
        array = frozen_floats(boxes, name="boxes")
        array = array.reshape(0, 4) if array.size == 0 else array
        if array.ndim != 2 or array.shape[1] != 4:
            raise InvalidMapError(f"expected boxes of shape (N, 4), x_min y_min x_max y_max, got {array.shape}")
        bad = np.flatnonzero(~(np.isfinite(array).all(axis=1) & (array[:, :2] < array[:, 2:]).all(axis=1)))
        if bad.size:
            raise InvalidMapError(
                f"expected boxes with finite x_min < x_max and y_min < y_max, got {_numbers(array[bad[0]])} at box {bad[0]}"
            )
        return cls._without(shapes.rectangles(array), bounds)

    @classmethod
    def from_polygons(cls, polygons: Sequence[ArrayLike | Polygon], bounds: Sequence[float] | None = None) -> World:
        """A floor plan of polygonal walls, closed by a fence along its bounds.

        Parameters
        ----------
        polygons
            Each a shapely polygon, or an array of shape (corners, 2), closed or not.
        bounds : (x_min, y_min, x_max, y_max), optional
            Default: the extent of the polygons.

        Raises
        ------
        InvalidMapError
            Names the first polygon that is not one.
        """
        walls = [_checked_polygon(polygon, index) for index, polygon in enumerate(polygons)]
        return cls._without(np.array(walls, dtype=object), bounds)

    @classmethod
    def _without(cls, walls: shapes.ShapeArray, bounds: Sequence[float] | None) -> World:
        if bounds is None and len(walls) == 0:
            raise InvalidMapError("expected bounds (x_min, y_min, x_max, y_max) for a world without walls, got none")
        extent = _checked_bounds(shapes.extent(walls) if bounds is None else bounds)
        return cls(shapes.difference(box(*extent), shapes.union(walls)), extent)

    @classmethod
    def from_cells(cls, free: ArrayLike, resolution: float, origin: Sequence[float] = (0.0, 0.0, 0.0)) -> World:
        """An occupancy grid, its cells taken as the squares they are.

        Parameters
        ----------
        free : shape (rows, columns), bool
            Row 0 is the lowest in y, column 0 the lowest in x (in the grid's own frame).
        resolution
            Side of a cell, metres.
        origin : (x, y, yaw)
            Pose of the lower left corner of cell (0, 0) in the world.

        Raises
        ------
        InvalidMapError
            Where the shape, resolution or origin is wrong, or no cell is free.
        """
        region = region_of_cells(free, resolution, origin)
        return cls(region.free, shapes.extent(region.grid))

    @classmethod
    def from_trajectory(cls, graph: PoseGraph, width: float | None = None) -> World:
        """For a pose graph without a map: free where the robot has been, within `width` of its odometry.

        Parameters
        ----------
        graph
            In SE(2), at its estimate. The robot has been at its poses and, where an edge joins two poses of consecutive
            index (odometry), on the segment between them. Edges between other poses (closures) say nothing of what lies
            between, and neither do two consecutive poses that no edge joins. A pose without odometry is free within a disc
            of its own; in a graph without any odometry all poses are, and the default width is refused.
        width
            Metres to each side. Default: twice the length of the odometry edge on which the robot covered its median metre.

        Raises
        ------
        InvalidInputError
            For a graph in SE(3), whose storeys a plane would join; for a width that is not positive; for the default width
            where no odometry edge has a length.
        """
        return cls(region_of_trajectory(graph, width))

    @property
    def dim(self) -> int:
        """2."""
        return 2

    @property
    def corners(self) -> FloatArray:
        """Opposite corners of the bounds, shape (2, 2)."""
        return np.reshape(self.bounds, (2, 2))

    @cached_property
    def digest(self) -> str:
        """32 hexadecimal digits, the same for worlds of the same free region and bounds."""
        return blake2b(self.free.wkb + np.array(self.bounds).tobytes(), digest_size=16).hexdigest()

    @cached_property
    def _region(self) -> shapes.Region:
        return shapes.Region(self.free)

    def contains(self, points: ArrayLike) -> BoolArray:
        """Whether each point is free, shape (N,); the boundary is not."""
        return self._region.contains(checked_places(points, "points", 2))

    def clearance(self, points: ArrayLike) -> FloatArray:
        """Distance to the nearest obstacle or bound, metres, shape (N,); negative in obstacles and out of bounds."""
        xy = checked_places(points, "points", 2)
        distances = self._region.boundary_distances(xy)
        return np.where(self._region.contains(xy), distances, -distances)

    def segments_free(self, starts: ArrayLike, ends: ArrayLike, radius: float) -> BoolArray:
        """Whether a disc may move along each segment: its centre stays more than `radius` from all that is not free.

        Parameters
        ----------
        starts, ends : shape (N, 2)
        radius
            Metres; 0 for a point.

        Returns
        -------
        shape (N,), bool
            Exact to rounding; a disc that touches is not free.
        """
        a, b = checked_places(starts, "starts", 2), checked_places(ends, "ends", 2)
        if a.shape != b.shape:
            raise InvalidInputError(f"expected as many ends as starts, got {len(b)} and {len(a)}")
        free = self._region.contains(a) & self._region.contains(b) & self._region.contains((a + b) / 2)  # quick
        free[free] = ~self._region.boundary_near(a[free], b[free], checked_radius(radius))  # and exact
        return free

    def visible(self, starts: ArrayLike, ends: ArrayLike) -> BoolArray:
        """Whether nothing stands on the line of sight from each start to its end, shape (N,)."""
        return self.segments_free(starts, ends, 0.0)

    def walls_in_boxes(self, lower: FloatArray, upper: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
        """Straight pieces of the boundary whose extent overlaps each of some boxes.

        Parameters
        ----------
        lower, upper : shape (N, 2)
            Opposite corners.

        Returns
        -------
        box : shape (M,); starts, ends : shape (M, 2)
            One row for each pair of a box and a piece.
        """
        return self._region.boundary_in_boxes(lower, upper)

    def component(self, point: ArrayLike, radius: float) -> Polygon:
        """All places that the centre of a disc can be moved to from a point, slightly too large.

        The region is eroded by 0.98 of the radius, so whatever the component leaves out cannot be reached.
        Its holes are the obstacles that can be passed on both sides; walls that the disc cannot pass
        between are one hole, and those joined to the outside are none.

        Parameters
        ----------
        point : shape (2,)
            A place with more clearance than the radius.
        """
        place = checked_places(np.reshape(point, (1, -1)), "point", 2)[0]
        free = shapes.eroded(self.free, (1 - _EROSION_SLACK) * checked_radius(radius))
        component = shapes.nearest_part(free, place)
        if component is None:
            raise InvalidMapError(f"expected room for a disc of radius {radius:g} m, got none in the whole world")
        return component


def _checked_bounds(bounds: Sequence[float] | FloatArray) -> Extent:
    array = frozen_floats(bounds, name="bounds")
    if array.shape != (4,) or not np.isfinite(array).all() or not (array[:2] < array[2:]).all():
        raise InvalidMapError(f"expected bounds (x_min, y_min, x_max, y_max) with min < max, got {_numbers(array)}")
    x_min, y_min, x_max, y_max = array.tolist()
    return x_min, y_min, x_max, y_max


def _checked_polygon(polygon: ArrayLike | Polygon, index: int) -> Polygon:
    if not isinstance(polygon, Polygon):
        corners = frozen_floats(polygon, name=f"polygon {index}")
        if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3 or not np.isfinite(corners).all():
            raise InvalidMapError(
                f"expected at least 3 finite corners of shape (corners, 2), got {corners.shape} at polygon {index}"
            )
        polygon = Polygon(corners)
    if problem := shapes.problem(polygon) or ("no area" if polygon.area == 0 else ""):
        raise InvalidMapError(f"expected a polygon that does not cross itself, got {problem} at polygon {index}")
    return polygon


def _numbers(values: FloatArray) -> str:
    return "(" + ", ".join(f"{value:g}" for value in values.ravel().tolist()) + ")"
