"""Roadmaps in space: PRM* (Karaman and Frazzoli, IJRR 2011) in three dimensions.

Around a trajectory the roadmap begins with places along it, joined as the robot drove, so that all that it has been to is
connected. Among cubes it has random places alone, and grows until start and goal are connected: there are no passages to be
found as there are in the plane (`passages`), and no homotopy classes to be told apart by obstacles that float. In the end the
shortest way is straightened and joins the roadmap: through random places it is a sixth too long.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray
from topobelief.candidates.diverse_paths import diverse_paths
from topobelief.candidates.ends import checked_ends, checked_place, shown_place
from topobelief.candidates.roadmap_graph import Roadmap, each_once, free_edges, with_way
from topobelief.errors import PlanningError
from topobelief.world import World3D

_MAX_DRAWS = 4  # times the random places asked for
_FAR_DRAWS = 64  # places among which one far from the start is taken
_MOST_DOUBLINGS = 4  # of the random places, until start and goal are connected
_AROUND = 1.0  # distances between start and goal: so far around them half of the random places are


def build_roadmap_3d(
    world: World3D, start: ArrayLike, goal: ArrayLike | None, num_vertices: int, robot_radius: float, seed: int
) -> Roadmap:
    """A roadmap in space in which start and goal connect; parameters as for `build_roadmap`.

    Raises
    ------
    PlanningError
        Where start or goal is in collision, or no way from one to the other was found.
    """
    rng = np.random.default_rng(seed)
    if goal is None:
        goal = _far_place(world, checked_place(world, start, "start"), robot_radius, rng=rng)
    ends = checked_ends(world, start, goal, robot_radius)
    along, links = world.backbone(robot_radius)
    fixed = np.concatenate([ends, along])
    count = max(num_vertices - len(fixed), num_vertices // 2)
    vertices = fixed
    for _ in range(_MOST_DOUBLINGS + 1):
        vertices = np.concatenate([vertices, _random_places(world, ends, count, robot_radius, rng=rng)])
        unlinked = np.r_[0, 1, np.arange(len(fixed), len(vertices))]
        edges = each_once(np.concatenate([links + 2, free_edges(world, vertices, robot_radius, of=unlinked)]))
        roadmap = Roadmap(world, float(robot_radius), None, vertices, edges)
        if roadmap.shortest_path() is not None:
            straightened = diverse_paths(roadmap, *ends, num_paths=1)[0]
            return with_way(roadmap, straightened)[0]
        count = len(vertices)
    raise PlanningError(
        f"expected a goal that a robot of radius {robot_radius:g} m can reach from the start {shown_place(ends[0])}, got "
        f"{shown_place(ends[1])}, to which {len(vertices)} places have no way; choose another goal or a smaller radius, or "
        "ask for more vertices"
    )


def _far_place(world: World3D, start: FloatArray, robot_radius: float, *, rng: np.random.Generator) -> FloatArray:
    """Of places drawn where the robot has room, the one furthest from the start; the start itself where none has."""
    drawn = world.drawn(_FAR_DRAWS, robot_radius, rng=rng)
    drawn = drawn[world.segments_free(drawn, drawn, robot_radius)]
    return drawn[np.argmax(np.linalg.norm(drawn - start, axis=1))] if len(drawn) else start


def _random_places(
    world: World3D, ends: FloatArray, count: int, robot_radius: float, *, rng: np.random.Generator
) -> FloatArray:
    """Random places with room for the robot, half of them anywhere, half around start and goal; shape (count, 3), or fewer."""
    centre, apart = ends.mean(axis=0), float(np.linalg.norm(ends[1] - ends[0]))
    shares: list[FloatArray] = []
    for size, reach in ((count // 2, np.inf), (count - count // 2, (0.5 + _AROUND) * apart)):
        drawn = world.drawn(_MAX_DRAWS * size, robot_radius, rng=rng, centre=centre, reach=reach)
        shares.append(drawn[world.segments_free(drawn, drawn, robot_radius)][:size])
    return np.concatenate(shares)
