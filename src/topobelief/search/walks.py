"""Walks on a roadmap, described by the few vertices through which they are led.

A walk is a sequence of vertices, each joined to the next by an edge of the roadmap. Every walk is a chain of shortest ways:
from its first vertex to a *via-vertex*, from there to the next, and so on. Few via-vertices say all of it, and changing one of
them changes the walk in a way that makes sense to drive. Distances from a vertex to all others are computed once, when the
vertex first becomes a via-vertex.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from topobelief.arrays import BoolArray, FloatArray
from topobelief.candidates.roadmap import Roadmap

Walk = tuple[int, ...]
"""Vertices of a roadmap in the order in which they are passed; neighbours in it are joined by an edge."""

_ROUNDING = 1e-9  # relative: lengths that differ by less are equal


class Walks:
    """The walks from the start of a roadmap that are no longer than a limit.

    Parameters
    ----------
    roadmap
        Its first vertex is where walks begin.
    end
        The vertex where walks end; None where they may end anywhere.
    max_length
        Metres; at least the length of the shortest way to the end.
    """

    def __init__(self, roadmap: Roadmap, end: int | None, max_length: float) -> None:
        self.roadmap, self.end, self.max_length = roadmap, end, max_length
        self._lengths: dict[int, FloatArray] = {}
        self._previous: dict[int, list[int]] = {}

    @property
    def start(self) -> int:
        """The vertex where walks begin."""
        return 0

    def distances(self, vertex: int) -> FloatArray:
        """Length of the shortest way between a vertex and each other one, shape (V,); inf where there is none."""
        if vertex not in self._lengths:
            self.prepare([vertex])
        return self._lengths[vertex]

    def prepare(self, vertices: Iterable[int]) -> None:
        """Find the shortest ways from these vertices together, which is faster than one by one."""
        new = [vertex for vertex in dict.fromkeys(vertices) if vertex not in self._lengths]
        if new:
            lengths, previous = self.roadmap.shortest_ways(new)
            self._lengths.update(zip(new, lengths, strict=True))
            self._previous.update(zip(new, previous.tolist(), strict=True))

    @property
    def through(self) -> FloatArray:
        """Length of the shortest walk through each vertex, shape (V,)."""
        to_start = self.distances(self.start)
        return to_start if self.end is None else to_start + self.distances(self.end)

    @property
    def in_reach(self) -> BoolArray:
        """Which vertices some walk within the length passes, shape (V,)."""
        return self.through <= self.limit

    @property
    def limit(self) -> float:
        """The longest length that counts as within the limit: rounding must not exclude a way of exactly that length."""
        return self.max_length * (1 + _ROUNDING)

    def stops(self, vias: Sequence[int]) -> list[int]:
        """The via-vertices between start and end."""
        return [self.start, *vias] if self.end is None else [self.start, *vias, self.end]

    def length(self, vias: Sequence[int]) -> float:
        """Length of the walk through some via-vertices, metres."""
        return sum(float(self.distances(a)[b]) for a, b in itertools.pairwise(self.stops(vias)))

    def walk(self, vias: Sequence[int]) -> Walk:
        """The walk through some via-vertices, by shortest ways between them."""
        walk = [self.start]
        for source, target in itertools.pairwise(self.stops(vias)):
            walk += self.way(source, target)
        return tuple(walk)

    def way(self, source: int, target: int) -> list[int]:
        """Vertices after the source on the shortest way to the target, which there must be; none where they are the same."""
        if source == target:
            return []
        if source not in self._previous:
            self.prepare([source])
        previous, way = self._previous[source], [target]
        while (step := previous[way[-1]]) != source:
            way.append(step)
        return way[::-1]

    def lengths_along(self, walk: Walk) -> FloatArray:
        """Length of the walk up to each of its vertices, metres."""
        places = self.roadmap.vertices[list(walk)]
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])

    def vias(self, walk: Walk) -> tuple[int, ...]:
        """Few vertices that describe a walk: from each, the way to the next one is the shortest there is.

        Where the roadmap has several shortest ways between two vertices, they may describe another walk of the same length.
        """
        so_far, vias, first = self.lengths_along(walk), list[int](), 0
        while first < len(walk) - 1:
            distances = self.distances(walk[first])
            last = first + 1
            while last + 1 < len(walk) and so_far[last + 1] - so_far[first] <= distances[walk[last + 1]] * (1 + _ROUNDING):
                last += 1
            vias.append(walk[last])
            first = last
        return tuple(vias if self.end is None else vias[:-1])
