"""Directed ways of a roadmap that a walk may drive, and which poses of the map are seen along them.

The way of an edge is cut into pieces of length delta, measured from where it begins. A new pose that stands somewhere on
piece i = 1 … N, or at the very end of the way (piece N + 1), may close loops with the poses that some place of the piece
sees: a superset of what it will see where it really stands. With at most k closures a pose, the k nearest and no two beside
each other on the odometry chain, only poses that may be among them count: those of which the nearest place of the piece is
no further than the furthest one of the (3 k - 2)-nd pose that the whole piece sees, because k - 1 poses and the two
neighbours of each are fewer."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.observations import ObservationModel
from topobelief.geometry.segments import distances_to_segments
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg.block_cholesky import Int32Array
from topobelief.linalg.compiled import compiled
from topobelief.search.bound import Check, unchecked
from topobelief.world import FreeSpace
from topobelief.world.parts import Parts
from topobelief.world.sight import seen_parts
from topobelief.world.space import seen_by

_ROUNDING = 1e-9
_LOOSE = 2e-6  # relative: how much further than the rule a landmark counts as in view, beyond the rule's own rounding


@dataclass(frozen=True, slots=True)
class Ways:
    """Straight ways from vertex to vertex, each edge in both directions, and the way that leads from the robot to the start.

    Attributes
    ----------
    source, target : shape (E,)
        Vertices.
    begin, end : shape (E, k)
        Metres, world frame.
    poses : shape (E, pose_size)
        Of the robot at the beginning of each way; it is turned so all along it.
    """

    source: IntArray
    target: IntArray
    begin: FloatArray
    end: FloatArray
    poses: FloatArray

    @property
    def lengths(self) -> FloatArray:
        """Metres, shape (E,)."""
        return np.linalg.norm(self.end - self.begin, axis=1)

    @property
    def directions(self) -> FloatArray:
        """Unit vectors in the direction of travel, world frame, shape (E, k)."""
        return (self.end - self.begin) / self.lengths[:, None]


@dataclass(frozen=True, slots=True)
class Sightings:
    """Poses of the map that new poses may close loops with, piece by piece.

    Attributes
    ----------
    first : shape (E + 1,)
        Pieces of way e are first[e], …, first[e + 1] - 1: those of length delta in order, then the end of the way.
    start : shape (P + 1,), poses : shape (M,)
        Compressed lists: indices into `seen`, for each piece.
    seen : shape (m,)
        Indices of the poses of the graph that any piece sees, ascending.
    """

    first: IntArray
    start: IntArray
    poses: IntArray
    seen: IntArray

    def with_more(self, more: Sightings) -> Sightings:
        """These and then others along the same ways; `seen` has first these, then the others."""
        if not len(more.seen):
            return self
        counts = np.stack([np.diff(self.start), np.diff(more.start)], axis=1).ravel()
        piece: IntArray = np.repeat(np.arange(len(counts)), counts)
        merged = np.empty(len(piece), dtype=np.int64)
        merged[piece % 2 == 0], merged[piece % 2 == 1] = self.poses, more.poses + len(self.seen)
        start = np.concatenate([[0], np.cumsum(counts)])[::2]
        return Sightings(self.first, start, merged, np.concatenate([self.seen, more.seen]))


def first_pieces(lengths: FloatArray, delta: float) -> IntArray:
    """Number of the first piece of each way, and how many there are, shape (E + 1,); the end of a way is one more piece."""
    pieces = np.ceil(lengths / delta - _ROUNDING).astype(np.int64)
    return np.concatenate([np.zeros(1, np.int64), np.cumsum(pieces + 1)])


def cells_of_pieces(ways: Ways, delta: float, cell: float) -> Int32Array:
    """Label of the square of the plane, or the cube of space, in which the middle of each piece is, from 0 on, shape (P,)."""
    first = first_pieces(ways.lengths, delta)
    way = np.repeat(np.arange(len(ways.lengths)), np.diff(first))
    piece: IntArray = np.arange(int(first[-1])) - first[way]
    middle = np.minimum((piece + 0.5) * delta, ways.lengths[way])
    places = ways.begin[way] + (middle / ways.lengths[way])[:, None] * (ways.end - ways.begin)[way]
    squares = np.floor((places - places.min(axis=0)) / cell).astype(np.int64)
    keys = np.ravel_multi_index(tuple(squares.T), tuple((squares.max(axis=0) + 1).tolist()))
    return np.unique(keys, return_inverse=True)[1].astype(np.int32)


def find_sightings(
    graph: PoseGraph,
    ways: Ways,
    pose: int,
    delta: float,
    rule: ClosureModel,
    world: FreeSpace | None,
    latest: int,
    check: Check = unchecked,
) -> Sightings:
    """What is seen along each way.

    Parameters
    ----------
    graph
    ways
    pose
        Where the robot is.
    delta
        Length of a piece, metres.
    rule
    world
    latest
        The largest number of a new pose; poses that are not far enough back even for it are left out.
    check
    """
    way, seen, lower, upper = _seen_along(graph, ways, pose, rule, world, latest, check)
    always = (seen > pose) | (pose - seen + 1 >= rule.min_index_gap)
    nearest = 0 if rule.max_per_pose is None else 3 * rule.max_per_pose - 2
    at, aside = _beside(graph, ways, way, seen)
    return _listed(ways, delta, nearest, way, seen, lower, upper, at, aside, always)


def find_landmarks(
    graph: PoseGraph, ways: Ways, delta: float, model: ObservationModel, world: FreeSpace | None, check: Check = unchecked
) -> Sightings:
    """Landmarks that may be observed along each way: of those, new poses observe at most `model.max_per_pose`, the nearest.

    From u metres along a way, a landmark abeam at a and b aside of it is seen at the angle atan2(b, a - u): within half of the
    field of view where u <= a - b / tan(half).

    Parameters
    ----------
    graph, ways, delta, world, check
        As for `find_sightings`.
    model
    """
    landmarks = np.flatnonzero(graph.is_landmark)
    middle, reach = (ways.begin + ways.end) / 2, ways.lengths / 2 + model.max_range
    lists = KDTree(graph.positions[landmarks]).query_ball_point(middle, reach)
    way = np.repeat(np.arange(len(middle)), [len(near) for near in lists])
    seen = landmarks[np.concatenate([*(np.array(near, dtype=np.int64) for near in lists), np.zeros(0, dtype=np.int64)])]
    at, aside = _beside(graph, ways, way, seen)
    half = np.sqrt(np.maximum(model.max_range**2 - aside, 0.0))
    lower, upper = np.maximum(at - half, 0.0), np.minimum(at + half, ways.lengths[way])
    if model.field_of_view < 2 * math.pi:
        limit = at - np.sqrt(aside) / math.tan(model.field_of_view / 2)
        upper = np.minimum(upper, limit + _LOOSE * (1 + np.abs(limit)))
    kept = np.flatnonzero((aside <= model.max_range**2) & (lower <= upper))
    lower, upper = lower[kept], upper[kept]
    if world is not None and model.line_of_sight:
        place, begin, end = (
            seen_by(world, each) for each in (graph.positions[seen[kept]], ways.begin[way[kept]], ways.end[way[kept]])
        )
        parts = seen_parts(world, place, begin, end, check)
        kept = kept[parts.which]
        length = ways.lengths[way[kept]]
        lower = np.maximum(lower[parts.which], parts.lower * length)
        upper = np.minimum(upper[parts.which], parts.upper * length)
    nonempty = lower <= upper
    kept, lower, upper = kept[nonempty], lower[nonempty], upper[nonempty]
    always = np.ones(len(kept), dtype=np.bool_)
    return _listed(ways, delta, model.max_per_pose or 0, way[kept], seen[kept], lower, upper, at[kept], aside[kept], always)


def _beside(graph: PoseGraph, ways: Ways, way: IntArray, seen: IntArray) -> tuple[FloatArray, FloatArray]:
    """Metres along the way to where a node is abeam, and its squared distance from the line."""
    offset = graph.positions[seen] - ways.begin[way]
    at = np.sum(offset * ways.directions[way], axis=1)
    return at, np.maximum(np.sum(offset**2, axis=1) - at**2, 0.0)


def _listed(
    ways: Ways,
    delta: float,
    nearest: int,
    way: IntArray,
    seen: IntArray,
    lower: FloatArray,
    upper: FloatArray,
    at: FloatArray,
    aside: FloatArray,
    always: BoolArray,
) -> Sightings:
    """Sightings from their rows in any order; columns as `_lists` has them."""
    first = first_pieces(ways.lengths, delta)
    order = np.argsort(way, kind="stable")
    row_start = np.searchsorted(way[order], np.arange(len(ways.source) + 1))
    columns = (lower[order], upper[order], at[order], aside[order], seen[order], always[order])
    start, poses = _lists(first, row_start, ways.lengths, delta, nearest, *columns)
    used = np.unique(poses)
    return Sightings(first, start, np.searchsorted(used, poses), used)


def _seen_along(
    graph: PoseGraph, ways: Ways, pose: int, rule: ClosureModel, world: FreeSpace | None, latest: int, check: Check
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Way, pose, and metres along the way from where to where it may be seen."""
    positions = graph.positions
    middle, reach = (ways.begin + ways.end) / 2, ways.lengths / 2 + rule.radius
    lists = KDTree(positions).query_ball_point(middle, reach)
    way = np.repeat(np.arange(len(middle)), [len(near) for near in lists])
    seen = np.concatenate([*(np.array(near, dtype=np.int64) for near in lists), np.zeros(0, dtype=np.int64)])
    far_enough_back = (seen > pose) | (pose - seen + latest >= rule.min_index_gap)
    distance = distances_to_segments(positions[seen], ways.begin[way], ways.end[way])
    kept = far_enough_back & (distance < rule.radius) & _aligned(graph, ways, way, seen, rule)
    way, seen = way[kept], seen[kept]
    offset = positions[seen] - ways.begin[way]
    at = np.sum(offset * ways.directions[way], axis=1)
    half = np.sqrt(np.maximum(rule.radius**2 - np.sum(offset**2, axis=1) + at**2, 0.0))
    lower, upper = np.maximum(at - half, 0.0), np.minimum(at + half, ways.lengths[way])
    if world is not None:
        parts = _seen_parts(world, ways, positions, way, seen, check)
        length = ways.lengths[way][parts.which]
        lower, upper = (
            np.maximum(lower[parts.which], parts.lower * length),
            np.minimum(upper[parts.which], parts.upper * length),
        )
        way, seen = way[parts.which], seen[parts.which]
        overlap = lower <= upper
        way, seen, lower, upper = way[overlap], seen[overlap], lower[overlap], upper[overlap]
    return way, seen, lower, upper


