"""Which loops new poses would close with a pose graph: the rule, how many a pose, and how likely they are.

A rule alone ("every pose within 2 m") predicts as many closures as there are old poses nearby, sixty matches of one and the
same scan. No front end makes them, and their errors would not be independent. A `ClosureModel` therefore limits how many a new
pose makes, and says how probable each is. The rule of the paper's simulations (Kitanov and Indelman, arXiv 1903.00927, section
V) is `ClosureModel.paper()`: 2.0 m, 1.0 rad and an index gap of 2, no limit, certain.

Nothing here knows of paths. `closures_with_prior` takes places with headings, as many as one likes at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import KDTree

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.errors import InvalidInputError, degrees_hint
from topobelief.geometry.group import Group
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world import FreeSpace
from topobelief.world.space import seen_by

_ROUNDING = 1e-9  # relative: what differs by less counts as equal
_AT_ONCE = 2048  # places whose pairs are held in memory together


@dataclass(frozen=True, slots=True)
class ClosureModel:
    """Which loops a new pose would close, and how probably.

    Attributes
    ----------
    radius
        Poses nearer than this may close a loop, metres. At exactly this distance (to 1e-9 of it) they do not, so that two
        poses back on a straight path at 1.0 m are never a closure within 2.0 m by rounding.
    angle
        Largest relative heading, radians; pi: any.
    min_index_gap
        Least number of steps between the two poses, at least 2 (1 is odometry).
    max_per_pose
        Largest number of closures of a new pose with all poses before it, at least 1; None for no limit. The nearest poses are
        taken, no two of them neighbours on the odometry chain as long as there are others.
    probability
        That an opportunity of the rule is taken, above 0 and at most 1. A predicted closure carries this times the information
        of a measurement, which is its expected information.
    num_observed
        Of how many closures of a graph it was learned; None where it is stated by hand. It is told and has no influence.

    Raises
    ------
    InvalidInputError
        Where a number is out of range.

    Examples
    --------
    >>> print(ClosureModel(max_per_pose=2, probability=0.61, num_observed=256))
    closures: at most 2 a pose, 61 % of opportunities, learned from 256 closures of this graph
    >>> print(ClosureModel.paper())
    closures: all poses within 2 m and 1 rad, at least 2 steps apart
    """

    radius: float = 2.0
    angle: float = math.pi
    min_index_gap: int = 5
    max_per_pose: int | None = 1
    probability: float = 0.5
    num_observed: int | None = None

    def __post_init__(self) -> None:
        _check_rule(self.radius, self.angle, self.min_index_gap, prefix="")
        if self.max_per_pose is not None and not (self.max_per_pose >= 1 and self.max_per_pose == int(self.max_per_pose)):
            raise InvalidInputError(
                f"expected max_per_pose as a whole number of at least 1, or None for no limit, got {self.max_per_pose}"
            )
        if not 0 < self.probability <= 1:
            raise InvalidInputError(f"expected probability above 0 and at most 1, got {self.probability}")

    @classmethod
    def by_hand(cls, *, closure_radius: float = 2.0, closure_angle: float = math.pi, min_index_gap: int = 5) -> ClosureModel:
        """A rule by itself: all poses that fulfil it, with certainty.

        Raises
        ------
        InvalidInputError
            Where a number is out of range.
        """
        _check_rule(closure_radius, closure_angle, min_index_gap, prefix="closure_")
        return cls(closure_radius, closure_angle, min_index_gap, max_per_pose=None, probability=1.0)

    @classmethod
    def paper(cls) -> ClosureModel:
        """The rule of the paper's simulations: nearer than 2 m, headings within 1 rad, index gap 2."""
        return cls.by_hand(closure_radius=2.0, closure_angle=1.0, min_index_gap=2)

    def __str__(self) -> str:
        percent = 100 * self.probability
        chance = f"{percent:.0f} % of opportunities" if percent >= 10 else f"{percent:.2g} % of opportunities"
        if self.max_per_pose is None:
            heading = "" if self.angle >= math.pi * (1 - _ROUNDING) else f" and {self.angle:.3g} rad"
            rule = f"all poses within {self.radius:.3g} m{heading}, at least {self.min_index_gap} steps apart"
            limit = rule if self.probability == 1 else f"{rule}, {chance}"
        else:
            limit = f"at most {self.max_per_pose} a pose, {chance}"
        if self.num_observed is None:
            return f"closures: {limit}"
        if self.num_observed == 0:
            return f"closures: {limit}, assumed because this graph has none"
        noun = "closure" if self.num_observed == 1 else "closures"
        return f"closures: {limit}, learned from {self.num_observed} {noun} of this graph"


