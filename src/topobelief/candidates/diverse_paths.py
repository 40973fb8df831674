"""Topologically and geometrically diverse paths from start to goal, on a roadmap.

First the shortest path of each homotopy class within the detour limit (`homotopy`). Then, to fill up, Voss, Moll and
Kavraki, "A heuristic approach to finding diverse short paths", ICRA 2015: keep a queue of paths, each with the balls
that it avoids, at first the shortest path and no ball. Take one; twice, add a ball around a random point of it and
find the shortest path that avoids all its balls; queue it, and keep it if it is far from all paths that were kept.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import BoolArray, FloatArray
from topobelief.candidates.homotopy import Rays, Word, joined, shortest_paths_by_class
from topobelief.candidates.polyline import distances_to_segments, path_length, sampled, stations, subdivided
from topobelief.candidates.roadmap import Roadmap
from topobelief.errors import InvalidInputError, PlanningError
from topobelief.world import shapes

_BALLS_PER_PATH = 2  # how often each path of the queue is varied
_ATTEMPTS_PER_PATH = 8  # balls of one radius tried, per path asked for
_NUM_SAMPLES = 32  # places at which the Fréchet distance of two paths is taken
_PIECES = 4  # of each leg of a path, between which corners are cut
_LOOKAHEAD = 32  # pieces that a cut corner replaces at most


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
        Metres; a heading is ignored. Places that the roadmap was not built for are joined to it.
    num_paths
        How many at most; fewer where the roadmap has no more that differ.
    max_detour
        No path is longer than this many times the first one; at least 1. None: any length.
    seed
        The same seed gives the same paths.
    ball_radius
        Radius of the avoided balls, and the Fréchet distance by which a path that fills up differs from all others;
        as a share of the shortest path's length.
    max_rays
        Obstacles whose sides make a class, the largest first.

    Returns
    -------
    list of arrays, shape (waypoints, 2)
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
    max_length = math.inf if max_detour is None else max_detour * length
    rays = Rays.of_obstacles(roadmap, min_size=radius, max_length=max_length, max_rays=max_rays)
    classes = shortest_paths_by_class(roadmap, rays, num_classes=num_paths, max_length=max_length)
    paths = [
        _straightened(roadmap, rays, _straightened(roadmap, rays, roadmap.vertices[path]), pieces=_PIECES) for path in classes
    ]
    paths = _within_limit(paths, max_detour)
    rng = np.random.default_rng(seed)
    while len(paths) < num_paths and radius >= roadmap.robot_radius:
        further = _further_paths(roadmap, rays, classes, paths, num_paths, radius=radius, max_length=max_length, rng=rng)
        paths = _within_limit(paths + further, max_detour)
        radius /= 2
    return paths


def _within_limit(paths: list[FloatArray], max_detour: float | None) -> list[FloatArray]:
    """The paths that are not longer than the limit times the shortest, by length."""
    by_length = sorted(paths, key=path_length)
    longest = math.inf if max_detour is None else max_detour * path_length(by_length[0])
    return [path for path in by_length if path_length(path) <= longest]


def _further_paths(
    roadmap: Roadmap,
    rays: Rays,
    classes: list[list[int]],
    paths: list[FloatArray],
    num_paths: int,
    *,
    radius: float,
    max_length: float,
    rng: np.random.Generator,
) -> list[FloatArray]:
    """Detours around balls of a radius, further than it from all paths and from each other, to make `num_paths`."""
    further: list[FloatArray] = []
    samples = [sampled(path, _NUM_SAMPLES) for path in paths]
    for detour in _detours_around_balls(
        roadmap, classes, radius=radius, max_length=max_length, attempts=_ATTEMPTS_PER_PATH * num_paths, rng=rng
    ):
        path, sample = roadmap.vertices[detour.path], np.zeros((0, 2))
        for pieces in (1, _PIECES):  # the first is cheap and enough to see that most are nothing new
            path = _straightened(roadmap, rays, path, pieces=pieces, centres=detour.centres, radius=radius)
            sample = sampled(path, _NUM_SAMPLES)
            if any(shapes.frechet_distance(sample, other) <= radius for other in samples):
                break
        else:
            further.append(path)
            samples.append(sample)
        if len(samples) == num_paths:
            break
    return further


@dataclass(frozen=True, eq=False)
class _Detour:
    """A path on the roadmap that avoids some balls."""

    path: list[int]
    centres: FloatArray  # of the balls, shape (B, 2)
    blocked: BoolArray  # the edges that enter a ball, shape (E,)


def _detours_around_balls(
    roadmap: Roadmap,
    paths: list[list[int]],
    *,
    radius: float,
    max_length: float,
    attempts: int,
    rng: np.random.Generator,
) -> Iterator[_Detour]:
    """Variations of some paths, then variations of these, and again from the first once none is left to vary."""
    starts, ends = roadmap.vertices[roadmap.edges[:, 0]], roadmap.vertices[roadmap.edges[:, 1]]
    start, goal = roadmap.vertices[:2]
    none = np.zeros(len(roadmap.edges), dtype=np.bool_)
    queue: deque[_Detour] = deque()
    for attempt in range(attempts):
        if not queue:
            queue.extend(_Detour(path, np.zeros((0, 2)), none) for path in paths)
        detour = queue[0] if attempt % _BALLS_PER_PATH < _BALLS_PER_PATH - 1 else queue.popleft()
        waypoints = roadmap.vertices[detour.path]
        centre = stations(waypoints, rng.uniform(0, path_length(waypoints), 1)).positions[0]
        if min(np.linalg.norm(centre - start), np.linalg.norm(centre - goal)) <= radius:
            continue  # it would leave no way out or in
        blocked = detour.blocked | (distances_to_segments(centre, starts, ends) <= radius)
        path = roadmap.shortest_path(blocked=blocked, max_length=max_length)
        if path is not None:
            queue.append(_Detour(path, np.vstack([detour.centres, centre]), blocked))
            yield queue[-1]


def _straightened(
    roadmap: Roadmap,
    rays: Rays,
    path: FloatArray,
    *,
    pieces: int = 1,
    centres: FloatArray | None = None,
    radius: float = 0.0,
) -> FloatArray:
    """The shortest of the polylines through some points of a path that is free, in its class, and clear of balls.

    Parameters
    ----------
    path : shape (waypoints, 2)
        Free.
    pieces
        Equal ones, into which each leg is cut; their ends are the points to choose from.
    centres, radius
        Of the balls.
    """
    places = subdivided(path, pieces)
    words = [Word()]  # so far, by place
    for letters in rays.crossings(places[:-1], places[1:]):
        words.append(joined(words[-1], letters))
    first, last = np.triu_indices(len(places), k=1)
    near = last - first <= _LOOKAHEAD
    first, last = first[near], last[near]
    allowed = roadmap.world.segments_free(places[first], places[last], roadmap.robot_radius)
    for centre in () if centres is None else centres:
        allowed &= distances_to_segments(centre, places[first], places[last]) > radius
    allowed |= (first % pieces == 0) & (last - first == pieces)  # the path's own legs
    first, last = first[allowed], last[allowed]
    lengths: list[float] = np.linalg.norm(places[last] - places[first], axis=1).tolist()
    pairs: list[list[int]] = np.stack([first, last], axis=1).tolist()
    best = [0.0] + [math.inf] * (len(places) - 1)  # length of the best way to each place
    before = [0] * len(places)
    for (i, j), length, letters in zip(pairs, lengths, rays.crossings(places[first], places[last]), strict=True):
        if best[i] + length < best[j] and joined(words[i], letters) == words[j]:  # best[i] is final: i ascends
            best[j], before[j] = best[i] + length, i
    kept = [len(places) - 1]
    while kept[-1] > 0:
        kept.append(before[kept[-1]])
    return places[kept[::-1]]
