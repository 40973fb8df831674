"""Detours on a roadmap: shortest paths that avoid balls around places of other paths.

The varying step of Voss, Moll and Kavraki, "A heuristic approach to finding diverse short paths", ICRA 2015: keep a
queue of paths, each with the balls that it avoids. Take one; twice, add a ball around a random place of it, find the
shortest path that avoids all its balls, and queue that.

All these searches lead to the same goal, so an edge from u to v counts l(u, v) + h(v) - h(u), with l its length and h
the length of the shortest way to the goal where nothing is blocked. This is never negative, nothing along a shortest way,
and adds up to the excess of a path over the shortest one; a search that is limited to a small excess visits few vertices.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.candidates.polyline import path_length, stations
from topobelief.candidates.roadmap_graph import Roadmap
from topobelief.geometry.segments import distances_to_segments
from topobelief.world.segment_index import SegmentIndex

_BALLS_PER_PATH = 2  # how often each path of the queue is varied
_FIRST_LIMIT = 0.02  # of the shortest path: by how much a search first lets the excess grow
_LIMIT_GROWTH = 3.0  # and by which factor it does where that is too little

_dijkstra = cast("Any", dijkstra)  # whose stub refuses one index


@dataclass(frozen=True, eq=False, slots=True)
class Balls:
    """Balls that a path avoids."""

    centres: FloatArray  # shape (B, dim)
    radii: FloatArray  # shape (B,)

    @classmethod
    def none(cls, dim: int = 2) -> Balls:
        return cls(np.zeros((0, dim)), np.zeros(0))

    def and_one(self, centre: FloatArray, radius: float) -> Balls:
        """These and one more."""
        return Balls(np.vstack([self.centres, centre]), np.append(self.radii, radius))

    def clear_of(self, starts: FloatArray, ends: FloatArray) -> BoolArray:
        """Whether each segment, shapes (N, dim), stays out of all balls."""
        apart = distances_to_segments(self.centres[:, None], starts, ends) - self.radii[:, None]
        return apart.min(axis=0, initial=np.inf) > 0


@dataclass(frozen=True, eq=False, slots=True)
class Detour:
    """A path from start to goal on the roadmap, and what it avoids."""

    path: list[int]
    balls: Balls
    blocked: IntArray  # the entries of the search's matrix that enter a ball
    least_excess: float  # by how much all paths that avoid the balls are longer than the roadmap's shortest path, metres


class DetourSearch:
    """Varies paths within a length, then the variations, and again the paths once nothing is left to vary.

    Parameters
    ----------
    roadmap
        With a path from vertex 0 to vertex 1.
    paths
        To start from.
    max_length
        Metres.
    rng
    """

    def __init__(self, roadmap: Roadmap, paths: list[list[int]], max_length: float, *, rng: np.random.Generator) -> None:
        self._vertices = roadmap.vertices
        self._rng = rng
        self._first = [Detour(path, Balls.none(roadmap.world.dim), np.zeros(0, dtype=np.int64), 0.0) for path in paths]
        self._queue: deque[Detour] = deque()
        self._num_varied = 0

        to_start, to_goal = roadmap.distances_to(0), roadmap.distances_to(1)
        self._shortest = float(to_goal[0])
        longest = max(min(max_length, float(roadmap.lengths.sum())), self._shortest)  # finite: see _shortest_path
        self._max_excess = longest - self._shortest
        a, b = roadmap.edges.T
        through = roadmap.lengths + np.minimum(to_start[a] + to_goal[b], to_start[b] + to_goal[a])
        a, b = roadmap.edges[through <= longest].T  # no path within the length takes any other
        self._starts, self._ends = roadmap.vertices[a], roadmap.vertices[b]
        self._index = SegmentIndex(self._starts, self._ends)

        lengths, closer = np.linalg.norm(self._ends - self._starts, axis=1), to_goal[a] - to_goal[b]
        excess = np.maximum(np.concatenate([lengths - closer, lengths + closer]), 0.0)
        numbers, size = np.arange(1, len(excess) + 1), len(roadmap.vertices)
        matrix = sparse.csr_array((numbers, (np.r_[a, b], np.r_[b, a])), shape=(size, size))
        self._entries = np.argsort(matrix.data).reshape(2, -1)  # of each edge in the matrix, there and back
        self._excess = excess[matrix.data - 1]
        self._matrix = sparse.csr_array((self._excess.copy(), matrix.indices, matrix.indptr), shape=matrix.shape)

    def vary(self, radius: float) -> Detour | None:
        """The next detour, around one more ball of a radius.

        None where the ball blocks the start or the goal, or leaves no way within the length.
        """
        if not self._queue:
            self._queue.extend(self._first)
        detour = self._queue[0]
        self._num_varied += 1
        if self._num_varied % _BALLS_PER_PATH == 0:
            self._queue.popleft()
        waypoints = self._vertices[detour.path]
        centre = stations(waypoints, self._rng.uniform(0, path_length(waypoints), 1)).positions[0]
        if np.linalg.norm(self._vertices[:2] - centre, axis=1).min() <= radius:
            return None
        further = self._around(detour, centre, radius)
        if further is not None:
            self._queue.append(further)
        return further

    def _around(self, detour: Detour, centre: FloatArray, radius: float) -> Detour | None:
        """The shortest path around one more ball."""
        near = self._index.near(centre, radius)
        entering = near[distances_to_segments(centre, self._starts[near], self._ends[near]) <= radius]
        blocked = np.concatenate([detour.blocked, self._entries[:, entering].ravel()])
        found = self._shortest_path(blocked, least_excess=detour.least_excess)
        return None if found is None else Detour(found[0], detour.balls.and_one(centre, radius), blocked, found[1])

    def _shortest_path(self, blocked: IntArray, *, least_excess: float) -> tuple[list[int], float] | None:
        """The shortest path without some entries of the matrix, and its excess, which is known to be at least so much."""
        step = _FIRST_LIMIT * self._shortest
        self._matrix.data[blocked] = np.inf  # beyond any limit, for limits are finite
        try:
            while True:
                limit = min(least_excess + step, self._max_excess)
                excess, previous = _dijkstra(self._matrix, indices=0, limit=limit, return_predecessors=True)
                if previous[1] >= 0:
                    break
                if limit >= self._max_excess:
                    return None
                step *= _LIMIT_GROWTH
        finally:
            self._matrix.data[blocked] = self._excess[blocked]
        path = [1]
        while path[-1] != 0:
            path.append(int(previous[path[-1]]))
        return path[::-1], float(excess[1])
