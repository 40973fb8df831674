"""A closure model learned from what a graph's own front end did.

The poses of the graph are taken in the order of their indices, each as if it were new to those before it. How many closures
such a pose makes, with poses how far away and how often an opportunity is taken is then there to be counted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from topobelief.arrays import IntArray
from topobelief.candidates.closures import ClosureModel, closing_pairs, odometry_links
from topobelief.errors import InvalidInputError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world import World

_REACH = 0.9  # share of the closures whose distance and angle the rule covers
_RECENT = 0.05  # share of the edges that skip a pose which may join more recent poses than the rule allows
_LEAST_GAP, _USUAL_GAP = 2, 5  # steps
_AT_ONCE = 2048  # poses whose pairs are held in memory together


def learn_closures(graph: PoseGraph, *, world: World | None = None, probability: float = 0.5) -> ClosureModel:
    """The closures that a graph's own front end makes, as a model of those to come.

    An edge counts as a closure where its poses are at least g indices apart; several between the same two poses count once.
    g is 5, or the number of steps of median length after which a robot that drives straight on has left the radius, if that is
    more; but where one in twenty of the edges that skip a pose joins poses nearer in time than that, g is as small as these
    ask for, down to 2. Then

    * `radius` and `angle` are the 90 % quantiles of the closures' measured distances and angles,
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
    past = History.of(graph)
    if past.num_closures == 0:
        return ClosureModel(probability=probability, num_observed=0)
    model = ClosureModel(
        radius=max(past.radius, np.finfo(float).tiny),
        angle=float(np.clip(past.angle, np.finfo(float).tiny, math.pi)),
        min_index_gap=past.gap,
        max_per_pose=math.ceil(past.num_closures / len(np.unique(past.closures[:, 0]))),
        num_observed=past.num_closures,
    )
    opportunities = num_opportunities(graph, model, world=world)
    taken = min(past.num_closures, opportunities)
    return replace(model, probability=(1 + taken) / (2 + opportunities))


@dataclass(frozen=True, eq=False, slots=True)
class History:
    """The closures that a graph has, told from its odometry.

    Attributes
    ----------
    gap
        Least difference of the indices of their poses.
    closures : shape (C, 2)
        Later pose, earlier pose; each pair once, sorted.
    radius, angle
        Which 90 % of them do not exceed as measured, metres and radians; nan where there are none.
    """

    gap: int
    closures: IntArray
    radius: float
    angle: float

    @property
    def num_closures(self) -> int:
        """C."""
        return len(self.closures)

    @classmethod
    def of(cls, graph: PoseGraph) -> History:
        """That of a graph."""
        late, early = graph.edges.max(axis=1, initial=0), graph.edges.min(axis=1, initial=graph.num_poses)
        apart = late - early
        distances = np.linalg.norm(graph.group.position(graph.measurements), axis=1)
        angles = np.linalg.norm(graph.group.rotation_vector(graph.measurements), axis=1)
        skipping = apart[apart > 1]
        seen = int(np.quantile(skipping, _RECENT, method="lower")) if skipping.size else _USUAL_GAP
        gap = max(_LEAST_GAP, min(seen, _USUAL_GAP))
        step = float(np.median(distances[apart == 1])) if (apart == 1).any() else 0.0
        if step > 0 and (apart >= gap).any():
            radius = float(np.quantile(distances[apart >= gap], _REACH))
            gap = max(gap, min(seen, math.ceil(radius / step) + 1))
        closing = np.flatnonzero(apart >= gap)
        if closing.size == 0:
            return cls(gap, np.zeros((0, 2), dtype=np.int64), math.nan, math.nan)
        pairs, first = np.unique(np.stack([late[closing], early[closing]], axis=1), axis=0, return_index=True)
        edges = closing[first]
        return cls(gap, pairs, float(np.quantile(distances[edges], _REACH)), float(np.quantile(angles[edges], _REACH)))


def num_opportunities(graph: PoseGraph, model: ClosureModel, *, world: World | None = None) -> int:
    """How many closures a model's rule would have predicted for all poses of a graph, each new to those before it."""
    tree, chained, total = KDTree(graph.positions), odometry_links(graph), 0
    for first in range(0, graph.num_poses, _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        near = KDTree(graph.positions[part]).sparse_distance_matrix(tree, model.radius, output_type="ndarray")
        pairs = np.stack([near["i"], near["j"]], axis=1).astype(np.int64)
        pairs = pairs[pairs[:, 0] + first - pairs[:, 1] >= model.min_index_gap]
        total += len(closing_pairs(graph.group, graph.poses[part], graph.poses, pairs, model, chained=chained, world=world))
    return total
