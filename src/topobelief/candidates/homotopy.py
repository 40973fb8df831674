"""Homotopy classes of paths as words, and the shortest path of each class on a roadmap.

One ray goes up from a point within each obstacle. A path spells a word: the rays that it crosses, in order, rightward
crossings as +i and leftward ones as -i; adjacent +i -i cancel. Two paths with the same ends can be deformed into each
other without passing over an obstacle's point exactly if their reduced words are equal (the rays generate the free
fundamental group of the punctured plane; used for planning by Grigoriev and Slissenko, 1998, and Bhattacharya et al.,
"Topological constraints in search-based robot path planning", 2012).
"""

from __future__ import annotations

import heapq
import math
from collections import defaultdict
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from topobelief.arrays import BoolArray, FloatArray
from topobelief.candidates.polyline import path_length
from topobelief.candidates.roadmap_graph import Roadmap
from topobelief.world import World, shapes

Point = tuple[float, float]
Word = tuple[int, ...]  # letters ±1 … ±num_rays


@dataclass(frozen=True, eq=False)
class Rays:
    """Vertical rays, upward from one point within each obstacle.

    Attributes
    ----------
    origins : shape (R, 2)
    """

    origins: FloatArray

    @classmethod
    def of_obstacles(
        cls,
        roadmap: Roadmap,
        *,
        min_size: float = 0.0,
        max_length: float = math.inf,
        max_rays: int | None = None,
        specks: bool = False,
    ) -> Rays:
        """Rays of the obstacles whose two sides are worth distinguishing.

        Of the holes in the region that the robot's centre can reach (see `World.component`), those that measure at
        least `min_size` (corner to corner of their extent, metres) and that a path from start to goal of at most
        `max_length` can get around; and of these the `max_rays` largest.

        Which side of a speck a path takes does not matter, and a map has many from noise and the legs of furniture. So
        without `specks` a hole counts only if it holds an obstacle of at least the robot's radius, corner to corner, or
        smaller ones that the robot cannot pass between, over more than twice its diameter (a fence, say).

        In space there are none: a path can be moved over an obstacle that floats.
        """
        if roadmap.region is None or not isinstance(roadmap.world, World):
            return cls(np.zeros((0, 2)))
        start, goal = roadmap.vertices[:2]
        holes = shapes.holes(roadmap.region)
        size, points = shapes.sizes(holes), shapes.points_within(holes)
        detour = np.linalg.norm(points - start, axis=1) + np.linalg.norm(points - goal, axis=1)
        worth_it = (size >= min_size) & (detour <= max_length)
        if not specks:
            worth_it &= _matters(roadmap.world, roadmap.robot_radius, holes)
        largest_first = np.argsort(-size, kind="stable")
        return cls(points[largest_first[worth_it[largest_first]][:max_rays]])

    def crossings(self, starts: FloatArray, ends: FloatArray) -> list[Word]:
        """The letters that each segment spells, in order; shapes (N, 2).

        A point straight above an origin counts as right of it, and rays that coincide as infinitesimally apart, the
        earlier one to the left, so that no way through a vertex of the roadmap is counted twice or not at all.
        """
        if not len(self.origins):
            return [Word()] * len(starts)
        x, y = self.origins.T
        left, right = starts[:, :1] < x, ends[:, :1] < x  # which ends lie left of which ray, shape (N, R)
        segment, ray = np.nonzero(left != right)
        (x_a, y_a), (x_b, y_b) = starts[segment].T, ends[segment].T
        share = (x[ray] - x_a) / (x_b - x_a)
        above = y_a + share * (y_b - y_a) > y[ray]
        segment, ray, share = segment[above], ray[above], share[above]
        letters = np.where(left[segment, ray], ray + 1, -(ray + 1))
        order = np.lexsort((letters, share, segment))
        words: list[Word] = [()] * len(starts)
        first = np.searchsorted(segment[order], np.arange(len(starts) + 1))
        spelled = letters[order].tolist()
        for index in np.unique(segment).tolist():
            words[index] = tuple(spelled[first[index] : first[index + 1]])
        return words

    def word(self, waypoints: FloatArray) -> Word:
        """Reduced word of a polyline, shape (waypoints, 2)."""
        word: Word = ()
        for letters in self.crossings(waypoints[:-1], waypoints[1:]):
            word = joined(word, letters)
        return word


class ClassCount(NamedTuple):
    """How many homotopy classes some paths are of."""

    number: int  # about obstacles that matter to the robot
    is_exact: bool  # whether there are no more about all obstacles


def count_classes(roadmap: Roadmap, paths: list[FloatArray]) -> ClassCount:
    """Homotopy classes among paths from the start to the goal of a roadmap, each of shape (waypoints, 2)."""
    max_length = max(map(path_length, paths), default=0.0)  # what they cannot get around does not part them
    all_rays = Rays.of_obstacles(roadmap, max_length=max_length, specks=True)
    rays = Rays.of_obstacles(roadmap, max_length=max_length)
    number = len({rays.word(path) for path in paths})
    return ClassCount(number, number == len({all_rays.word(path) for path in paths}))


def joined(word: Word, letters: Word) -> Word:
    """Reduced word of one path followed by another.

    Examples
    --------
    >>> joined((1, 2), (-2, 3)), joined((1,), (-1,))
    ((1, 3), ())
    """
    result = list(word)
    for letter in letters:
        if result and result[-1] == -letter:
            result.pop()
        else:
            result.append(letter)
    return tuple(result)


def inverse(word: Word) -> Word:
    """Word of the path walked backwards."""
    return tuple(-letter for letter in reversed(word))


