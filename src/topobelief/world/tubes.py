"""Free space around a trajectory: all places within a width of it, a union of capsules.

For a robot that drives, a tube is flat: heights away from the trajectory count width / height times, so that a floor is not
joined to the one above it. Everything here is about places whose heights are stretched so ("stretched places"); there the tube
is round, the places nearer to the trajectory's segments than its width. A straight way lies in the tube if the parts of it in
the single capsules cover it, which is exact, because each of these parts is an interval.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.geometry.segments import distances_to_segments
from topobelief.world.parts import Parts, pairs_of_lists, wholly_covered

_AT_ONCE = 20_000  # ways that are held in memory together
_KEPT = 0.97  # share of the room beside the trajectory that is made use of


class Tubes:
    """A union of capsules.

    Parameters
    ----------
    starts, ends : shape (N, 3)
        Of the trajectory's segments, metres; a pose that no odometry joins to another has a segment of no length.
    width
        Metres to each side.
    height
        Metres up and down.
    """

    def __init__(self, starts: FloatArray, ends: FloatArray, width: float, height: float) -> None:
        self.starts, self.ends, self.width, self.height = starts, ends, width, height
        self._stretch = np.array([1.0, 1.0, width / height])
        pieces = np.maximum(np.ceil(np.linalg.norm((ends - starts) * self._stretch, axis=1) / width), 1).astype(np.int64)
        segment = np.repeat(np.arange(len(starts)), pieces)
        piece = np.arange(len(segment)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        step = (ends - starts)[segment] / pieces[segment, None]
        first = starts[segment] + piece[:, None] * step
        self._a, self._b = first * self._stretch, (first + step) * self._stretch
        self._middles = (self._a + self._b) / 2
        self._reach = float(np.linalg.norm(self._b - self._a, axis=1).max()) / 2  # of a segment from its middle

    @cached_property
    def _tree(self) -> Any:
        return KDTree(self._middles)

    @property
    def corners(self) -> FloatArray:
        """Opposite corners of all that is free, shape (2, 3)."""
        ends = np.concatenate([self.starts, self.ends])
        room = np.array([self.width, self.width, self.height])
        return np.stack([ends.min(axis=0) - room, ends.max(axis=0) + room])

    def clearance(self, points: FloatArray) -> FloatArray:
        """How much further from the trajectory a place might be, metres across the tube; shape (N,).

        This is the distance to the tube's surface where no other part of the trajectory is near, else at most that.
        """
        places = points * self._stretch
        near, _ = self._tree.query(places)
        lists = self._tree.query_ball_point(places, near + self._reach * (1 + 1e-9))
        which, segment = pairs_of_lists(lists)
        apart = distances_to_segments(places[which], self._a[segment], self._b[segment])
        nearest = np.full(len(places), np.inf)
        np.minimum.at(nearest, which, apart)
        return self.width - nearest

    def contains(self, points: FloatArray) -> BoolArray:
        """Whether each point is free, shape (N,)."""
        return self.clearance(points) > 0

    def segments_free(self, starts: FloatArray, ends: FloatArray, radius: float) -> BoolArray:
        """Whether each straight way, shapes (N, 3), stays in the tube by a radius, measured across it."""
        if radius >= self.width:
            return np.zeros(len(starts), dtype=bool)
        free = [np.zeros(0, dtype=bool)]
        for first in range(0, len(starts), _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            parts = self._parts(starts[part], ends[part], self.width - radius)
            free.append(wholly_covered(parts, len(starts[part])))
        return np.concatenate(free)

    def free_parts(self, starts: FloatArray, ends: FloatArray) -> Parts:
        """Parts of straight ways that are free, one for each capsule: they overlap."""
        found = [
            self._parts(starts[first : first + _AT_ONCE], ends[first : first + _AT_ONCE], self.width, first)
            for first in range(0, max(len(starts), 1), _AT_ONCE)
        ]
        return Parts(*(np.concatenate(columns) for columns in zip(*found, strict=True)))

    def _parts(self, starts: FloatArray, ends: FloatArray, radius: float, first: int = 0) -> Parts:
        """What lies in each capsule of a radius; ways are numbered from `first` on.

        A way both of whose ends lie in one capsule lies in it as a whole: of such ways that is all that is told.
        """
        a, b = starts * self._stretch, ends * self._stretch
        whole = self._within_one(a, b, radius)
        open_ = np.flatnonzero(~whole)
        a, along = a[open_], (b - a)[open_]
        half = np.linalg.norm(along, axis=1) / 2
        lists = self._tree.query_ball_point(a + along / 2, half + self._reach + radius)
        which, segment = pairs_of_lists(lists)
        lower, upper = _within_capsules(a[which], along[which], self._a[segment], self._b[segment], radius)
        kept = lower < upper
        whole_ways = np.flatnonzero(whole)
        return Parts(
            np.concatenate([whole_ways, open_[which[kept]]]) + first,
            np.concatenate([np.zeros(len(whole_ways)), lower[kept]]),
            np.concatenate([np.ones(len(whole_ways)), upper[kept]]),
        )

    def _within_one(self, a: FloatArray, b: FloatArray, radius: float) -> BoolArray:
        """Whether both ends of each way, as stretched places, are in a capsule near one of them."""
        result = np.zeros(len(a), dtype=bool)
        for ends in (b, a):
            segment = self._tree.query(ends)[1]
            depth = [distances_to_segments(places, self._a[segment], self._b[segment]) < radius for places in (a, b)]
            result |= depth[0] & depth[1]
        return result

    def nearest_free_place(self, place: FloatArray, radius: float) -> FloatArray | None:
        """About the nearest place with more room than a radius; None where the tube is too narrow."""
        room = _KEPT * (self.width - radius)
        if room <= 0:
            return None
        wanted = place * self._stretch
        apart = distances_to_segments(wanted, self._a, self._b)
        nearest = int(np.argmin(apart))
        on_way = _nearest_on(wanted, self._a[nearest], self._b[nearest])
        return (on_way + min(1.0, room / max(float(apart[nearest]), 1e-300)) * (wanted - on_way)) / self._stretch

    def drawn(self, count: int, radius: float, centre: FloatArray, reach: float, *, rng: np.random.Generator) -> FloatArray:
        """Random places within `reach` of a centre; as many to each metre of the trajectory, anywhere across it."""
        near = np.flatnonzero(distances_to_segments(centre, self.starts, self.ends) <= reach)
        if near.size == 0:
            return np.zeros((0, 3))
        lengths = np.linalg.norm(self.ends[near] - self.starts[near], axis=1) + 1e-9
        chosen = near[rng.choice(len(near), size=count, p=lengths / lengths.sum())]
        places = self.starts[chosen] + rng.uniform(size=(count, 1)) * (self.ends - self.starts)[chosen]
        aside = rng.normal(size=(count, 3))
        if self.height < self.width:  # a robot that drives stays on the surface
            aside[:, 2] = 0.0
        aside *= rng.uniform(size=(count, 1)) / np.linalg.norm(aside, axis=1, keepdims=True)
        return places + _KEPT * max(self.width - radius, 0.0) * aside

    def backbone(self, radius: float) -> tuple[FloatArray, IntArray]:
        """Places along the trajectory, and which of them are joined by ways that are free: shapes (N, 3) and (M, 2).

        A place follows the one before it as soon as that is further away than half of the room beside the trajectory: so far
        the straight way to it is in the ball around that one, and then it goes along a segment of the trajectory.
        """
        step = max(self.width - radius, 0.0) / 2
        places: list[FloatArray] = []
        links: list[tuple[int, int]] = []
        last: FloatArray | None = None
        for start, end in zip(self.starts, self.ends, strict=True):
            if last is None or (start != last).any():
                places.append(start)
            last = end
            if np.linalg.norm((end - places[-1]) * self._stretch) <= step:
                continue
            for place in (start, end):
                if (place != places[-1]).any():
                    links.append((len(places) - 1, len(places)))
                    places.append(place)
        return np.array(places), np.array(links, dtype=np.int64).reshape(-1, 2)


def _nearest_on(place: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    along = end - start
    share = float((place - start) @ along) / max(float(along @ along), 1e-300)
    return start + min(max(share, 0.0), 1.0) * along


def _within_capsules(
    a: FloatArray, along: FloatArray, first: FloatArray, second: FloatArray, radius: float
) -> tuple[FloatArray, FloatArray]:
    """From which share to which of its length each way lies within a radius of its segment; from > to where it does not.

    A capsule is convex: what is in it reaches from the first to the last of what lies in the balls around the segment's ends
    and in the cylinder between them.
    """
    axis = second - first
    squared = np.maximum(np.sum(axis**2, axis=1), 1e-300)
    offset, drift = np.sum((a - first) * axis, axis=1) / squared, np.sum(along * axis, axis=1) / squared
    lower, upper = _roots(a - first - offset[:, None] * axis, along - drift[:, None] * axis, radius)  # in the endless cylinder
    with np.errstate(divide="ignore", invalid="ignore"):
        at_first, at_second = -offset / drift, (1 - offset) / drift
    beside = (drift == 0) & ((offset < 0) | (offset > 1))  # the way keeps outside of the two planes at the segment's ends
    between = (
        np.where(drift == 0, -np.inf, np.minimum(at_first, at_second)),
        np.where(drift == 0, np.inf, np.maximum(at_first, at_second)),
    )
    lower, upper = np.maximum(lower, between[0]), np.minimum(upper, between[1])
    lower, upper = np.where(beside | ~(lower < upper), np.inf, lower), np.where(beside | ~(lower < upper), -np.inf, upper)
    for centre in (first, second):
        low, high = _roots(a - centre, along, radius)
        lower, upper = np.where(low < high, np.minimum(lower, low), lower), np.where(low < high, np.maximum(upper, high), upper)
    return np.maximum(lower, 0.0), np.minimum(upper, 1.0)


def _roots(offset: FloatArray, along: FloatArray, radius: float) -> tuple[FloatArray, FloatArray]:
    """Where |offset + t along| = radius: the smaller and the larger t; from > to where there is none, all where along is 0."""
    square, half = np.sum(along**2, axis=1), np.sum(offset * along, axis=1)
    rest = np.sum(offset**2, axis=1) - radius**2
    still = square <= 1e-30 * (np.sum(offset**2, axis=1) + radius**2)
    square = np.where(still, 1.0, square)
    inside = half**2 - square * rest
    root = np.sqrt(np.maximum(inside, 0.0))
    none = (still & (rest >= 0)) | (~still & (inside <= 0))
    lower, upper = np.where(still, -np.inf, (-half - root) / square), np.where(still, np.inf, (-half + root) / square)
    return np.where(none, np.inf, lower), np.where(none, -np.inf, upper)