def _seen_parts(world: FreeSpace, ways: Ways, positions: FloatArray, way: IntArray, seen: IntArray, check: Check) -> Parts:
    """What of some ways poses see; a way and the way back are looked at once."""
    source, target = ways.source[way], ways.target[way]
    size = int(max(ways.source.max(), ways.target.max())) + 1
    keys = (np.minimum(source, target) * size + np.maximum(source, target)) * len(positions) + seen
    _, one, same = np.unique(keys, return_index=True, return_inverse=True)
    place, begin, end = (seen_by(world, each) for each in (positions[seen[one]], ways.begin[way[one]], ways.end[way[one]]))
    parts = seen_parts(world, place, begin, end, check)
    first = np.searchsorted(parts.which, np.arange(len(one) + 1))
    count = np.diff(first)[same]
    which = np.repeat(np.arange(len(way)), count)
    at = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first[same], count)
    back = (source != source[one][same])[which]
    lower, upper = parts.lower[at], parts.upper[at]
    return Parts(which, np.where(back, 1 - upper, lower), np.where(back, 1 - lower, upper))


def _aligned(graph: PoseGraph, ways: Ways, way: IntArray, seen: IntArray, rule: ClosureModel) -> BoolArray:
    relative = graph.group.between(ways.poses[way], graph.poses[seen])
    turned = np.linalg.norm(graph.group.rotation_vector(relative), axis=1)
    return turned <= rule.angle * (1 + _ROUNDING) + _ROUNDING


