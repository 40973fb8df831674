"""Probabilistic roadmaps: random places where the robot fits, joined by straight ways that it can drive.

PRM* (Karaman and Frazzoli, "Sampling-based algorithms for optimal motion planning", IJRR 2011): vertices at random over
what the robot can reach (denser around start and goal where the world is much larger than their distance), each joined
to its k = e (1 + 1/2) ln V nearest ones (d = 2), as far as the straight way between them is free. Whether start and goal
connect at all is decided before any vertex is drawn, by eroding the world; the roadmap then grows until they connect in
it too, and with them nearly all that is in reach. Narrow passages get vertices of their own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree
from shapely import Polygon

from topobelief.arrays import BoolArray, FloatArray, IntArray, frozen_floats
from topobelief.candidates.passages import narrow_passages
from topobelief.errors import InvalidInputError, InvalidMapError, PlanningError
from topobelief.world import World, shapes

_dijkstra = cast("Any", dijkstra)  # whose stub refuses one index
_CONNECTED_SHARE = 0.9  # of the vertices, all of them within reach, that hang together on a roadmap that is dense enough
_MAX_GROWTH = 16  # times the vertices asked for, after which a passage counts as too narrow for chance to find
_MAX_GROWTH_CONNECTED = 4  # the same, where start and goal connect already
_MAX_DRAWS = 100_000  # random places at a time
_MAX_DRAWS_PER_PLACE = 10_000  # in which the robot fits; where it takes more, it fits hardly anywhere
_SAME_PLACE = 1e-9  # metres


@dataclass(frozen=True, eq=False)
class Roadmap:
    """Places and the free straight ways between them; `build_roadmap` makes one.

    Attributes
    ----------
    world, robot_radius
        What the ways are free of collisions in, and for how large a robot (metres).
    region
        What the robot's centre can reach (see `World.component`); its holes are the obstacles to go around.
    vertices : shape (V, 2)
        The first is the start, the second the goal.
    edges : shape (E, 2)
        Undirected, each once, smaller index first.
    """

    world: World
    robot_radius: float
    region: Polygon
    vertices: FloatArray
    edges: IntArray

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
        limit = min(max_length, float(self.lengths.sum()))  # finite, so that a blocked edge is never taken
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

    def between(self, start: ArrayLike, goal: ArrayLike) -> Roadmap:
        """The same roadmap for another start and goal, which join it as its first two vertices.

        Raises
        ------
        PlanningError
            Where one of them is in collision or cannot be joined.
        """
        ends = checked_ends(self.world, start, goal, self.robot_radius)
        if np.abs(ends - self.vertices[:2]).max() <= _SAME_PLACE:
            return self
        vertices = np.concatenate([ends, self.vertices])
        joined = _free_edges(self.world, vertices, self.robot_radius, of=np.arange(2))
        edges = np.unique(np.concatenate([joined, self.edges + 2]), axis=0)
        roadmap = Roadmap(self.world, self.robot_radius, self.region, vertices, edges)
        if roadmap.shortest_path() is None:
            raise PlanningError(
                f"expected a start and a goal that join the roadmap, got {_place(ends[0])} and {_place(ends[1])}, "
                "between which it has no way; build a roadmap for them"
            )
        return roadmap


def build_roadmap(
    world: World,
    start: ArrayLike,
    goal: ArrayLike,
    num_vertices: int = 1000,
    robot_radius: float = 0.35,
    seed: int = 0,
) -> Roadmap:
    """A roadmap in which start and goal connect, with at least `num_vertices` vertices.

    Parameters
    ----------
    world
    start, goal : shape (2,) or (3,)
        Where the robot's centre is and shall be, metres; a heading is ignored.
    num_vertices
        At least; the roadmap doubles until start and goal connect, and 9 of 10 vertices with them (for the latter to 4
        times the number at most).
    robot_radius
        Metres; the robot is a disc.
    seed
        The same seed gives the same roadmap.

    Returns
    -------
    Roadmap
        Every edge keeps the robot's centre more than its radius from all obstacles and from the bounds. Where the robot
        hardly fits at all, the vertices may be fewer.

    Raises
    ------
    PlanningError
        Where start or goal is out of bounds or in collision, or the goal cannot be reached: names the place, the
        clearance and the radius that would do.
    """
    if num_vertices < 2:
        raise InvalidInputError(f"expected at least 2 vertices, start and goal, got {num_vertices}")
    ends = checked_ends(world, start, goal, robot_radius)
    region = world.component(ends[0], robot_radius)
    if region.distance(shapes.point(ends[1])) > _SAME_PLACE:
        raise PlanningError(_unreachable(world, ends, robot_radius))
    rng = np.random.default_rng(seed)
    passages = _reachable(world, region, narrow_passages(world, robot_radius), robot_radius)
    vertices = np.concatenate([ends, passages])
    size = num_vertices
    while True:
        draws = max(size - len(vertices), size // 2)
        vertices = np.concatenate([vertices, _random_places(world, region, ends, draws, robot_radius, rng=rng)])
        edges = _free_edges(world, vertices, robot_radius)
        roadmap = Roadmap(world, float(robot_radius), region, vertices, edges)
        reached = np.isfinite(roadmap.distances_to(0))
        if reached[1] and (np.mean(reached) >= _CONNECTED_SHARE or size >= _MAX_GROWTH_CONNECTED * num_vertices):
            return roadmap
        if size >= _MAX_GROWTH * num_vertices:
            raise PlanningError(
                f"expected a way from the start {_place(ends[0])} to the goal {_place(ends[1])}, found none with {size} "
                f"vertices: some passage is hardly wider than the robot of radius {robot_radius:g} m; "
                "plan with a smaller radius or with more vertices"
            )
        size *= 2


def checked_ends(world: World, start: ArrayLike, goal: ArrayLike, robot_radius: float) -> FloatArray:
    """Start and goal as rows of an array of shape (2, 2).

    Raises
    ------
    PlanningError
        Where one of them is out of bounds or in collision, or both are the same place.
    """
    if not (np.isfinite(robot_radius) and robot_radius > 0):
        raise InvalidInputError(f"expected a robot radius above 0 m, got {robot_radius}")
    ends = np.stack([_checked_place(start, "start"), _checked_place(goal, "goal")])
    for name, place, clearance in zip(("start", "goal"), ends, world.clearance(ends).tolist(), strict=True):
        x_min, y_min, x_max, y_max = world.bounds
        x, y = place.tolist()
        if not (x_min <= x <= x_max and y_min <= y <= y_max):
            raise PlanningError(
                f"expected a {name} on the map, x {x_min:g} to {x_max:g} and y {y_min:g} to {y_max:g}, got {_place(place)}; "
                "choose a place on the map"
            )
        if clearance <= robot_radius:
            where = "in an obstacle or unknown space" if clearance <= 0 else f"{clearance:.2f} m from the nearest obstacle"
            raise PlanningError(
                f"expected a {name} with more clearance than the robot's radius of {robot_radius:g} m, "
                f"got {_place(place)}, {where}; choose a place in the open or a smaller radius"
            )
    if np.linalg.norm(ends[1] - ends[0]) <= _SAME_PLACE:
        raise PlanningError(f"expected a goal away from the start, got {_place(ends[1])} for both; choose another goal")
    return ends


def _checked_place(place: ArrayLike, name: str) -> FloatArray:
    array = frozen_floats(place, name=name)
    if array.shape not in ((2,), (3,)) or not np.isfinite(array).all():
        raise InvalidInputError(f"expected a finite {name} (x, y) or (x, y, theta), got {array.tolist()}")
    return array[:2]


def _random_places(
    world: World, region: Polygon, ends: FloatArray, count: int, robot_radius: float, *, rng: np.random.Generator
) -> FloatArray:
    """Random places that the robot's centre can reach; shape (count, 2), or less where it hardly fits.

    Half of them are uniform over the region, half over what lies around start and goal, up to their distance away.
    """
    corners = np.array(region.bounds).reshape(2, 2)
    margin = np.linalg.norm(ends[1] - ends[0])
    around = np.clip([ends.min(axis=0) - margin, ends.max(axis=0) + margin], *corners)
    shares: list[FloatArray] = []
    for size, (low, high) in ((count // 2, corners), (count - count // 2, around)):
        found, drawn = np.zeros((0, 2)), 0
        while len(found) < size and drawn <= _MAX_DRAWS_PER_PLACE * (len(found) + 1):
            places = rng.uniform(low, high, size=(min(2 * size + drawn, _MAX_DRAWS), 2))
            drawn += len(places)
            found = np.concatenate([found, _reachable(world, region, places, robot_radius)])
        shares.append(found[:size])
    return np.concatenate(shares)


def _reachable(world: World, region: Polygon, places: FloatArray, robot_radius: float) -> FloatArray:
    """Those of the places, shape (N, 2), that the robot's centre can be at and get to."""
    places = places[shapes.Region(region).contains(places)]
    return places[world.segments_free(places, places, robot_radius)]