def closures_with_prior(
    graph: PoseGraph,
    poses: ArrayLike,
    model: ClosureModel,
    *,
    steps: ArrayLike | int | None = None,
    start: int | None = None,
    world: FreeSpace | None = None,
) -> IntArray:
    """Poses of a graph that each of many new poses would close a loop with, if it were the only one.

    Parameters
    ----------
    graph
        The prior.
    poses : shape (N, 3), or (N, 7) in SE(3)
        Places with headings, world frame.
    model
    steps : shape (N,) or a number, optional
        As how many steps from the start each would be reached; the first new pose of a path is one step away. Default: so many
        that no pose of the graph is too recent.
    start
        Index of the pose of the graph from which the robot leaves. Steps are counted along the indices that lead up to it;
        poses behind it (of another robot, or tags) are any number away. Default: the last pose.
    world
        Where given, the two must see each other in it.

    Returns
    -------
    shape (C, 2)
        Row of `poses`, index of the graph's pose; sorted. At most `model.max_per_pose` a row.
    """
    new = np.asarray(poses, dtype=np.float64).reshape(-1, graph.group.pose_size)
    index, graph, start = graph.pose_indices, graph.poses_alone, graph.last_pose if start is None else start
    start = int(np.searchsorted(index, start))
    count = np.broadcast_to(np.inf if steps is None else np.asarray(steps, dtype=np.float64), len(new))
    tree, chained = KDTree(graph.positions), odometry_links(graph)
    found = [np.zeros((0, 2), dtype=np.int64)]
    for first in range(0, len(new), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        near = KDTree(graph.group.position(new[part])).sparse_distance_matrix(tree, model.radius, output_type="ndarray")
        pairs = np.stack([near["i"], near["j"]], axis=1).astype(np.int64)
        old = pairs[:, 1]
        apart = np.where(old > start, np.inf, count[part][pairs[:, 0]] + start - old)
        pairs = pairs[apart >= model.min_index_gap]
        closing = closing_pairs(graph.group, new[part], graph.poses, pairs, model, chained=chained, world=world)
        found.append(np.stack([closing[:, 0] + first, index[closing[:, 1]]], axis=1))
    return np.concatenate(found)


def closures_among(
    group: Group, poses: FloatArray, model: ClosureModel, *, left: IntArray | None = None, world: FreeSpace | None = None
) -> IntArray:
    """Closures among poses that are driven one after the other.

    Parameters
    ----------
    group
    poses : shape (L, pose_size)
    model
    left : shape (L,), optional
        How many closures each pose may make with those before it. Default: as many as the model says.
    world

    Returns
    -------
    shape (C, 2)
        The later pose, the earlier; rows of `poses`, sorted.
    """
    if len(poses) <= model.min_index_gap:
        return np.zeros((0, 2), dtype=np.int64)
    near = KDTree(group.position(poses)).query_pairs(model.radius, output_type="ndarray")[:, ::-1].astype(np.int64)
    pairs = near[near[:, 0] - near[:, 1] >= model.min_index_gap]
    chained = np.ones(len(poses) - 1, dtype=bool)
    return closing_pairs(group, poses, poses, pairs, model, chained=chained, left=left, world=world)


def closures_of_paths(
    graph: PoseGraph,
    paths: Sequence[FloatArray],
    model: ClosureModel,
    *,
    start: int | None = None,
    world: FreeSpace | None = None,
) -> list[IntArray]:
    """Closures of the new poses of each of several paths, driven from one start.

    A new pose first closes loops with poses of the graph, as it would if it were the only one (`closures_with_prior`). If that
    leaves some of `model.max_per_pose`, it closes loops with new poses of its path before it.

    Parameters
    ----------
    graph
    paths
        New poses, each of shape (L, pose_size), L >= 0, in the order in which they are driven.
    model, start, world
        As `closures_with_prior` has them.

    Returns
    -------
    list of shape (C, 2)
        New pose, old pose; indices of the graph, then num_nodes, num_nodes + 1, ... for the new poses of the path; sorted.
    """
    if not paths:
        return []
    n, sizes = graph.num_nodes, [len(poses) for poses in paths]
    ends = np.cumsum(sizes)
    steps = np.concatenate([np.arange(1, size + 1) for size in sizes])
    with_prior = closures_with_prior(graph, np.concatenate(paths), model, steps=steps, start=start, world=world)
    cuts = np.searchsorted(with_prior[:, 0], ends[:-1])
    found: list[IntArray] = []
    for poses, end, closing in zip(paths, ends.tolist(), np.split(with_prior, cuts), strict=True):
        own = closing - np.array([end - len(poses), 0])
        left = None
        if model.max_per_pose is not None:
            left = model.max_per_pose - np.bincount(own[:, 0], minlength=len(poses))
        among = closures_among(graph.group, poses, model, left=left, world=world)
        pairs = np.concatenate([own + np.array([n, 0]), among + n])
        found.append(pairs[np.lexsort(pairs.T[::-1])])
    return found


def closing_pairs(
    group: Group,
    new: FloatArray,
    old: FloatArray,
    pairs: IntArray,
    model: ClosureModel,
    *,
    chained: BoolArray,
    left: IntArray | None = None,
    world: FreeSpace | None = None,
) -> IntArray:
    """Of pairs (row of `new`, row of `old`) those that close a loop: near, aligned, in sight, and not too many; sorted.

    Parameters
    ----------
    group
    new, old : shape (N, pose_size), (M, pose_size)
    pairs : shape (P, 2)
        That are enough steps apart.
    model
    chained : shape (M - 1,)
        Whether odometry joins each old pose to the next.
    left : shape (N,), optional
        How many each new pose may make, in place of `model.max_per_pose`.
    world
    """
    i, j = pairs.T
    relative = group.between(new[i], old[j])
    distances = np.linalg.norm(group.position(relative), axis=1)
    near = distances < model.radius * (1 - _ROUNDING)
    near &= np.linalg.norm(group.rotation_vector(relative), axis=1) <= model.angle * (1 + _ROUNDING)
    i, j, distances = i[near], j[near], distances[near]
    if world is not None:
        seen = world.visible(seen_by(world, group.position(new)[i]), seen_by(world, group.position(old)[j]))
        i, j, distances = i[seen], j[seen], distances[seen]
    if model.max_per_pose is not None:
        limit = np.full(len(new), model.max_per_pose) if left is None else left
        kept = _nearest(i, j, np.rint(distances / (_ROUNDING * model.radius)), limit, chained)
        i, j = i[kept], j[kept]
    order = np.lexsort([j, i])
    return np.stack([i[order], j[order]], axis=1)


def odometry_links(graph: PoseGraph) -> BoolArray:
    """Whether an edge joins each pose to the next, shape (n - 1,)."""
    linked = np.zeros(max(0, graph.num_poses - 1), dtype=bool)
    low = graph.edges.min(axis=1, initial=graph.num_poses)
    linked[low[np.abs(graph.edges[:, 1] - graph.edges[:, 0]) == 1]] = True
    return linked


def _nearest(i: IntArray, j: IntArray, distances: FloatArray, limit: IntArray, chained: BoolArray) -> IntArray:
    """Which pairs (i, j) to keep: for each i up to `limit[i]` of the nearest j, the lesser of equally near ones.

    One by one, the nearest that is no neighbour on the odometry chain of one that was taken; once there is none, the nearest.
    """
    order = np.lexsort([j, distances, i])
    i, j = i[order], j[order]
    follows = np.r_[False, chained, False]  # follows[j]: j - 1 and j are neighbours
    free, barred = np.ones(len(i), dtype=bool), np.zeros(len(i), dtype=bool)
    kept = [np.zeros(0, dtype=np.int64)]
    for taken in range(int(limit.max(initial=0))):
        open_pairs = np.flatnonzero(free & (limit[i] > taken))
        if open_pairs.size == 0:
            break
        ranked = open_pairs[np.lexsort([open_pairs, barred[open_pairs], i[open_pairs]])]
        first = ranked[np.r_[True, np.diff(i[ranked]) != 0]]
        kept.append(order[first])
        free[first] = False
        chosen = np.full(len(limit), -2)
        chosen[i[first]] = j[first]
        of_pair = chosen[i]
        barred |= ((j == of_pair + 1) & follows[j]) | ((j == of_pair - 1) & follows[j + 1])
    return np.concatenate(kept)


def _check_rule(radius: float, angle: float, min_index_gap: int, *, prefix: str) -> None:
    for name, value, upper in ((f"{prefix}radius", radius, math.inf), (f"{prefix}angle", angle, math.pi)):
        if not (0 < value <= upper and math.isfinite(value)):
            limit, hint = ("", "") if upper == math.inf else (f" and at most {upper:.6g}", degrees_hint(value))
            raise InvalidInputError(f"expected {name} above 0{limit}, got {value}{hint}")
    if not (min_index_gap >= 2 and min_index_gap == int(min_index_gap)):
        raise InvalidInputError(f"expected min_index_gap of at least 2 (1 is odometry), got {min_index_gap}")
