"""How well a learned closure model predicts: the end of a drive is hidden, and its closures are predicted from the rest."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from topobelief.candidates.closures import ClosureModel, closures_of_paths
from topobelief.candidates.learned_closures import History, learn_closures
from topobelief.errors import InvalidInputError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world import FreeSpace


@dataclass(frozen=True, slots=True)
class Replay:
    """Closures of the hidden end of a drive, predicted and made.

    Attributes
    ----------
    model
        Learned from the beginning.
    num_poses
        Hidden.
    opportunities
        Closures that the model's rule predicts, among hidden poses and with earlier ones.
    made
        Closures that the hidden poses have with earlier poses, hidden or not.
    """

    model: ClosureModel
    num_poses: int
    opportunities: int
    made: int

    @property
    def predicted(self) -> float:
        """Expected number of closures."""
        return self.model.probability * self.opportunities

    @property
    def ratio(self) -> float:
        """Predicted over made; nan where there are none of both."""
        return self.predicted / self.made if self.made else math.inf if self.predicted else math.nan


def replay_closures(graph: PoseGraph, *, hidden: float = 0.2, world: FreeSpace | None = None) -> Replay:
    """Predict the closures of the last poses of a graph by a model learned from the others.

    Parameters
    ----------
    graph
        At its estimate. The hidden poses are taken as a path that is to be driven.
    hidden
        Share of its poses that is hidden, above 0 and below 1.
    world
        Where given, loops close only between poses that see each other in it.

    Raises
    ------
    InvalidInputError
        For a share out of range, and for a graph of fewer than 2 poses.
    """
    if not 0 < hidden < 1:
        raise InvalidInputError(f"expected hidden above 0 and below 1, got {hidden}")
    if graph.num_poses < 2:
        raise InvalidInputError(f"expected a graph of at least 2 poses, got {graph.num_poses}")
    graph = graph.poses_alone
    num_known = min(graph.num_poses - 1, max(1, math.ceil((1 - hidden) * graph.num_poses)))
    known = first_poses(graph, num_known)
    model = learn_closures(known, world=world)
    (opportunities,) = closures_of_paths(known, [graph.poses[num_known:]], model, world=world)
    closures = History.of(graph).closures
    made = np.count_nonzero((closures[:, 0] >= num_known) & (closures[:, 0] - closures[:, 1] >= model.min_index_gap))
    return Replay(model, graph.num_poses - num_known, len(opportunities), int(made))


def first_poses(graph: PoseGraph, count: int) -> PoseGraph:
    """The first poses of a graph and the edges among them."""
    inside = (graph.edges < count).all(axis=1)
    return PoseGraph(
        graph.poses[:count],
        graph.edges[inside],
        graph.measurements[inside],
        graph.information[inside],
        ids=graph.ids[:count],
    )
