"""Straightening: the shortest of the polylines through some points of a path that is free and stays in its class."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.candidates.detours import Balls
from topobelief.candidates.homotopy import Rays, Word, joined
from topobelief.candidates.polyline import subdivided
from topobelief.candidates.roadmap_graph import Roadmap

_VERTICES_AHEAD = 32  # to which a cut corner leads at most
_PIECES = 4  # of each leg of a path, between which corners are cut
_PIECES_AHEAD = 3 * _PIECES  # three legs; the fourth adds hardly anything


class Straightening:
    """Cuts the corners of paths on a roadmap.

    A cut corner is free for the roadmap's robot, leaves the path in its class and keeps clear of balls. What is found out
    about two vertices is kept for the paths that follow, which pass many of the same vertices.

    Parameters
    ----------
    roadmap
    rays
        What tells the classes apart.
    """

    def __init__(self, roadmap: Roadmap, rays: Rays) -> None:
        self._roadmap = roadmap
        self._no_balls = Balls.none(roadmap.world.dim)
        self._rays = rays
        self._known: dict[int, tuple[bool, Word]] = {}  # of two vertices: whether the way between is free, what it spells

    def by_vertices(self, path: Sequence[int], balls: Balls | None = None) -> list[int]:
        """The shortest path through some of the vertices of a path.

        Parameters
        ----------
        path
            Along the roadmap's edges, clear of the balls.
        balls
        """
        vertices = np.array(path)
        places = self._roadmap.vertices[vertices]
        first, last = _pairs(len(path), _VERTICES_AHEAD)
        known = self._known_between(vertices[first], vertices[last])
        own = last - first == 1
        allowed = own | np.array([free for free, _ in known])
        allowed[allowed] &= own[allowed] | (balls or self._no_balls).clear_of(places[first[allowed]], places[last[allowed]])
        chosen = np.flatnonzero(allowed)
        letters = [known[pair][1] for pair in chosen.tolist()]
        return [path[place] for place in _shortest(places, first[chosen], last[chosen], letters)]

    def by_pieces(self, path: FloatArray, balls: Balls | None = None) -> FloatArray:
        """The shortest path through some of the ends of equal pieces of a path's legs; shapes (waypoints, dim).

        Parameters
        ----------
        path : shape (waypoints, dim)
            Free, clear of the balls.
        balls
        """
        places = subdivided(path, _PIECES)
        first, last = _pairs(len(places), _PIECES_AHEAD)
        a, b = places[first], places[last]
        own = last <= (first // _PIECES + 1) * _PIECES  # on one leg of the path
        allowed = own | (balls or self._no_balls).clear_of(a, b)
        cuts = allowed & ~own
        allowed[cuts] = self._roadmap.world.segments_free(a[cuts], b[cuts], self._roadmap.robot_radius)
        letters = self._rays.crossings(a[allowed], b[allowed])
        return places[_shortest(places, first[allowed], last[allowed], letters)]

    def _known_between(self, a: IntArray, b: IntArray) -> list[tuple[bool, Word]]:
        """For each two vertices whether the straight way between them is free, and what it spells."""
        keys: list[int] = (a * len(self._roadmap.vertices) + b).tolist()
        new = [pair for pair, key in enumerate(keys) if key not in self._known]
        if new:
            starts, ends = self._roadmap.vertices[a[new]], self._roadmap.vertices[b[new]]
            free: list[bool] = self._roadmap.world.segments_free(starts, ends, self._roadmap.robot_radius).tolist()
            spelled = self._rays.crossings(starts, ends)
            self._known.update(zip((keys[pair] for pair in new), zip(free, spelled, strict=True), strict=True))
        return [self._known[key] for key in keys]


@lru_cache(maxsize=256)
def _pairs(count: int, ahead: int) -> tuple[IntArray, IntArray]:
    """All pairs of a path's places that are at most so many places apart, sorted."""
    first, last = np.triu_indices(count, k=1)
    near = last - first <= ahead
    return first[near], last[near]


def _shortest(places: FloatArray, first: IntArray, last: IntArray, letters: list[Word]) -> list[int]:
    """The places of the shortest way from the first to the last one that spells what the whole path spells.

    Parameters
    ----------
    places : shape (N, dim)
    first, last : shape (P,)
        Between which there is a way; all neighbours among them, sorted.
    letters
        That each way spells.
    """
    lengths: list[float] = np.linalg.norm(places[last] - places[first], axis=1).tolist()
    pairs: list[list[int]] = np.stack([first, last], axis=1).tolist()
    ways = [(i, j, length, spelled) for (i, j), length, spelled in zip(pairs, lengths, letters, strict=True)]
    words = [Word()]  # so far, by place
    for i, j, _, spelled in ways:
        if j == i + 1:
            words.append(joined(words[-1], spelled))
    best = [0.0] + [math.inf] * (len(places) - 1)  # length of the best way to each place
    before = [0] * len(places)
    for i, j, length, spelled in ways:
        if best[i] + length < best[j] and joined(words[i], spelled) == words[j]:  # best[i] is final: i ascends
            best[j], before[j] = best[i] + length, i
    kept = [len(places) - 1]
    while kept[-1] > 0:
        kept.append(before[kept[-1]])
    return kept[::-1]
