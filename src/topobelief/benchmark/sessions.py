"""What is decided in a benchmark: a pose graph and many long candidate paths on it.

Generated graphs are a drive through a city of square blocks, as the public graph city10000 is: a pose a metre, straight on
or round a corner every few metres, and loops closed with earlier poses nearby. Candidates set out from the last pose and head
for poses of the map, one after the other.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import Literal, cast, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import KDTree

from topobelief.arrays import FloatArray, IntArray
from topobelief.candidates.observations import learn_observations, observations_from
from topobelief.candidates.predicted_factors import default_information
from topobelief.errors import InvalidInputError, require_choice
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph

ClosureStyle = Literal["scattered", "bursts"]

_TURN_PROBABILITY = 0.2
_SCATTER_REACH = 3  # metres
_SCATTER_TRIALS = 3.0  # places in reach that a pose looks for, on average; so many that there are two edges a pose
_BURST_REACH = 4.5  # metres
_BURST_PROBABILITY = 0.05  # that a pose finds what is near
_BURST_SHARE = 0.5  # of what is near
_MIN_INDEX_GAP = 10  # poses between two that close a loop
_HEADINGS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])


@dataclass(frozen=True, eq=False, slots=True)
class BenchmarkSession:
    """A prior and its candidates.

    Attributes
    ----------
    name
    graph
    actions
        At least one.
    """

    name: str
    graph: PoseGraph
    actions: tuple[Action, ...]


def city_drive(
    num_poses: int, information: ArrayLike, *, closures: ClosureStyle = "scattered", rng: np.random.Generator
) -> PoseGraph:
    """A drive of one-metre steps over a square grid with as many places as poses, in SE(2).

    Parameters
    ----------
    num_poses
        At least 2.
    information : shape (3, 3)
        Of every edge.
    closures
        "scattered": every pose looks for a few places nearby, some two edges a pose and up to ten at one, as in the public
        graph city10000. "bursts": one pose in twenty finds half of all earlier poses nearby, up to some fifty, as where a
        lidar recognises a place (the public graphs csail and intel have such poses).
    rng

    Raises
    ------
    InvalidInputError
        For fewer than two poses or an unknown style.
    """
    require_choice("closures", closures, get_args(ClosureStyle))
    if num_poses < 2:
        raise InvalidInputError(f"expected a drive of at least 2 poses, got {num_poses}")
    side = math.ceil(math.sqrt(num_poses))
    places, headings = _walk(num_poses, side, rng)
    chain = np.column_stack([np.arange(num_poses - 1), np.arange(1, num_poses)])
    found = _scattered_closures(places, rng) if closures == "scattered" else _closures_in_bursts(places, rng)
    poses = np.column_stack([places, headings * (math.pi / 2)])
    return PoseGraph(poses, np.concatenate([chain, found]), None, information)


def _scattered_closures(places: FloatArray, rng: np.random.Generator) -> IntArray:
    """(pose, earlier pose) pairs, shape (c, 2)."""
    reach = np.arange(-_SCATTER_REACH, _SCATTER_REACH + 1)
    offsets = np.array([(x, y) for x in reach for y in reach if x * x + y * y <= _SCATTER_REACH**2])
    visits: dict[tuple[int, int], list[int]] = {}
    pairs: list[tuple[int, int]] = []
    for pose, (x, y) in enumerate(places.astype(int).tolist()):
        for dx, dy in offsets[rng.integers(len(offsets), size=rng.poisson(_SCATTER_TRIALS))].tolist():
            earlier = visits.get((x + dx, y + dy), ())
            known = bisect_right(earlier, pose - _MIN_INDEX_GAP)
            if known:
                pairs.append((pose, earlier[int(rng.integers(known))]))
        visits.setdefault((x, y), []).append(pose)
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _closures_in_bursts(places: FloatArray, rng: np.random.Generator) -> IntArray:
    """(pose, earlier pose) pairs, shape (c, 2)."""
    tree = KDTree(places)
    looks: list[int] = np.flatnonzero(rng.random(len(places)) < _BURST_PROBABILITY).tolist()
    pairs = [
        (pose, earlier)
        for pose in looks
        for earlier in sorted(tree.query_ball_point(places[pose], _BURST_REACH))
        if earlier <= pose - _MIN_INDEX_GAP
    ]
    seen = rng.random(len(pairs)) < _BURST_SHARE
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)[seen]


def _walk(num_poses: int, side: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Places, shape (n, 2), and headings in quarter turns, shape (n,), of a walk that stays in the square."""
    places, headings = np.empty((num_poses, 2)), np.empty(num_poses)
    place, heading = np.array([side // 2, side // 2]), 0
    turns, sides = rng.random(num_poses), rng.integers(2, size=num_poses)
    for pose in range(num_poses):
        places[pose], headings[pose] = place, heading
        if turns[pose] < _TURN_PROBABILITY:
            heading = (heading + (1 if sides[pose] else 3)) % 4
        while not ((place + _HEADINGS[heading] >= 0) & (place + _HEADINGS[heading] < side)).all():
            heading = (heading + (1 if sides[pose] else 3)) % 4
        place = place + _HEADINGS[heading]
    return places, headings


def candidate_paths(
    graph: PoseGraph,
    count: int,
    *,
    num_new_poses: int = 100,
    num_closures: int = 20,
    information: ArrayLike | None = None,
    rng: np.random.Generator,
) -> tuple[Action, ...]:
    """Paths from the last pose towards random poses of the graph, each of a chain of new poses and some closures.

    Steps are as long as the graph's median odometry step. A new pose closes a loop with the nearest old one if that lies
    within a radius, the same for all paths: the one at which they close as many loops as were asked for on average. It
    observes landmarks as the graph's own poses did (`learn_observations`), each with its expected information.

    Parameters
    ----------
    graph
        In SE(2) or SE(3); paths keep the last pose's orientation in SE(3).
    count
        K.
    num_new_poses, num_closures
        Of each path, the closures on average; at most as many as new poses.
    information : shape (kappa, kappa), optional
        Of every predicted factor between poses. Default: `default_information(graph)`.
    rng

    Raises
    ------
    InvalidInputError
        For numbers that leave nothing to decide.
    """
    if count < 1 or not 0 <= num_closures <= num_new_poses or num_new_poses < 1:
        raise InvalidInputError(
            f"expected at least one path of at least one new pose with no more closures than new poses, "
            f"got {count} paths of {num_new_poses} new poses and {num_closures} closures"
        )
    matrix = np.array(default_information(graph) if information is None else information, dtype=np.float64)
    poses, n = graph.poses_alone, graph.num_nodes
    steps = np.linalg.norm(poses.positions[poses.edges[:, 1]] - poses.positions[poses.edges[:, 0]], axis=1)
    odometry = np.abs(poses.edges[:, 1] - poses.edges[:, 0]) == 1
    step = float(np.median(steps[odometry if odometry.any() else slice(None)])) or 1.0
    new_poses = n + np.arange(num_new_poses)
    chain = np.column_stack([np.r_[graph.last_pose, new_poses[:-1]], new_poses])
    paths = np.stack([_towards_targets(poses.positions, step, num_new_poses, rng) for _ in range(count)])
    distances, nearest = cast("tuple[FloatArray, IntArray]", KDTree(poses.positions).query(paths))
    closes = np.zeros(distances.size, dtype=bool)
    closes[np.argsort(distances, axis=None, kind="stable")[: count * num_closures]] = True
    closes = closes.reshape(distances.shape)
    model = learn_observations(graph)
    actions: list[Action] = []
    for index, path in enumerate(paths):
        stations, new = _poses_along(poses, path), np.flatnonzero(closes[index])
        edges = np.concatenate([chain, np.column_stack([n + new, graph.pose_indices[nearest[index, new]]])])
        information = matrix
        if model is not None:
            seen = observations_from(graph, stations, model) + np.array([n, 0])
            of_landmarks = model.information(graph.tangent_dim, graph.group.position_dim)
            information = np.concatenate([np.tile(matrix, (len(edges), 1, 1)), np.tile(of_landmarks, (len(seen), 1, 1))])
            edges = np.concatenate([edges, seen])
        actions.append(Action(stations, edges, information, label=f"path {index}", length=num_new_poses * step))
    return tuple(actions)


def _towards_targets(positions: FloatArray, step: float, count: int, rng: np.random.Generator) -> FloatArray:
    """Stations every `step` along straight lines from the last position to random ones, shape (count, position_dim)."""
    stations, here = np.empty((count, positions.shape[1])), positions[-1]
    done = 0
    while done < count:
        target = positions[rng.integers(len(positions))]
        way = target - here
        length = float(np.linalg.norm(way))
        steps = min(count - done, int(length / step))
        if steps == 0:  # a step in some direction rather than none
            direction = rng.normal(size=len(here))
            way, length, steps = direction, float(np.linalg.norm(direction)), 1
        stations[done : done + steps] = here + way / length * step * np.arange(1, steps + 1)[:, None]
        here, done = stations[done + steps - 1], done + steps
    return stations


def _poses_along(graph: PoseGraph, path: FloatArray) -> FloatArray:
    """Poses at the stations: heading along the path in SE(2), oriented as the last pose in SE(3)."""
    poses = np.tile(graph.poses[-1], (len(path), 1))
    k = graph.group.position_dim
    if k == 2:
        way = np.diff(path, axis=0, prepend=graph.positions[-1:])
        poses[:, 2] = np.arctan2(way[:, 1], way[:, 0])
    poses[:, :k] = path
    return poses
