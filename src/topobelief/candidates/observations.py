"""Observations of known landmarks that new poses would make: which ones, how surely and how well.

The sensor is a range and a field of view: a pose may observe a landmark that is near enough, ahead enough and in sight. As with
loop closures, of those it observes at most k, the nearest, each with a probability. What an observation says is one number,
the standard deviation of the position along every direction, so that its information depends on the landmark alone and not on
the pose that sees it (docs, the mathematics, section 5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.errors import InvalidInputError, degrees_hint
from topobelief.graph.information import scalar_weights
from topobelief.graph.observations import seen_positions
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world import FreeSpace
from topobelief.world.space import seen_by

_REACH = 0.9  # share of the observations whose distance and bearing the rule covers
_MOST = 0.5  # share of the observations
_LEAST_HALF_ANGLE = math.radians(15)
_INCLUDED = 1e-6  # relative; what is at the quantile itself is within the rule
_AT_ONCE = 2048  # poses whose pairs are held in memory together


@dataclass(frozen=True, slots=True)
class ObservationModel:
    """Which known landmarks a new pose observes, and how well.

    Attributes
    ----------
    max_range
        Metres from the pose to the landmark at most.
    field_of_view
        Radians: the whole angle about the direction ahead (in the plane; in space about the x axis) in which landmarks are
        seen.
    max_per_pose
        How many a pose observes at most, the nearest; None for no limit.
    probability
        That such an opportunity is taken.
    sigma
        Standard deviation of an observed position along every direction, metres.
    line_of_sight
        Whether a landmark must be in sight where a world is given.
    num_observed
        From how many observations the model was learned; None where it was stated.

    Raises
    ------
    InvalidInputError
        Where a number is out of range.

    Examples
    --------
    >>> print(ObservationModel(max_range=20, sigma=0.5, probability=0.25, num_observed=3640))
    landmarks: at most 1 a pose within 20 m, 25 % of opportunities, 0.5 m, learned from 3640 observations of this graph
    """

    max_range: float
    sigma: float
    field_of_view: float = 2 * math.pi
    max_per_pose: int | None = 1
    probability: float = 0.5
    line_of_sight: bool = True
    num_observed: int | None = None

    def __post_init__(self) -> None:
        for name, value in (("max_range", self.max_range), ("sigma", self.sigma)):
            if not 0 < value < math.inf:
                raise InvalidInputError(f"expected {name} above 0, got {value}")
        if not 0 < self.field_of_view <= 2 * math.pi:
            hint = degrees_hint(self.field_of_view)
            raise InvalidInputError(f"expected field_of_view above 0 and at most 2 pi, got {self.field_of_view}{hint}")
        if self.max_per_pose is not None and not (self.max_per_pose >= 1 and self.max_per_pose == int(self.max_per_pose)):
            raise InvalidInputError(
                f"expected max_per_pose as a whole number of at least 1, or None for no limit, got {self.max_per_pose}"
            )
        if not 0 < self.probability <= 1:
            raise InvalidInputError(f"expected probability above 0 and at most 1, got {self.probability}")

    def information(self, tangent_dim: int, position_dim: int) -> FloatArray:
        """Expected information of an observation, shape (kappa, kappa): `probability` over sigma^2 for each coordinate."""
        matrix = np.zeros((tangent_dim, tangent_dim))
        axes = np.arange(position_dim)
        matrix[axes, axes] = self.probability / self.sigma**2
        return matrix

    def __str__(self) -> str:
        number = "all" if self.max_per_pose is None else f"at most {self.max_per_pose} a pose"
        walls = "" if self.line_of_sight else ", in sight or not"
        view = "" if self.field_of_view >= 2 * math.pi else f", {math.degrees(self.field_of_view):.0f}° ahead"
        percent = 100 * self.probability
        share = f"{percent:.0f}" if percent >= 10 else f"{percent:.2g}"
        chance = "" if self.probability == 1 else f", {share} % of opportunities"
        learned = "" if self.num_observed is None else f", learned from {self.num_observed} observations of this graph"
        return f"landmarks: {number} within {self.max_range:.3g} m{view}{walls}{chance}, {self.sigma:.3g} m{learned}"


def learn_observations(graph: PoseGraph, *, world: FreeSpace | None = None, **stated: Any) -> ObservationModel | None:
    """The observations that a graph's own front end made, as a model of those to come; None where there are none.

    `max_range` is the 90 % quantile of the distances from which landmarks were observed, `field_of_view` twice that of their
    angles off the direction ahead, at least 30 degrees. `max_per_pose` is k, the mean number of landmarks of those poses that
    observe any, rounded up; `line_of_sight` is whether most observations were made along a free line of sight: trees beside the
    region that a trajectory spans, or tags in walls, were seen although the world says that nothing can be seen there.
    `probability` is (1 + m) / (2 + n), m of the observations within the rule being made where it would
    have predicted n. `sigma` is that of the median of |O_pp|^(1/k).

    Parameters
    ----------
    graph
        At its estimate.
    world
        Where given, opportunities are landmarks in sight in it, if most that were observed are. Learn with the world that
        you predict with.
    **stated
        Attributes of the model that are not to be learned; `probability`, unless it is stated too, is learned for these.
    """
    observing = np.flatnonzero(graph.reading_codes)
    if observing.size == 0:
        return None
    edges = np.unique(graph.edges[observing], axis=0)
    seen = seen_positions(graph.group, graph.poses, edges)
    distances, angles = np.linalg.norm(seen, axis=1), off_axis(seen)
    half = max(float(np.quantile(angles, _REACH)), _LEAST_HALF_ANGLE) * (1 + _INCLUDED)
    model = ObservationModel(
        max_range=max(float(np.quantile(distances, _REACH)), np.finfo(float).tiny) * (1 + _INCLUDED),
        sigma=float(np.median(scalar_weights(graph.information[observing])[0])) ** -0.5,
        field_of_view=min(2 * half, 2 * math.pi),
        max_per_pose=math.ceil(len(edges) / len(np.unique(edges[:, 0]))),
        line_of_sight=world is None or bool(np.mean(_in_sight(graph, graph.poses[edges[:, 0]], edges[:, 1], world)) >= _MOST),
        num_observed=len(observing),
    )
    model = replace(model, **stated)
    if "probability" in stated:
        return model
    opportunities = len(observations_from(graph, graph.poses[graph.pose_indices], model, world=world))
    taken = min(len(edges), opportunities)
    return replace(model, probability=(1 + taken) / (2 + opportunities))


def observations_from(
    graph: PoseGraph, poses: FloatArray, model: ObservationModel, *, world: FreeSpace | None = None
) -> IntArray:
    """Landmarks of a graph that each of many poses would observe.

    Parameters
    ----------
    graph
    poses : shape (N, pose_size)
    model
    world
        Where given, a landmark must be in sight, if the model says so.

    Returns
    -------
    shape (C, 2)
        Row of `poses`, index of the graph's landmark; sorted. At most `model.max_per_pose` a row, the nearest.
    """
    landmarks = np.flatnonzero(graph.is_landmark)
    found = [np.zeros((0, 2), dtype=np.int64)]
    if not landmarks.size:
        return found[0]
    tree = KDTree(graph.positions[landmarks])
    for first in range(0, len(poses), _AT_ONCE):
        part = poses[first : first + _AT_ONCE]
        near = KDTree(graph.group.position(part)).sparse_distance_matrix(tree, model.max_range, output_type="ndarray")
        row, landmark, distance = near["i"].astype(np.int64), landmarks[near["j"]], near["v"]
        kept = _in_view(graph, part[row], landmark, model)
        if world is not None and model.line_of_sight:
            kept[kept] = _in_sight(graph, part[row[kept]], landmark[kept], world)
        row, landmark, distance = row[kept], landmark[kept], distance[kept]
        order = np.lexsort([landmark, distance, row])
        row, landmark = row[order], landmark[order]
        if model.max_per_pose is not None:
            rank: IntArray = np.arange(len(row)) - np.searchsorted(row, row)
            row, landmark = row[rank < model.max_per_pose], landmark[rank < model.max_per_pose]
        order = np.lexsort([landmark, row])
        found.append(np.stack([row[order] + first, landmark[order]], axis=1))
    return np.concatenate(found)


def _in_sight(graph: PoseGraph, poses: FloatArray, landmarks: IntArray, world: FreeSpace) -> BoolArray:
    return world.visible(seen_by(world, graph.group.position(poses)), seen_by(world, graph.positions[landmarks]))


def _in_view(graph: PoseGraph, poses: FloatArray, landmarks: IntArray, model: ObservationModel) -> BoolArray:
    if model.field_of_view >= 2 * math.pi:
        return np.ones(len(landmarks), dtype=np.bool_)
    group = graph.group
    offset = graph.positions[landmarks] - group.position(poses)
    seen = np.einsum("mba,mb->ma", group.rotation_matrix(poses), offset)
    return off_axis(seen) <= model.field_of_view / 2 * (1 + _INCLUDED)


def off_axis(seen: FloatArray) -> FloatArray:
    """Angles between the x axis and positions in the frame of a pose, shape (m,), from 0 to pi."""
    return np.arctan2(np.linalg.norm(seen[:, 1:], axis=1), seen[:, 0])
