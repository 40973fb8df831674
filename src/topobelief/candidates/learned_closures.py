"""A closure model learned from what a graph's own front end did.

The poses of the graph are taken in the order of their indices, each as if it were new to those before it. How many closures
such a pose makes, with poses how far away and how often an opportunity is taken is then there to be counted.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import KDTree

from topobelief.arrays import IntArray
from topobelief.candidates.closures import ClosureModel, closing_pairs, odometry_links
from topobelief.errors import InvalidInputError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world import World

_REACH = 0.9  # share of the closures whose distance and angle the rule covers
_RECENT = 0.05  # share of the closures that may join more recent poses than the rule allows
_LARGEST_GAP = 5  # steps; the robot's way back after a turn is no reason to wait longer
_AT_ONCE = 2048  # poses whose pairs are held in memory together


def learn_closures(graph: PoseGraph, *, world: World | None = None, probability: float = 0.5) -> ClosureModel:
    """The closures that a graph's own front end makes, as a model of those to come.

    An edge between poses that are at least g = 5 indices apart counts as a closure (less than 5, down to 2, where one in
    twenty of the edges that skip a pose is between poses so near in time); several between the same two poses count once.
    Then

    * `radius` and `angle` are the 90 % quantiles of the closures' measured distances and angles,
    * `max_per_pose` is k, the mean number of closures of those poses that make any, rounded up,
    * `probability` is the mean of the beta distribution that a uniform prior becomes after m of n opportunities were taken,
      (1 + m) / (2 + n): m closures were made, and the rule with its limit of k a pose would have predicted n.

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
    made, edges, gap = history(graph)
    if len(made) == 0:
        return ClosureModel(probability=probability, num_observed=0)
    relative = graph.measurements[edges]
    distances = np.linalg.norm(graph.group.position(relative), axis=1)
    angles = np.linalg.norm(graph.group.rotation_vector(relative), axis=1)
    num_closing = len(np.unique(made[:, 0]))
    rule = ClosureModel(
        radius=max(float(np.quantile(distances, _REACH)), np.finfo(float).tiny),
        angle=float(np.clip(np.quantile(angles, _REACH), np.finfo(float).tiny, math.pi)),
        min_index_gap=gap,
        max_per_pose=math.ceil(len(made) / num_closing),
        num_observed=len(made),
    )
    opportunities = num_opportunities(graph, rule, world=world)
    taken = min(len(made), opportunities)
    return ClosureModel(
        rule.radius, rule.angle, gap, rule.max_per_pose, (1 + taken) / (2 + opportunities), num_observed=rule.num_observed
    )


def history(graph: PoseGraph) -> tuple[IntArray, IntArray, int]:
    """Closures that a graph has, each pair of poses once: (C, 2) later and earlier pose, (C,) their edges; and the gap g."""
    late, early = graph.edges.max(axis=1, initial=0), graph.edges.min(axis=1, initial=graph.num_poses)
    apart = late - early
    skipping = apart[apart > 1]
    gap = _LARGEST_GAP
    if skipping.size:
        gap = int(np.clip(np.quantile(skipping, _RECENT, method="lower"), 2, _LARGEST_GAP))
    edges = np.flatnonzero(apart >= gap)
    pairs, first = np.unique(np.stack([late[edges], early[edges]], axis=1), axis=0, return_index=True)
    return pairs.reshape(-1, 2), edges[first], gap


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