@compiled
def _lists(
    first: IntArray,
    row_start: IntArray,
    lengths: FloatArray,
    delta: float,
    nearest: int,
    lower: FloatArray,
    upper: FloatArray,
    at: FloatArray,
    aside: FloatArray,
    seen: IntArray,
    always: BoolArray,
) -> tuple[IntArray, IntArray]:
    """Poses for each piece, as compressed lists.

    Parameters
    ----------
    first, lengths, delta
        Of the ways.
    nearest
        How many poses that a whole piece sees bound how far others may be; 0: no bound.
    row_start, lower, upper, at, aside, seen, always
        Sightings by way: from where to where (metres along it), where the pose is abeam, its squared distance from the line,
        its index, and whether it is far enough back for every new pose.
    """
    num_pieces, longest = first[-1], 0
    for e in range(len(lengths)):
        longest = max(longest, row_start[e + 1] - row_start[e])
    start, count = np.zeros(num_pieces + 1, np.int64), 0
    poses = np.empty(1024, np.int64)
    closest, furthest = np.empty(longest), np.empty(longest)
    chosen = np.empty(longest, np.int64)
    for e in range(len(lengths)):
        for p in range(first[e], first[e + 1]):
            i = p - first[e]
            is_end = p == first[e + 1] - 1
            begin = lengths[e] if is_end else max(i * delta - 1e-7 * delta, 0.0)
            end = lengths[e] if is_end else min((i + 1) * delta + 1e-7 * delta, lengths[e])
            num, num_whole = 0, 0
            for r in range(row_start[e], row_start[e + 1]):
                if lower[r] > end + 1e-9 or upper[r] < begin - 1e-9:
                    continue
                abeam = min(max(at[r], begin), end)
                closest[num] = (at[r] - abeam) ** 2 + aside[r]
                chosen[num] = seen[r]
                if always[r] and lower[r] <= begin - 2e-9 * (begin > 0.0) and upper[r] >= end - 1e-8:
                    furthest[num_whole] = max((at[r] - begin) ** 2, (at[r] - end) ** 2) + aside[r]
                    num_whole += 1
                num += 1
            limit = np.inf
            if 0 < nearest <= num_whole:
                limit = np.sort(furthest[:num_whole])[nearest - 1] * (1.0 + 1e-8) + 1e-8  # ties to rounding
            for c in range(num):
                if closest[c] > limit:
                    continue
                repeated = False
                for before in range(start[p], count):
                    repeated = repeated or poses[before] == chosen[c]
                if repeated:
                    continue
                if count == len(poses):
                    more = np.empty(2 * count, np.int64)
                    more[:count] = poses
                    poses = more
                poses[count] = chosen[c]
                count += 1
            start[p + 1] = count
    return start, poses[:count].copy()
