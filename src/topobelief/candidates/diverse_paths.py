"""Topologically and geometrically diverse paths from start to goal, on a roadmap.

First the shortest path of each homotopy class within the detour limit (`homotopy`). Then, to fill up, detours around
balls (`detours`), as far as they differ from all paths that are there (`distinct_paths`): by the radius of the balls,
which halves when few more are found. In space the classes are left out: there the sides of an obstacle that floats are one
class, and what remains of diversity is the distance between paths (Voss, Moll and Kavraki, ICRA 2015).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray
from topobelief.candidates.detours import Balls, DetourSearch
from topobelief.candidates.distinct_paths import DistinctPaths
from topobelief.candidates.homotopy import Rays, shortest_paths_by_class
from topobelief.candidates.polyline import path_length
from topobelief.candidates.roadmap_graph import Roadmap
from topobelief.candidates.straightening import Straightening
from topobelief.errors import InvalidInputError, PlanningError

_ATTEMPTS_PER_PATH = 8  # balls of one radius tried at most, per path asked for
_ATTEMPTS = 160  # of which the radius is halved
_LEAST_YIELD = 20  # where they bring fewer paths
_HALVINGS = 4  # in the end balls, and differences, of 1/16 of the first radius
_NUM_LANDMARKS = 64
_ROUNDING = 1e-9  # relative: what differs by less counts as equal


def diverse_paths(
    roadmap: Roadmap,
    start: ArrayLike,
    goal: ArrayLike,
    num_paths: int = 20,
    max_detour: float | None = 1.3,
    seed: int = 0,
    *,
    ball_radius: float = 0.04,
    max_rays: int = 32,
) -> list[FloatArray]:
    """Short paths that differ, shortest first.

    Parameters
    ----------
    roadmap
    start, goal : shape (2,) or (3,)
        Metres; in the plane a heading is ignored. Places that the roadmap was not built for are joined to it.
    num_paths
        How many at most; fewer where the roadmap has no more that differ by 1/16 of the ball radius.
    max_detour
        No path is longer than this many times the first one; at least 1. None: any length.
    seed
        The same seed gives the same paths.
    ball_radius
        Radius of the avoided balls, and the Fréchet distance by which a path that fills up differs from all others, as a
        share of the shortest path's length. Halved up to four times where it leaves too few paths.
    max_rays
        Obstacles whose sides make a class, the largest first. None is smaller than a ball, or a speck (see `Rays`).

    Returns
    -------
    list of arrays, shape (waypoints, dim)
        From start to goal, metres; the straight way between two waypoints is free for the roadmap's robot. Corners
        are cut where that leaves the path in its class, and clear of the balls that it avoids.

    Raises
    ------
    PlanningError
        Where start or goal is in collision, or there is no path.
    """
    if num_paths < 1:
        raise InvalidInputError(f"expected at least 1 path, got {num_paths}")
    if max_detour is not None and not max_detour >= 1:
        raise InvalidInputError(f"expected a detour limit of at least 1 times the shortest path, or None, got {max_detour}")
    if not 0 < ball_radius < 0.5:
        raise InvalidInputError(f"expected a ball radius between 0 and 0.5 of the shortest path, got {ball_radius}")
    if max_rays < 0:
        raise InvalidInputError(f"expected max_rays of at least 0, got {max_rays}")
    roadmap = roadmap.between(start, goal)
    shortest = roadmap.shortest_path()
    if shortest is None:
        raise PlanningError(
            "expected a roadmap that connects start and goal, got one that does not; build it with build_roadmap"
        )
    length = path_length(roadmap.vertices[shortest])
    radius = ball_radius * length
    max_length = (
        math.inf if max_detour is None else max_detour * length * (1 + _ROUNDING)
    )  # the shortest path is never too long
    rays = Rays.of_obstacles(roadmap, min_size=radius, max_length=max_length, max_rays=max_rays)
    straightening = Straightening(roadmap, rays)
    classes = (
        [shortest]
        if roadmap.region is None
        else shortest_paths_by_class(roadmap, rays, num_classes=num_paths, max_length=max_length)
    )
    selection = _Selection(roadmap, straightening, num_paths, max_detour, _landmarks(roadmap, max_length))
    for path in classes:
        selection.add(straightening.by_pieces(roadmap.vertices[straightening.by_vertices(path)]))
    if not selection.full:
        search = DetourSearch(roadmap, classes, max_length, rng=np.random.default_rng(seed))
        _fill_up(selection, search, straightening, radius)
    return sorted(selection.paths, key=path_length)


class _Selection:
    """Paths within the detour limit, up to a number; those that fill up are far from all others."""

    def __init__(
        self,
        roadmap: Roadmap,
        straightening: Straightening,
        num_paths: int,
        max_detour: float | None,
        landmarks: FloatArray,
    ) -> None:
        self.paths: list[FloatArray] = []
        self.num_paths = num_paths
        self._roadmap = roadmap
        self._straightening = straightening
        self._max_detour = math.inf if max_detour is None else max_detour
        self._shortest = math.inf  # metres
        self._distinct = DistinctPaths(landmarks)

    @property
    def full(self) -> bool:
        """Whether no more paths are wanted."""
        return len(self.paths) == self.num_paths

    def add(self, path: FloatArray) -> None:
        """Add a path, unless it is too long; drop those that now are, where it is the shortest so far."""
        length = path_length(path)
        if length > self._max_detour * self._shortest:
            return
        self.paths.append(path)
        self._distinct.add(path)
        if length < self._shortest:
            self._shortest = length
            self.paths = [path for path in self.paths if path_length(path) <= self._max_detour * length]

    def consider(self, vertices: tuple[int, ...], balls: Balls, radius: float) -> bool:
        """Cut the corners of a path that is clear of balls and add it; or return False, where it is near to another.

        To cut corners is expensive, and the path through the vertices shows of most that they are near to another.
        """
        path = self._roadmap.vertices[list(vertices)]
        if self.full or self._distinct.any_within(path, radius):
            return False
        path = self._straightening.by_pieces(path, balls)
        if self._distinct.any_within(path, radius):
            return False
        self.add(path)
        return True


def _fill_up(selection: _Selection, search: DetourSearch, straightening: Straightening, radius: float) -> None:
    """Add detours around balls that are further than the balls' radius from all paths, then with half the radius, and so on."""
    known: set[tuple[int, ...]] = set()
    near: list[tuple[tuple[int, ...], Balls]] = []  # to another path, by the radius so far
    for least_yield in (*[_LEAST_YIELD] * _HALVINGS, 1):
        near = [(vertices, balls) for vertices, balls in near if not selection.consider(vertices, balls, radius)]
        for _ in range(math.ceil(_ATTEMPTS_PER_PATH * selection.num_paths / _ATTEMPTS)):
            num_before = len(selection.paths)
            for _ in range(_ATTEMPTS):
                if selection.full:
                    return
                detour = search.vary(radius)
                if detour is None:
                    continue
                vertices = tuple(straightening.by_vertices(detour.path, detour.balls))
                if vertices not in known:
                    known.add(vertices)
                    if not selection.consider(vertices, detour.balls, radius):
                        near.append((vertices, detour.balls))
            if len(selection.paths) < num_before + least_yield:
                break
        radius /= 2


def _landmarks(roadmap: Roadmap, max_length: float) -> FloatArray:
    """Vertices all over the part of the roadmap where paths of a length can be."""
    through = roadmap.distances_to(0) + roadmap.distances_to(1)
    within_reach = np.flatnonzero(through <= max(max_length, through[0]))
    return roadmap.vertices[within_reach[np.linspace(0, len(within_reach) - 1, _NUM_LANDMARKS).astype(int)]]
