"""Probabilistic roadmaps: places where the robot fits, joined by straight ways that it can drive.

Three kinds of places, beside start and goal:

- one in every passage (`passages`), linked so that all homotopy classes of paths are there;
- those at the corners of obstacles (`corners`), joined by tangents to ever more of their neighbours until the shortest
  path stops improving;
- random ones (denser around start and goal where the world is much larger than their distance), for variety: PRM*
  (Karaman and Frazzoli, "Sampling-based algorithms for optimal motion planning", IJRR 2011) joins each to its
  k = e (1 + 1/d) ln V nearest ones of V in d dimensions, as far as the straight way between them is free.

In space there are no passages and corners to be found: see `roadmap_3d`.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from shapely import Polygon

from topobelief.arrays import FloatArray, IntArray
from topobelief.candidates.corners import Corners, find_corners, tangents
from topobelief.candidates.ends import SAME_PLACE, checked_ends, checked_place, shown_place
from topobelief.candidates.passages import find_passages
from topobelief.candidates.roadmap_3d import build_roadmap_3d
from topobelief.candidates.roadmap_graph import Roadmap, each_once, free_edges
from topobelief.errors import InvalidInputError, InvalidMapError, PlanningError
from topobelief.world import FreeSpace, World, World3D, shapes

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


def build_roadmap(
    world: FreeSpace,
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
        Where the robot's centre is and shall be, metres; in the plane a heading is ignored, in space these are x, y, z. Without
        a goal the roadmap is one for trips to anywhere: its second vertex is a place that is far from the start.
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
    if isinstance(world, World3D):
        return build_roadmap_3d(world, start, goal, num_vertices, robot_radius, seed)
    if not isinstance(world, World):
        raise InvalidInputError(f"expected a World or a World3D, got {type(world).__name__}")
    goal = _far_place(world, start, robot_radius, seed) if goal is None else goal
    ends = checked_ends(world, start, goal, robot_radius)
    region = world.component(ends[0], robot_radius)
    if region.distance(shapes.point(ends[1])) > SAME_PLACE:
        raise PlanningError(_unreachable(world, ends, robot_radius))
    places, links = find_passages(world, region, ends, robot_radius)
    corners = find_corners(world, region, ends, robot_radius, _CORNERS_PER_VERTEX * num_vertices)
    draws = max(num_vertices - len(places) - len(corners.places), num_vertices // 2)
    drawn = _random_places(world, region, ends, draws, robot_radius, rng=np.random.default_rng(seed))
    spread = np.concatenate([places, drawn])
    unlinked = np.r_[0, 1, np.arange(len(places), len(spread))]
    edges = np.concatenate([links, free_edges(world, spread, robot_radius, of=unlinked)])
    vertices = np.concatenate([spread, corners.places])
    roadmap = Roadmap(world, float(robot_radius), region, vertices, each_once(edges))
    tight = world.clearance(places) < _ROOM_FOR_CORNERS * robot_radius
    tight[:2] = True  # start and goal
    roadmap = _with_tangents(world, roadmap, np.flatnonzero(tight), corners)
    if roadmap.shortest_path() is None:
        raise PlanningError(_unreachable(world, ends, robot_radius))
    return roadmap


def _with_tangents(world: World, roadmap: Roadmap, others: IntArray, corners: Corners) -> Roadmap:
    """The roadmap with tangents between its corners, to ever more neighbours until its shortest path stays as it is.

    Parameters
    ----------
    world
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
        joined = bends[tangents(world, corners, roadmap.robot_radius, range(tried, number + 1))]
        roadmap = replace(roadmap, edges=each_once(np.concatenate([roadmap.edges, joined])))
        before, length = length, float(roadmap.distances_to(0)[1])
        if number >= min(len(bends), _MANY_NEIGHBOURS) or not length < (1 - _IMPROVEMENT) * before:
            return roadmap
        tried, number = number + 1, 2 * number


def _far_place(world: World, start: ArrayLike, robot_radius: float, seed: int) -> FloatArray:
    """Of places drawn where the robot can go, the one furthest from the start; the start itself where none is free."""
    place = checked_place(world, start, "start")
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
        f"expected a goal that a robot of radius {robot_radius:g} m can reach from the start {shown_place(ends[0])}, "
        f"got {shown_place(ends[1])}: {cause}"
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
    return part is not None and part.distance(shapes.point(ends[1])) <= _WIDTH_ACCURACY * radius + SAME_PLACE


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
    if region.distance(shapes.point(ends[1])) > SAME_PLACE:
        return False
    places, links = find_passages(world, region, ends, radius)
    return Roadmap(world, radius, region, places, links).shortest_path() is not None
