"""Probabilistic roadmaps: places where the robot fits, joined by straight ways that it can drive.

Three kinds of places, beside start and goal:

- one in every passage (`passages`), linked so that all homotopy classes of paths are there;
- those at the corners of obstacles (`corners`), joined by tangents to ever more of their neighbours until the shortest
  path stops improving;
- random ones (denser around start and goal where the world is much larger than their distance), for variety: PRM*
  (Karaman and Frazzoli, "Sampling-based algorithms for optimal motion planning", IJRR 2011) joins each to its
  k = e (1 + 1/2) ln V nearest ones of V in two dimensions, as far as the straight way between them is free.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree
from shapely import Polygon

from topobelief.arrays import BoolArray, FloatArray, IntArray, frozen_floats
from topobelief.candidates.corners import Corners, find_corners, tangents
from topobelief.candidates.passages import find_passages
from topobelief.errors import InvalidInputError, InvalidMapError, PlanningError, require_positive
from topobelief.wording import counted
from topobelief.world import World, shapes
from topobelief.world.free_places import nearest_free_place

_dijkstra = cast("Any", dijkstra)  # whose stub refuses one index
_FEW_NEIGHBOURS = 64  # of each corner, tried first
_MANY_NEIGHBOURS = 512  # of each corner, tried at most
_IMPROVEMENT = 0.005  # of the shortest path's length, below which more neighbours are not worth it
_CORNERS_PER_VERTEX = 8  # at most, per vertex asked for
_ROOM_FOR_CORNERS = 1.25  # robot radii; in a passage with less room there is no place for two corners
_MAX_DRAWS = 4  # times the random places asked for
_FAR_DRAWS = 64  # places among which one far from the start is taken
_WIDTH_ACCURACY = 1e-4  # relative, to which the width of a passage is found
_FINE_CHORDS = 64  # for a quarter circle, off it by less than that
_LEAST_ROOM = 2e-4  # of the radius: what is left at a passage by the largest radius that is tried
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
        if np.abs(ends - self.vertices[:2]).max() <= _SAME_PLACE:
            return self
        vertices = np.concatenate([ends, self.vertices])
        joined = free_edges(self.world, vertices, self.robot_radius, of=np.arange(2))
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
    goal: ArrayLike | None = None,
    num_vertices: int = 1000,
    robot_radius: float = 0.35,
    seed: int = 0,
) -> Roadmap:
    """A roadmap in which start and goal connect, with all homotopy classes of paths between them.

    Parameters
    ----------
    world
    start, goal : shape (2,) or (3,)
        Where the robot's centre is and shall be, metres; a heading is ignored. Without a goal the roadmap is one for trips to
        anywhere: its second vertex is a place that is far from the start.
    num_vertices
        At least. The places in passages and at corners are as many as the world has, corners up to 8 times this number.
        What they leave of it, half of it at the least, are random places: variety within a class of paths. The roadmap
        grows by itself, whatever the number: each corner is joined to twice as many of its neighbours, up to 512, until
        the shortest path improves by less than half a percent. In forests of pillars it then was within 1 % of the
        shortest there is.
    robot_radius
        Metres; the robot is a disc.
    seed
        The same seed gives the same roadmap. It draws the random places.

    Returns
    -------
    Roadmap
        Every edge keeps the robot's centre more than its radius from all obstacles and from the bounds. Where the robot
        hardly fits at all, the vertices may be fewer.

    Raises
    ------
    PlanningError
        Where start or goal is out of bounds or in collision, or the goal cannot be reached: names the place, the
        clearance and a radius that gets through.
    """
    if num_vertices < 2:
        raise InvalidInputError(f"expected at least 2 vertices, start and goal, got {num_vertices}")
    goal = _far_place(world, start, robot_radius, seed) if goal is None else goal
    ends = checked_ends(world, start, goal, robot_radius)
    region = world.component(ends[0], robot_radius)
    if region.distance(shapes.point(ends[1])) > _SAME_PLACE:
        raise PlanningError(_unreachable(world, ends, robot_radius))
    places, links = find_passages(world, region, ends, robot_radius)
    corners = find_corners(world, region, ends, robot_radius, _CORNERS_PER_VERTEX * num_vertices)
    draws = max(num_vertices - len(places) - len(corners.places), num_vertices // 2)
    drawn = _random_places(world, region, ends, draws, robot_radius, rng=np.random.default_rng(seed))
    spread = np.concatenate([places, drawn])
    unlinked = np.r_[0, 1, np.arange(len(places), len(spread))]
    edges = np.concatenate([links, free_edges(world, spread, robot_radius, of=unlinked)])
    vertices = np.concatenate([spread, corners.places])
    roadmap = Roadmap(world, float(robot_radius), region, vertices, _each_once(edges))
    tight = world.clearance(places) < _ROOM_FOR_CORNERS * robot_radius
    tight[:2] = True  # start and goal
    roadmap = _with_tangents(roadmap, np.flatnonzero(tight), corners)
    if roadmap.shortest_path() is None:
        raise PlanningError(_unreachable(world, ends, robot_radius))
    return roadmap


def _with_tangents(roadmap: Roadmap, others: IntArray, corners: Corners) -> Roadmap:
    """The roadmap with tangents between its corners, to ever more neighbours until its shortest path stays as it is.

    Parameters
    ----------
    roadmap
        Its last vertices are the corners.
    others
        Vertices that are no corners and take part: start, goal and those where corners have no room.
    corners
    """
    vertices, num_corners = roadmap.vertices, len(corners.places)
    bends = np.r_[others, np.arange(len(vertices) - num_corners, len(vertices))]
    no_outline = np.repeat(vertices[others, None], 2, axis=1)
    corners = Corners(vertices[bends], np.concatenate([no_outline, corners.beside]))
    tried, number, length = 1, _FEW_NEIGHBOURS, math.inf
    while True:
        joined = bends[tangents(roadmap.world, corners, roadmap.robot_radius, range(tried, number + 1))]
        roadmap = replace(roadmap, edges=_each_once(np.concatenate([roadmap.edges, joined])))
        before, length = length, float(roadmap.distances_to(0)[1])
        if number >= min(len(bends), _MANY_NEIGHBOURS) or not length < (1 - _IMPROVEMENT) * before:
            return roadmap
        tried, number = number + 1, 2 * number


def _each_once(edges: IntArray) -> IntArray:
    """The edges sorted, shape (E, 2), smaller index first."""
    return np.unique(np.sort(edges, axis=1), axis=0)


def checked_ends(world: World, start: ArrayLike, goal: ArrayLike, robot_radius: float) -> FloatArray:
    """Start and goal as rows of an array of shape (2, 2).

    Raises
    ------
    PlanningError
        Where one of them is out of bounds or in collision, or both are the same place.
    """
    require_positive("a robot radius", robot_radius, unit="m")
    ends = np.stack([_checked_place(start, "start"), _checked_place(goal, "goal")])
    _require_room(world, "start", ends[0], robot_radius)
    _require_room(world, "goal", ends[1], robot_radius, reachable_from=ends[0])
    if np.linalg.norm(ends[1] - ends[0]) <= _SAME_PLACE:
        raise PlanningError(f"expected a goal away from the start, got {_place(ends[1])} for both; choose another goal")
    return ends


def _require_room(
    world: World, name: str, place: FloatArray, robot_radius: float, *, reachable_from: FloatArray | None = None
) -> None:
    """Raise where a place is out of bounds or in collision; names the nearest one that is not."""
    x_min, y_min, x_max, y_max = world.bounds
    (x, y), clearance = place.tolist(), float(world.clearance(place[None])[0])
    if x_min <= x <= x_max and y_min <= y <= y_max:
        if clearance > robot_radius:
            return
        where = "in an obstacle or unknown space" if clearance <= 0 else f"{clearance:.2f} m from the nearest obstacle"
        problem = f"with more clearance than the robot's radius of {robot_radius:g} m, got {_place(place)}, {where}"
    else:
        problem = f"on the map, x {x_min:g} to {x_max:g} and y {y_min:g} to {y_max:g}, got {_place(place)}"
    nearest = nearest_free_place(world, place, robot_radius, reachable_from=reachable_from)
    if nearest is None:
        advice = "choose a smaller radius: there is no room for the robot anywhere"
    else:
        x, y = nearest.tolist()
        advice = f"choose the nearest free place, {x:g} {y:g}, {np.linalg.norm(nearest - place):.2f} m away"
    raise PlanningError(f"expected a {name} {problem}; {advice}")


def _checked_place(place: ArrayLike, name: str) -> FloatArray:
    array = frozen_floats(place, name=name)
    if array.shape not in ((2,), (3,)) or not np.isfinite(array).all():
        raise InvalidInputError(f"expected a finite {name} (x, y) or (x, y, theta), got {array.tolist()}")
    return array[:2]


def _far_place(world: World, start: ArrayLike, robot_radius: float, seed: int) -> FloatArray:
    """Of places drawn where the robot can go, the one furthest from the start; the start itself where none is free."""
    place = _checked_place(start, "start")
    region = world.component(place, robot_radius)
    triangles = np.concatenate([shapes.triangles(polygon) for polygon in shapes.polygons(region)])
    drawn = _uniform(triangles, _FAR_DRAWS, rng=np.random.default_rng(seed))
    drawn = drawn[world.segments_free(drawn, drawn, robot_radius)]
    return drawn[np.argmax(np.linalg.norm(drawn - place, axis=1))] if len(drawn) else place


def _random_places(
    world: World, region: Polygon, ends: FloatArray, count: int, robot_radius: float, *, rng: np.random.Generator
) -> FloatArray:
    """Random places that the robot's centre can reach; shape (count, 2), or less where it hardly fits.

    Half of them are uniform over the region, half over what lies around start and goal, up to their distance away.
    """
    margin = np.linalg.norm(ends[1] - ends[0])
    around = shapes.within(region, np.concatenate([ends.min(axis=0) - margin, ends.max(axis=0) + margin]))
    shares: list[FloatArray] = []
    for size, part in ((count // 2, region), (count - count // 2, around)):
        triangles = np.concatenate([shapes.triangles(polygon) for polygon in shapes.polygons(part)])
        places = _uniform(triangles, _MAX_DRAWS * size, rng=rng)
        shares.append(places[world.segments_free(places, places, robot_radius)][:size])
    return np.concatenate(shares)


def _uniform(triangles: FloatArray, count: int, *, rng: np.random.Generator) -> FloatArray:
    """Places at random in triangles, shape (T, 3, 2), as many to each area."""
    a, b, c = triangles.transpose(1, 0, 2)
    (x_b, y_b), (x_c, y_c) = (b - a).T, (c - a).T
    area = np.abs(x_b * y_c - y_b * x_c)
    chosen = rng.choice(len(triangles), size=count, p=area / area.sum())
    shares = rng.uniform(size=(2, count, 1))
    shares = np.where(shares.sum(axis=0) > 1, 1 - shares, shares)  # from the parallelogram back to the triangle
    return a[chosen] + shares[0] * (b - a)[chosen] + shares[1] * (c - a)[chosen]


def free_edges(world: World, vertices: FloatArray, robot_radius: float, *, of: IntArray) -> IntArray:
    """Free edges from some vertices, shape (N,), to their nearest ones, each once; shape (E, 2)."""
    num_neighbours = math.ceil(1.5 * math.e * math.log(len(vertices)))  # k of PRM*, d = 2
    num_neighbours = min(num_neighbours, len(vertices) - 1)
    _, neighbours = KDTree(vertices).query(vertices[of], k=num_neighbours + 1)  # itself among them
    pairs = np.stack([np.repeat(of, num_neighbours + 1), np.ravel(neighbours)], axis=1)
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    free = world.segments_free(vertices[pairs[:, 0]], vertices[pairs[:, 1]], robot_radius)
    return pairs[free]


def _unreachable(world: World, ends: FloatArray, robot_radius: float) -> str:
    """Why the goal cannot be reached, with the largest radius that gets there."""
    widest = _widest(world, ends, robot_radius)
    if not widest:
        cause = "walls separate them for a robot of any size; choose another goal"
    else:
        fits = _largest_radius(world, ends, widest)
        named = f"a radius of {fits:g} m would get through" if fits else "only a much smaller one would get through"
        cause = f"it does not fit through the passages, which are too narrow; {named}"
    return (
        f"expected a goal that a robot of radius {robot_radius:g} m can reach from the start {_place(ends[0])}, "
        f"got {_place(ends[1])}: {cause}"
    )


def _widest(world: World, ends: FloatArray, below: float) -> float:
    """The clearance of the way that is nowhere narrower than need be, up to a radius, metres; 0 where there is no way."""
    if not _joined(world, ends, 0.0):
        return 0.0
    low, high = 0.0, below
    while high - low > _WIDTH_ACCURACY * high:
        middle = (low + high) / 2
        low, high = (middle, high) if _joined(world, ends, middle) else (low, middle)
    return high


def _joined(world: World, ends: FloatArray, radius: float) -> bool:
    """Whether a disc fits through between start and goal, by a region that is exact but for fine chords."""
    region = shapes.eroded(world.free, radius, quadrant_chords=_FINE_CHORDS)
    part = shapes.nearest_part(region, ends[0])
    return part is not None and part.distance(shapes.point(ends[1])) <= _WIDTH_ACCURACY * radius + _SAME_PLACE


def _largest_radius(world: World, ends: FloatArray, widest: float) -> float:
    """The largest radius in four digits for which a way is found, metres, next to what fits; 0 where none is.

    What fits with next to no room need not be found: each try leaves twice as much room as the last one.
    """
    room = _LEAST_ROOM
    while room < 1:
        radius = (1 - room) * widest
        unit = 10.0 ** (math.floor(math.log10(radius)) - 3)
        radius = float(f"{math.floor(radius / unit) * unit:.4g}")  # a number that reads as it is
        if _passes(world, ends, radius):
            return radius
        room *= 2
    return 0.0


def _passes(world: World, ends: FloatArray, radius: float) -> bool:
    """Whether there is a way by way of the passages."""
    try:
        region = world.component(ends[0], radius)
    except InvalidMapError:
        return False
    if region.distance(shapes.point(ends[1])) > _SAME_PLACE:
        return False
    places, links = find_passages(world, region, ends, radius)
    return Roadmap(world, radius, region, places, links).shortest_path() is not None


def _place(place: Sequence[float] | FloatArray) -> str:
    return f"({place[0]:g}, {place[1]:g})"
