"""A closure model learned from what a graph's own front end did.

The poses of the graph are taken in the order of their indices, each as if it were new to those before it. How many closures
such a pose makes, with poses how far away and how often an opportunity is taken is then there to be counted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from topobelief.arrays import FloatArray, IntArray
from topobelief.candidates.closures import ClosureModel, closing_pairs, odometry_links
from topobelief.errors import InvalidInputError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world import FreeSpace

_REACH = 0.9  # share of the closures whose distance and angle the rule covers
_LEAST_ANGLE = math.radians(15)
_INCLUDED = 1e-6  # relative; what is at the quantile itself is within the rule
_RECENT = 0.05  # share of the edges that skip a pose which may join more recent poses than the rule allows
_KNOWN_WEIGHT = 20  # opportunities that the probability of a known front end counts for
_LEAST_GAP, _USUAL_GAP = 2, 5  # steps
_AT_ONCE = 2048  # poses whose pairs are held in memory together


def learn_closures(
    graph: PoseGraph, *, world: FreeSpace | None = None, probability: float = 0.5, rule: ClosureModel | None = None
) -> ClosureModel:
    """The closures that a graph's own front end makes, as a model of those to come.

    An edge counts as a closure where its poses are at least g indices apart; several between the same two poses count once.
    g is 5, or the number of steps of median length after which a robot that drives straight on has left the radius, if that is
    more; but where one in twenty of the edges that skip a pose joins poses nearer in time than that, g is as small as these
    ask for, down to 2. Then

    * `radius` and `angle` are the 90 % quantiles of the closures' measured distances and angles; but not less than half the
      median step of odometry and 15 degrees, for predicted poses are not placed and turned more exactly than that,
    * `max_per_pose` is k, the mean number of closures of those poses that make any, rounded up,
    * `probability` is the mean of the beta distribution that a uniform prior becomes after m of n opportunities were taken,
      (1 + m) / (2 + n): m closures were made, and the rule with its limit of k a pose would have predicted n. Where more were
      made than that, all n were taken.

    Parameters
    ----------
    graph
        At its estimate: what is near is judged by its poses.
    world
        Where given, opportunities are poses that see each other in it. Learn with the world that you predict with.
    probability
        Of the model for a graph without closures, which has one closure a pose within 2 m.
    rule
        What is known of the front end that makes the closures: its radius, angle, gap and limit are kept, and only its
        probability is learned, for which `rule.probability` counts like 20 opportunities (`probability` is not used then).

    Returns
    -------
    ClosureModel
        Its `num_observed` says how many closures it was learned from.

    Raises
    ------
    InvalidInputError
        For a probability that is none.
    """
    if not 0 < probability <= 1:
        raise InvalidInputError(f"expected probability above 0 and at most 1, got {probability}")
    graph = graph.poses_alone
    if rule is not None:
        made = History.of(graph, gap=rule.min_index_gap).num_closures
        return _with_probability(graph, rule, made, world, mean=rule.probability, weight=_KNOWN_WEIGHT)
    past = History.of(graph)
    if past.num_closures == 0:
        return ClosureModel(probability=probability, num_observed=0)
    model = ClosureModel(
        radius=max(past.radius, past.step / 2, np.finfo(float).tiny) * (1 + _INCLUDED),
        angle=min(max(past.angle, _LEAST_ANGLE) * (1 + _INCLUDED), math.pi),
        min_index_gap=past.gap,
        max_per_pose=math.ceil(past.num_closures / len(np.unique(past.closures[:, 0]))),
    )
    return _with_probability(graph, model, past.num_closures, world, mean=0.5, weight=2)


def _with_probability(
    graph: PoseGraph, model: ClosureModel, made: int, world: FreeSpace | None, *, mean: float, weight: float
) -> ClosureModel:
    """The model with the mean of the beta distribution that one of a mean, worth so many opportunities, becomes."""
    opportunities = num_opportunities(graph, model, world=world)
    taken = min(made, opportunities)
    return replace(model, probability=(weight * mean + taken) / (weight + opportunities), num_observed=made)


@dataclass(frozen=True, eq=False, slots=True)
class History:
    """The closures that a graph has, told from its odometry.

    Attributes
    ----------
    gap
        Least difference of the indices of their poses.
    closures : shape (C, 2)
        Later pose, earlier pose; each pair once, sorted.
    edges : shape (C,)
        The first edge of the graph that measures each.
    radius, angle
        Which 90 % of them do not exceed as measured, metres and radians; nan where there are none.
    step
        Median length of the odometry, metres; 0 where there is none.
    """

    gap: int
    closures: IntArray
    edges: IntArray
    radius: float
    angle: float
    step: float

    @property
    def num_closures(self) -> int:
        """C."""
        return len(self.closures)

    @classmethod
    def of(cls, graph: PoseGraph, *, gap: int | None = None) -> History:
        """That of a graph of poses alone, by a gap that is known or as `learn_closures` finds it."""
        late, early = graph.edges.max(axis=1, initial=0), graph.edges.min(axis=1, initial=graph.num_poses)
        apart = late - early
        distances = np.linalg.norm(graph.group.position(graph.measurements), axis=1)
        step = float(np.median(distances[apart == 1])) if (apart == 1).any() else 0.0
        if gap is None:
            gap = _usual_gap(apart, distances, step)
        closing = np.flatnonzero(apart >= gap)
        pairs, first = np.unique(np.stack([late[closing], early[closing]], axis=1), axis=0, return_index=True)
        edges = closing[first]
        if edges.size == 0:
            return cls(gap, pairs.reshape(0, 2), edges, math.nan, math.nan, step)
        angles = np.linalg.norm(graph.group.rotation_vector(graph.measurements[edges]), axis=1)
        radius, angle = (float(np.quantile(values, _REACH)) for values in (distances[edges], angles))
        return cls(gap, pairs, edges, radius, angle, step)


def _usual_gap(apart: IntArray, distances: FloatArray, step: float) -> int:
    """g of `learn_closures`, from all edges and the median step of odometry."""
    skipping = apart[apart > 1]
    seen = int(np.quantile(skipping, _RECENT, method="lower")) if skipping.size else _USUAL_GAP
    gap = max(_LEAST_GAP, min(seen, _USUAL_GAP))
    if step > 0 and (apart >= gap).any():
        radius = float(np.quantile(distances[apart >= gap], _REACH))
        gap = max(gap, min(seen, math.ceil(radius / step) + 1))
    return gap


def num_opportunities(graph: PoseGraph, model: ClosureModel, *, world: FreeSpace | None = None) -> int:
    """How many closures a model's rule would have predicted for all poses of a graph, each new to those before it."""
    tree, chained, total = KDTree(graph.positions), odometry_links(graph), 0
    for first in range(0, graph.num_poses, _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        near = KDTree(graph.positions[part]).sparse_distance_matrix(tree, model.radius, output_type="ndarray")
        pairs = np.stack([near["i"], near["j"]], axis=1).astype(np.int64)
        pairs = pairs[pairs[:, 0] + first - pairs[:, 1] >= model.min_index_gap]
        total += len(closing_pairs(graph.group, graph.poses[part], graph.poses, pairs, model, chained=chained, world=world))
    return total
