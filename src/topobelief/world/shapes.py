"""Planar shapes: shapely behind functions of coordinate arrays, with types that can be checked.

Predicates are exact to rounding; shapes with round parts have chords in place of arcs.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import Any, cast

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Point, Polygon

from topobelief.arrays import BoolArray, FloatArray, IntArray, read_only

Shape = shapely.Geometry
ShapeArray = NDArray[Any]  # of shapely geometries, dtype object

_QUADRANT_CHORDS = 8  # chords for a quarter circle, off it by 0.5 % of the radius
_SEGMENTS_PER_PIECE = 16

_shapely = cast("Any", shapely)  # whose stubs cannot say that arrays in are arrays out


def rectangles(corners: FloatArray) -> ShapeArray:
    """Rectangles from rows x_min, y_min, x_max, y_max; shape (N, 4)."""
    return _shapely.box(*corners.T)


def point(place: FloatArray) -> Point:
    """One place, shape (2,)."""
    return Point(*place.tolist())


def segments(starts: FloatArray, ends: FloatArray) -> ShapeArray:
    """Straight segments; shapes (N, 2). One of no length is a point: GEOS finds nothing near a line of no length."""
    lines = _shapely.linestrings(np.stack([starts, ends], axis=1))
    no_length = (starts == ends).all(axis=1)
    lines[no_length] = _shapely.points(starts[no_length])
    return lines


def discs(centres: FloatArray, radius: float) -> ShapeArray:
    """Discs; centres of shape (N, 2)."""
    return _shapely.buffer(_shapely.points(centres), radius, quad_segs=_QUADRANT_CHORDS)


def capsules(starts: FloatArray, ends: FloatArray, radius: float) -> ShapeArray:
    """All within a radius of each segment; shapes (N, 2)."""
    return _shapely.buffer(segments(starts, ends), radius, quad_segs=_QUADRANT_CHORDS)


def faces(starts: FloatArray, ends: FloatArray) -> ShapeArray:
    """The bounded faces into which segments that meet at their ends only divide the plane; shapes (N, 2)."""
    return _shapely.get_parts(_shapely.polygonize(segments(starts, ends)))


def together(shapes: ShapeArray) -> MultiPolygon:
    """Polygons that do not overlap, as one shape."""
    return MultiPolygon(shapes.tolist())


def union(shapes: ShapeArray) -> Shape:
    """The union of the shapes."""
    return _shapely.union_all(shapes)


def difference(shape: Shape, without: Shape) -> Shape:
    """A shape without the part that another one covers."""
    return _shapely.difference(shape, without)


def eroded(shape: Shape, distance: float, *, quadrant_chords: int = _QUADRANT_CHORDS) -> Shape:
    """The places of a shape further than a distance from its boundary, with an error of up to 0.01 of the distance.

    With more chords in place of a quarter circle the error falls with their square.

    Short pieces of the boundary are widened one by one and taken away together: on the staircases of an occupancy grid
    this is many times faster than to offset the polygon as a whole.
    """
    if not distance:
        return shape
    widened = _shapely.buffer(_boundary_pieces(shape), distance, quad_segs=quadrant_chords)
    return _shapely.difference(shape, _shapely.union_all(widened))


def _boundary_pieces(shape: Shape) -> ShapeArray:
    """The boundary of a shape, cut into polylines of a few segments."""
    corners, first, ring = _boundary_segments(shape)
    starts_ring = np.r_[True, np.diff(ring) != 0]
    since_ring_start = np.arange(len(first)) - np.flatnonzero(starts_ring)[np.cumsum(starts_ring) - 1]
    piece = np.cumsum(starts_ring | (since_ring_start % _SEGMENTS_PER_PIECE == 0)) - 1
    ends_piece = np.r_[np.diff(piece) != 0, True]
    order = np.argsort(np.r_[piece, piece[ends_piece]], kind="stable")  # the last end of a piece after its starts
    places = np.concatenate([corners[first], corners[first[ends_piece] + 1]])[order]
    return _shapely.linestrings(places, indices=np.r_[piece, piece[ends_piece]][order])


def _boundary_segments(shape: Shape) -> tuple[FloatArray, IntArray, IntArray]:
    """Corners of the boundary, the index of the first corner of each segment, and the ring that the segment is of."""
    corners, ring = _shapely.get_coordinates(_shapely.get_rings(_shapely.get_parts(shape)), return_index=True)
    first = np.flatnonzero(ring[1:] == ring[:-1])
    return corners, first, ring[first]


def transformed(shape: Shape, function: Callable[[FloatArray], FloatArray]) -> Shape:
    """The shape with its corners, shape (N, 2), moved by a function."""
    return _shapely.transform(shape, function)


def polygons(shape: Shape) -> list[Polygon]:
    """The polygons with an area of which a shape consists."""
    return [part for part in _shapely.get_parts(shape) if isinstance(part, Polygon) and part.area > 0]


@lru_cache(maxsize=2)  # a roadmap asks twice for those of the region that the robot can reach
def triangles(polygon: Polygon) -> FloatArray:
    """Triangles with the polygon's own corners that make it up (a constrained Delaunay triangulation), shape (T, 3, 2)."""
    pieces = _shapely.get_parts(_shapely.constrained_delaunay_triangles(polygon))
    return read_only(_shapely.get_coordinates(pieces).reshape(-1, 4, 2)[:, :3])