def _free_edges(world: World, vertices: FloatArray, robot_radius: float, *, of: IntArray | None = None) -> IntArray:
    """Free edges from each vertex (or from those in `of`) to its nearest ones, each once; shape (E, 2)."""
    sources = np.arange(len(vertices)) if of is None else of
    num_neighbours = math.ceil(1.5 * math.e * math.log(len(vertices)))  # k of PRM*, d = 2
    num_neighbours = min(num_neighbours, len(vertices) - 1)
    _, neighbours = KDTree(vertices).query(vertices[sources], k=num_neighbours + 1)  # itself among them
    pairs = np.stack([np.repeat(sources, num_neighbours + 1), np.ravel(neighbours)], axis=1)
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    free = world.segments_free(vertices[pairs[:, 0]], vertices[pairs[:, 1]], robot_radius)
    return pairs[free]


def _unreachable(world: World, ends: FloatArray, robot_radius: float) -> str:
    """Why the goal cannot be reached, with the largest radius that would get there (by bisection)."""
    low, high = 0.0, robot_radius
    if not _connects(world, ends, low):
        cause = "walls separate them for a robot of any size; choose another goal"
    else:
        while high - low > 0.05 * robot_radius:
            middle = (low + high) / 2
            low, high = (middle, high) if _connects(world, ends, middle) else (low, middle)
        cause = f"the passages are too narrow; a radius of some {low:.2f} m would get through"
    return (
        f"expected a goal that a robot of radius {robot_radius:g} m can reach from the start {_place(ends[0])}, "
        f"got {_place(ends[1])}: {cause}"
    )


def _connects(world: World, ends: FloatArray, radius: float) -> bool:
    try:
        return world.component(ends[0], radius).distance(shapes.point(ends[1])) <= _SAME_PLACE
    except InvalidMapError:
        return False


def _place(place: Sequence[float] | FloatArray) -> str:
    return f"({place[0]:g}, {place[1]:g})"
