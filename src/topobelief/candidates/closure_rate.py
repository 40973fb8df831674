"""Whether a rule that was stated by hand predicts more closures than the graph gives reason to expect."""

from __future__ import annotations

from collections.abc import Sequence

from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.learned_closures import History
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph

_FAR_TOO_MANY = 3.0  # times the graph's own rate


def closure_rate(graph: PoseGraph) -> float:
    """Closures a pose of a graph, told from its odometry as `learn_closures` tells them."""
    return History.of(graph.poses_alone).num_closures / graph.num_poses


def predicted_rate(actions: Sequence[Action]) -> float:
    """Expected closures a new pose, over all actions; 0 where there are no new poses."""
    num_new = sum(action.num_new_poses for action in actions)
    return sum(action.expected_closures for action in actions) / num_new if num_new else 0.0


def rate_warning(graph: PoseGraph, model: ClosureModel, actions: Sequence[Action]) -> str | None:
    """One line where a rule by hand predicts over three times as many closures a pose as the graph has.

    None where it does not, where the model was learned, and for a graph without closures, which says nothing.
    """
    own, predicted = closure_rate(graph), predicted_rate(actions)
    if model.num_observed is not None or own == 0 or predicted <= _FAR_TOO_MANY * own:
        return None
    return (
        f"the rule by hand predicts {predicted:.2g} closures a new pose, {predicted / own:.0f} times as many as the graph "
        f"has ({own:.2g} a pose): bounds get wide and values too good; a model learned from the graph predicts what its front "
        "end makes"
    )
