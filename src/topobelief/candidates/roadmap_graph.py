"""Roadmaps: places where a robot fits and the free straight ways between them, in the plane or in space."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree
from shapely import Polygon

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.candidates.ends import SAME_PLACE, checked_ends, shown_place
from topobelief.candidates.polyline import checked_path
from topobelief.errors import PlanningError
from topobelief.wording import counted
from topobelief.world import FreeSpace

_dijkstra = cast("Any", dijkstra)  # whose stub refuses one index


@dataclass(frozen=True, eq=False)
class Roadmap:
    """Places and the free straight ways between them; `build_roadmap` makes one.

    Attributes
    ----------
    world, robot_radius
        What the ways are free of collisions in, and for how large a robot (metres).
    region
        What the robot's centre can reach (see `World.component`); its holes are the obstacles to go around. None in space.
    vertices : shape (V, dim)
        The first is the start, the second the goal.
    edges : shape (E, 2)
        Undirected, each once, smaller index first.
    """

    world: FreeSpace
    robot_radius: float
    region: Polygon | None
    vertices: FloatArray
    edges: IntArray

    def __repr__(self) -> str:
        vertices, edges = counted(len(self.vertices), "vertex", "vertices"), counted(len(self.edges), "edge")
        return f"Roadmap({vertices}, {edges}, robot radius {self.robot_radius:g} m)"

    @cached_property
    def lengths(self) -> FloatArray:
        """Length of each edge, metres, shape (E,)."""
        a, b = self.edges.T
        return np.linalg.norm(self.vertices[b] - self.vertices[a], axis=1)

    @cached_property
    def _adjacency(self) -> tuple[sparse.csr_array, IntArray]:
        """Symmetric matrix of edge lengths, shape (V, V), and the edge behind each of its entries."""
        (a, b), size = self.edges.T, len(self.vertices)
        numbers = np.tile(np.arange(1, len(self.edges) + 1), 2)
        matrix = sparse.csr_array((numbers, (np.r_[a, b], np.r_[b, a])), shape=(size, size))
        edge = matrix.data - 1
        return sparse.csr_array((self.lengths[edge], matrix.indices, matrix.indptr), shape=matrix.shape), edge

    def shortest_path(
        self, source: int = 0, target: int = 1, *, blocked: BoolArray | None = None, max_length: float = math.inf
    ) -> list[int] | None:
        """Vertices of the shortest path, or None where there is none within the length.

        Parameters
        ----------
        source, target
            Vertices.
        blocked : shape (E,), optional
            Edges not to use.
        max_length
            Metres.
        """
        matrix, edge = self._adjacency
        if blocked is not None:
            weights = np.where(blocked[edge], np.inf, matrix.data)
            matrix = sparse.csr_array((weights, matrix.indices, matrix.indptr), shape=matrix.shape)
        limit = min(
            max_length, 2 * float(self.lengths.sum())
        )  # finite, so that a blocked edge is never taken; sums are rounded
        _, previous = _dijkstra(matrix, indices=source, limit=limit, return_predecessors=True)
        path = [target]
        while path[-1] != source:
            step = int(previous[path[-1]])
            if step < 0:
                return None
            path.append(step)
        return path[::-1]

    def distances_to(self, target: int) -> FloatArray:
        """Length of the shortest way from each vertex, shape (V,); inf where there is none."""
        return _dijkstra(self._adjacency[0], indices=target)

    def shortest_ways(self, sources: ArrayLike) -> tuple[FloatArray, IntArray]:
        """Shortest ways from some vertices to all.

        Parameters
        ----------
        sources : shape (S,)
            Vertices.

        Returns
        -------
        lengths : shape (S, V)
            Metres; inf where there is no way.
        previous : shape (S, V)
            The vertex before each on its way; negative at the source and where there is no way.
        """
        lengths, previous = _dijkstra(self._adjacency[0], indices=np.asarray(sources), return_predecessors=True)
        return lengths, previous.astype(np.int64)

    def between(self, start: ArrayLike, goal: ArrayLike) -> Roadmap:
        """The same roadmap for another start and goal, which join it as its first two vertices.

        Raises
        ------
        PlanningError
            Where one of them is in collision or cannot be joined.
        """
        ends = checked_ends(self.world, start, goal, self.robot_radius)
        if np.abs(ends - self.vertices[:2]).max() <= SAME_PLACE:
            return self
        vertices = np.concatenate([ends, self.vertices])
        joined = free_edges(self.world, vertices, self.robot_radius, of=np.arange(2))
        edges = np.unique(np.concatenate([joined, self.edges + 2]), axis=0)
        roadmap = Roadmap(self.world, self.robot_radius, self.region, vertices, edges)
        if roadmap.shortest_path() is None:
            raise PlanningError(
                f"expected a start and a goal that join the roadmap, got {shown_place(ends[0])} and {shown_place(ends[1])}, "
                "between which it has no way; build a roadmap for them"
            )
        return roadmap


def free_edges(world: FreeSpace, vertices: FloatArray, robot_radius: float, *, of: IntArray) -> IntArray:
    """Free edges from some vertices, shape (N,), to their nearest ones, each once; shape (E, 2)."""
    dim = vertices.shape[1]
    num_neighbours = math.ceil(math.e * (1 + 1 / dim) * math.log(len(vertices)))  # k of PRM*
    num_neighbours = min(num_neighbours, len(vertices) - 1)
    _, neighbours = KDTree(vertices).query(vertices[of], k=num_neighbours + 1)  # itself among them
    pairs = np.stack([np.repeat(of, num_neighbours + 1), np.ravel(neighbours)], axis=1)
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    free = world.segments_free(vertices[pairs[:, 0]], vertices[pairs[:, 1]], robot_radius)
    return pairs[free]


def each_once(edges: IntArray) -> IntArray:
    """The edges sorted, shape (E, 2), smaller index first."""
    return np.unique(np.sort(edges, axis=1), axis=0)


def with_way(roadmap: Roadmap, path: FloatArray) -> tuple[Roadmap, tuple[int, ...]]:
    """A roadmap with the waypoints of a free path as vertices, after its own; and the path as vertices of it.

    Waypoints are joined along the path and to their neighbours.
    """
    path = checked_path(path)
    apart = np.linalg.norm(roadmap.vertices[None] - path[:, None], axis=2)
    nearest, known = apart.argmin(axis=1), apart.min(axis=1) <= SAME_PLACE
    count = len(roadmap.vertices)
    walk = np.where(known, nearest, count + np.cumsum(~known) - 1)
    vertices = np.concatenate([roadmap.vertices, path[~known]])
    along = np.stack([walk[:-1], walk[1:]], axis=1)
    joined = free_edges(roadmap.world, vertices, roadmap.robot_radius, of=np.arange(count, len(vertices)))
    edges = each_once(np.concatenate([roadmap.edges, along, joined]))
    return replace(roadmap, vertices=vertices, edges=edges), tuple(walk.tolist())
