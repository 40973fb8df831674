"""Where the poses are known how well after an action: covariances of all positions, for the best and the worst action."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.entropy import joint_entropy
from topobelief.graph.action import posterior
from topobelief.graph.pose_graph import PoseGraph
from topobelief.reproduction.planning_sessions import PlanningSession
from topobelief.simulation.metrics import position_covariances


@dataclass(frozen=True, eq=False, slots=True)
class TrajectoryUncertainty:
    """A belief after an action.

    Attributes
    ----------
    session
    action
        Index.
    graph
        After the action.
    entropy
        Joint, nats.
    covariances : shape (n, 2, 2)
        Of the positions in the world frame, m^2, the first pose held.
    """

    session: PlanningSession
    action: int
    graph: PoseGraph
    entropy: float
    covariances: FloatArray


def best_and_worst(session: PlanningSession) -> tuple[TrajectoryUncertainty, TrajectoryUncertainty]:
    """The actions of least and of largest joint entropy."""
    graphs = [posterior(session.graph, action) for action in session.actions]
    values = [joint_entropy(graph) for graph in graphs]

    def uncertainty(action: int) -> TrajectoryUncertainty:
        graph = graphs[action]
        return TrajectoryUncertainty(session, action, graph, values[action], position_covariances(graph))

    return uncertainty(int(np.argmin(values))), uncertainty(int(np.argmax(values)))