def shortest_paths_by_class(roadmap: Roadmap, rays: Rays, *, num_classes: int, max_length: float = math.inf) -> list[list[int]]:
    """The shortest path from start to goal in each homotopy class, shortest first.

    A* over (vertex, reduced word), with the distance to the goal as heuristic. Paths that cross themselves, as nearly all
    do that wind around an obstacle, are dropped on the way. At most `num_classes` words are expanded at a vertex, for
    these, followed by the vertex's shortest way on, are as many classes already, none longer than what a further word
    would lead to.

    Parameters
    ----------
    roadmap
        From vertex 0 to vertex 1.
    rays
    num_classes
        How many at most.
    max_length
        Metres.

    Returns
    -------
    list of vertex lists
    """
    vertices: list[Point] = [(x, y) for x, y in roadmap.vertices.tolist()]
    to_goal: list[float] = roadmap.distances_to(1).tolist()
    neighbours = _neighbours(roadmap, rays)
    words = _Words()
    reached: defaultdict[int, dict[int, float]] = defaultdict(dict, {0: {0: 0.0}})  # by word: least length to a vertex
    expanded: list[set[int]] = [set() for _ in vertices]  # by vertex: words
    trail = _Trail([0], [-1])
    queue = [(to_goal[0], 0.0, 0, 0)]  # length by way of here, length so far, step of the trail, word
    found: list[list[int]] = []
    while queue and len(found) < num_classes:
        _, length, step, word = heapq.heappop(queue)
        vertex = trail.vertex[step]
        known = expanded[vertex]
        if word in known or len(known) >= num_classes or (known and trail.crosses_itself(step, vertices)):
            continue
        known.add(word)
        if vertex == 1:
            found.append(trail.path_to(step))
        for neighbour, edge_length, letters in neighbours[vertex]:
            next_word = words.followed_by(word, letters) if letters else word
            total = length + edge_length
            if total >= reached[next_word].get(neighbour, math.inf):
                continue
            bound = total + to_goal[neighbour]
            if bound <= max_length:
                reached[next_word][neighbour] = total
                heapq.heappush(queue, (bound, total, len(trail.vertex), next_word))
                trail.vertex.append(neighbour)
                trail.before.append(step)
    return found


class _Words:
    """Reduced words by number; 0 is the empty one."""

    def __init__(self) -> None:
        self._words = [Word()]
        self._numbers = {Word(): 0}

    def followed_by(self, number: int, letters: Word) -> int:
        """The word that one followed by some letters reduces to."""
        word = joined(self._words[number], letters)
        result = self._numbers.setdefault(word, len(self._words))
        if result == len(self._words):
            self._words.append(word)
        return result


@dataclass(frozen=True, slots=True)
class _Trail:
    """Steps of a search: the vertex of each, and the step before it, -1 for none."""

    vertex: list[int]
    before: list[int]

    def path_to(self, step: int) -> list[int]:
        """Vertices from the first step to this one."""
        path: list[int] = []
        while step >= 0:
            path.append(self.vertex[step])
            step = self.before[step]
        return path[::-1]

    def crosses_itself(self, step: int, vertices: list[Point]) -> bool:
        """Whether the last edge of the path to a step crosses an earlier one, or leads to a vertex that it has been to."""
        last, joint_step = self.vertex[step], self.before[step]
        if joint_step < 0:
            return False
        joint, step = self.vertex[joint_step], self.before[joint_step]
        a, b = vertices[joint], vertices[last]
        x_min, x_max, y_min, y_max = min(a[0], b[0]), max(a[0], b[0]), min(a[1], b[1]), max(a[1], b[1])
        later, d = joint, a
        while step >= 0:
            vertex, step = self.vertex[step], self.before[step]
            c = vertices[vertex]
            apart = (
                (c[0] < x_min and d[0] < x_min)
                or (c[0] > x_max and d[0] > x_max)
                or (c[1] < y_min and d[1] < y_min)
                or (c[1] > y_max and d[1] > y_max)
            )
            if vertex == last or (not (apart or later == joint) and _cross(a, b, c, d)):
                return True
            later, d = vertex, c
        return False


def _matters(world: World, radius: float, holes: shapes.ShapeArray) -> BoolArray:
    """Which holes in the reachable region are more than specks, see `Rays.of_obstacles`; shape (N,)."""
    solid = shapes.largest_within(holes, shapes.holes(world.free))
    x_min, y_min, x_max, y_max = (shapes.extents(holes) + radius * np.array([1, 1, -1, -1])).T  # of what is in the hole
    spread = np.hypot(np.maximum(x_max - x_min, 0.0), np.maximum(y_max - y_min, 0.0))
    return (solid >= radius) | (spread > 2 * (2 * radius))


def _neighbours(roadmap: Roadmap, rays: Rays) -> list[list[tuple[int, float, Word]]]:
    """For each vertex its neighbours, the lengths of the edges to them and the letters that these spell."""
    result: list[list[tuple[int, float, Word]]] = [[] for _ in roadmap.vertices]
    a, b = roadmap.edges.T
    words = rays.crossings(roadmap.vertices[a], roadmap.vertices[b])
    pairs: list[list[int]] = roadmap.edges.tolist()
    for (i, j), length, word in zip(pairs, roadmap.lengths.tolist(), words, strict=True):
        result[i].append((j, length, word))
        result[j].append((i, length, inverse(word)))
    return result


def _cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Whether two segments, a to b and c to d, cross in their interiors."""
    return _left(a, b, c) != _left(a, b, d) and _left(c, d, a) != _left(c, d, b)


def _left(a: Point, b: Point, c: Point) -> bool:
    return (b[0] - a[0]) * (c[1] - a[1]) > (b[1] - a[1]) * (c[0] - a[0])
