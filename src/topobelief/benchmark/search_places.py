"""Where the search over a roadmap and its peers are compared: a robot with a graph, a map, a goal and a limit.

A place comes from one of

- a pose graph in a file, or a public data set by its name, optimised; its map is the file of the same name that ends in .yaml
  or .csv, or else what lies along the trajectory;
- a map, in which a drive through some random places is generated;
- grid-N: a square grid of N x N places one metre apart, as Ott, Kochenderfer and Boyd (2024) compare planners on. A robot has
  been everywhere, row by row, with noise that differs from edge to edge; it stands in one corner and is to go to the opposite
  one along the grid's edges.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from topobelief.arrays import FloatArray, IntArray
from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.learned_closures import learn_closures
from topobelief.candidates.predicted_factors import predict_actions
from topobelief.candidates.roadmap import Roadmap, build_roadmap
from topobelief.errors import FileError, InvalidInputError, PlanningError
from topobelief.estimation import optimize
from topobelief.graph.action import posterior
from topobelief.graph.information import block_isotropic
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.datasets import DATASETS, dataset_path
from topobelief.io.floor_plan import read_world
from topobelief.io.formats import read_pose_graph
from topobelief.world import World
from topobelief.world.free_places import nearest_free_place

_MAPS = (".yaml", ".yml", ".csv")
_GRID = re.compile(r"grid-(\d+)")
_SMALLEST_GRID, _LARGEST_GRID = 3, 40
_ROBOT_RADIUS = 0.35  # metres
_NOISE = (0.1, 0.035)  # metres and radians, of generated graphs
_LEGS = 12  # of a generated drive
_SAME_WAY = 0.2  # share by which the way to a goal may differ from the one asked for


@dataclass(frozen=True, eq=False, slots=True)
class SearchPlace:
    """A robot at the last pose of its graph that is to drive to a goal.

    Attributes
    ----------
    name
    graph
        At its estimate.
    world
        What poses must see each other in; None: they always do.
    roadmap
        From the robot, its first vertex, to the goal, its second.
    closures
        Which loops new poses close.
    """

    name: str
    graph: PoseGraph
    world: World | None
    roadmap: Roadmap
    closures: ClosureModel


def checked_source(source: str) -> str:
    """A source of places that exists.

    Raises
    ------
    InvalidInputError
        For a grid that is too small or too large, or a data set that is not on this machine.
    FileError
        For anything that is neither a grid nor a data set nor a file.
    """
    if match := _GRID.fullmatch(source):
        if not _SMALLEST_GRID <= int(match[1]) <= _LARGEST_GRID:
            raise InvalidInputError(f"expected a grid from grid-{_SMALLEST_GRID} to grid-{_LARGEST_GRID}, got {source}")
    elif source in DATASETS:
        dataset_path(source)
    elif not Path(source).is_file():
        raise FileError(source, "expected a pose graph, a map, a data set or grid-N, got no such file")
    return source


def search_place(
    source: str,
    seed: int,
    *,
    num_vertices: int = 1000,
    way: float = 30.0,
    goal: tuple[float, float] | None = None,
) -> SearchPlace:
    """One place with its goal.

    Parameters
    ----------
    source
        See the module.
    seed
        Of the roadmap, the goal, and all that is generated.
    num_vertices
        Of the roadmap, about; those of a grid are its places.
    way
        Metres to the goal, about: it is a pose of the graph that far away, or nearly as far away as there are any.
    goal
        In place of such a pose.

    Raises
    ------
    TopobeliefError
        Where the source cannot be read, or there is no way to the goal.
    """
    if match := _GRID.fullmatch(checked_source(source)):
        return _grid(int(match[1]), seed)
    path = dataset_path(source) if source in DATASETS else Path(source)
    rng = np.random.default_rng(seed)
    if path.suffix.lower() in _MAPS:
        world = read_world(path)
        graph = _drive(world, num_vertices, rng, seed)
    else:
        graph = optimize(read_pose_graph(path))
        beside = next((path.with_suffix(suffix) for suffix in _MAPS if path.with_suffix(suffix).is_file()), None)
        world = World.from_trajectory(graph) if beside is None else read_world(beside)
    start = graph.positions[-1, :2]
    if goal is None:
        goal = _pose_far_away(graph, build_roadmap(world, start, None, num_vertices, _ROBOT_RADIUS, seed), way, rng)
    roadmap = build_roadmap(world, start, goal, num_vertices, _ROBOT_RADIUS, seed)
    return SearchPlace(path.stem, graph, world, roadmap, learn_closures(graph, world=world))


def _pose_far_away(graph: PoseGraph, roadmap: Roadmap, way: float, rng: np.random.Generator) -> tuple[float, float]:
    """Where a pose is to which the way is about so long."""
    near = KDTree(roadmap.vertices).query(graph.positions[:, :2])[1]
    metres: FloatArray = roadmap.distances_to(0)[near]
    metres[~np.isfinite(metres) | (roadmap.world.clearance(graph.positions[:, :2]) <= _ROBOT_RADIUS)] = -np.inf
    furthest = float(metres.max())
    if furthest <= 0:
        raise PlanningError("expected a pose that the robot can drive to, got none; give a goal, or another map")
    wanted = min(way, furthest / (1 + _SAME_WAY))
    x, y = graph.positions[rng.choice(np.flatnonzero(np.abs(metres - wanted) <= _SAME_WAY * wanted)), :2].tolist()
    return x, y


def _drive(world: World, num_vertices: int, rng: np.random.Generator, seed: int) -> PoseGraph:
    """A drive from the middle of a map through random places of it; a pose a metre, closing a loop where one is in sight."""
    x_min, y_min, x_max, y_max = world.bounds
    begin = nearest_free_place(world, ((x_min + x_max) / 2, (y_min + y_max) / 2), _ROBOT_RADIUS)
    if begin is None:
        raise PlanningError(f"expected a map with room for a robot of radius {_ROBOT_RADIUS} m, got none")
    roadmap = build_roadmap(world, begin, None, num_vertices, _ROBOT_RADIUS, seed)
    reachable = np.flatnonzero(np.isfinite(roadmap.distances_to(0)))
    walk = [0]
    for place in rng.choice(reachable, _LEGS).tolist():
        walk += (roadmap.shortest_path(walk[-1], place) or [])[1:]
    alone = PoseGraph([(*begin.tolist(), 0.0)], np.zeros((0, 2), np.int64), None, np.eye(3))
    return _driven(alone, roadmap.vertices[walk], block_isotropic(*_NOISE), ClosureModel(max_per_pose=1), world)


def _driven(
    graph: PoseGraph, path: FloatArray, information: FloatArray, closures: ClosureModel, world: World | None
) -> PoseGraph:
    (action,) = predict_actions(graph, [path], closures=closures, information=information, turn=None, world=world)
    return posterior(graph, action)


def _grid(size: int, seed: int) -> SearchPlace:
    """A grid over which a robot has driven row by row; the noise of its measurements is drawn."""
    rng = np.random.default_rng(seed)
    rows = np.arange(size * size).reshape(size, size)
    snake: IntArray = np.concatenate([row if number % 2 == 0 else row[::-1] for number, row in enumerate(rows)])
    places = np.column_stack([snake % size, snake // size]).astype(np.float64)
    steps = np.diff(places, axis=0, append=places[-1:] + np.array([[0.0, 1.0]]))
    poses = np.column_stack([places, np.arctan2(steps[:, 1], steps[:, 0])])
    chain = np.column_stack([np.arange(len(poses) - 1), np.arange(1, len(poses))])
    noise = np.exp(rng.normal(0.0, 0.5, len(chain)))
    graph = PoseGraph(poses, chain, None, block_isotropic(*_NOISE) / noise[:, None, None] ** 2)
    last, opposite = len(poses) - 1, int(np.argmax(np.linalg.norm(places - places[-1], axis=1)))
    order = np.r_[last, opposite, np.setdiff1d(np.arange(len(poses)), [last, opposite])]
    vertices = places[order]
    pairs = KDTree(vertices).query_pairs(1.1, output_type="ndarray").astype(np.int64)
    edges = np.unique(np.sort(pairs, axis=1), axis=0)
    world = World.from_boxes([], bounds=(-1.0, -1.0, float(size), float(size)))
    roadmap = Roadmap(world, _ROBOT_RADIUS, world.component(vertices[0], _ROBOT_RADIUS), vertices, edges)
    closures = ClosureModel(radius=0.6, min_index_gap=5, max_per_pose=1, probability=1.0)
    return SearchPlace(f"grid-{size}", graph, None, roadmap, closures)