def corners(polygon: Polygon, tolerance: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Corners of a polygon, each with the one before and the one after it, the interior on the left; shapes (N, 2).

    Those are left out without which the outline is off by no more than about a tolerance. Each ring is taken by itself.
    """
    rings = _shapely.get_rings(_shapely.orient_polygons(polygon))
    corners, ring = _shapely.get_coordinates(_shapely.simplify(rings, tolerance), return_index=True)
    first = np.flatnonzero(ring[1:] == ring[:-1])
    starts_ring = np.r_[True, np.diff(ring[first]) != 0]
    before = first - 1
    before[starts_ring] = first[np.r_[starts_ring[1:], True]]
    return corners[first], corners[before], corners[first + 1]


def within(shape: Shape, corners: FloatArray) -> Shape:
    """The part of a shape in the rectangle x_min, y_min, x_max, y_max."""
    return _shapely.intersection(shape, _shapely.box(*corners))


def holes(shape: Polygon | MultiPolygon) -> ShapeArray:
    """The holes of the polygons of a shape, each filled."""
    rings, polygon = _shapely.get_rings(_shapely.get_parts(shape), return_index=True)
    return _shapely.polygons(rings[np.r_[False, polygon[1:] == polygon[:-1]]])


def largest_within(shapes: ShapeArray, others: ShapeArray) -> FloatArray:
    """For each polygon the size (see `sizes`) of the largest of others that it contains, 0 where it contains none.

    None of the others may cross the boundary of a polygon.
    """
    result = np.zeros(len(shapes))
    other, shape = cast("Any", shapely.STRtree)(shapes).query(_shapely.points(points_within(others)), predicate="within")
    np.maximum.at(result, shape, sizes(others)[other])
    return result


def extent(shapes: Shape | ShapeArray) -> FloatArray:
    """x_min, y_min, x_max, y_max of everything together, shape (4,)."""
    return _shapely.total_bounds(shapes)


def extents(shapes: ShapeArray) -> FloatArray:
    """x_min, y_min, x_max, y_max of each shape, shape (N, 4)."""
    return _shapely.bounds(shapes)


def sizes(shapes: ShapeArray) -> FloatArray:
    """Diagonal of the extent of each shape."""
    x_min, y_min, x_max, y_max = extents(shapes).T
    return np.hypot(x_max - x_min, y_max - y_min)


def problem(shape: Shape) -> str:
    """What makes a shape invalid; empty for a valid one."""
    return "" if _shapely.is_valid(shape) else str(_shapely.is_valid_reason(shape))


def points_within(shapes: ShapeArray) -> FloatArray:
    """Some point in the interior of each polygon, shape (N, 2)."""
    return _shapely.get_coordinates(_shapely.point_on_surface(shapes))


def nearest_part(shape: Shape, place: FloatArray) -> Polygon | None:
    """The polygon of a shape that contains a place or is nearest to it; None where the shape has none."""
    return min(polygons(shape), key=lambda part: float(part.distance(point(place))), default=None)


def nearest_place(shape: Shape, place: FloatArray) -> FloatArray:
    """The place of a shape that is nearest to a place, shape (2,)."""
    return _shapely.get_coordinates(_shapely.shortest_line(shape, point(place)))[0]


class Region:
    """An open region with its boundary, indexed for many queries.

    Parameters
    ----------
    shape
        Polygon or multipolygon.
    """

    def __init__(self, shape: Polygon | MultiPolygon) -> None:
        self._shape = shape
        _shapely.prepare(self._shape)

    @cached_property
    def _pieces(self) -> tuple[FloatArray, FloatArray]:
        """Starts and ends of the boundary's segments, shape (M, 2)."""
        corners, first, _ = _boundary_segments(self._shape)
        return corners[first], corners[first + 1]

    @cached_property
    def _segments(self) -> Any:
        return cast("Any", shapely.STRtree)(segments(*self._pieces))

    def contains(self, points: FloatArray) -> BoolArray:
        """Whether each point, shape (N, 2), lies inside and not on the boundary."""
        return _shapely.contains_xy(self._shape, points[:, 0], points[:, 1])

    def boundary_distances(self, points: FloatArray) -> FloatArray:
        """Distance of each point, shape (N, 2), to the boundary."""
        return self._segments.query_nearest(_shapely.points(points), return_distance=True, all_matches=False)[1]

    def boundary_in_boxes(self, lower: FloatArray, upper: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
        """Boundary segments whose extent overlaps each box: index of the box, shape (M,), starts and ends, shape (M, 2)."""
        box, piece = self._segments.query(_shapely.box(lower[:, 0], lower[:, 1], upper[:, 0], upper[:, 1]))
        starts, ends = self._pieces
        return box, starts[piece], ends[piece]

    def boundary_near(self, starts: FloatArray, ends: FloatArray, distance: float) -> BoolArray:
        """Whether each segment, shapes (N, 2), comes within a distance of the boundary, or exactly to it."""
        near = np.zeros(len(starts), dtype=bool)
        near[self._segments.query(segments(starts, ends), predicate="dwithin", distance=distance)[0]] = True
        return near
