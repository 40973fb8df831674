"""A rule by hand that predicts far more closures than the graph has is told."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief import ClosureModel, PoseGraph, learn_closures, predict_actions
from topobelief.candidates.closure_rate import closure_rate, predicted_rate, rate_warning

POSES = np.column_stack([np.r_[0:20, 19:-1:-1], np.r_[[0] * 20, [1] * 20], np.zeros(40)]).astype(float)
CHAIN = [(i, i + 1) for i in range(39)]
GRAPH = PoseGraph(POSES, [*CHAIN, (30, 9), (34, 5), (38, 1)], None, np.eye(3) * 100)
PATH = [(0, 1), (0, 0.5), (19, 0.5)]


def test_too_many_by_hand_are_told_and_learned_ones_are_not() -> None:
    by_hand, learned = ClosureModel.by_hand(), learn_closures(GRAPH)
    assert closure_rate(GRAPH) == pytest.approx(3 / 40)
    many, few = (predict_actions(GRAPH, [PATH], closures=model) for model in (by_hand, learned))
    assert predicted_rate(many) > 3 * 3 / 40
    message = rate_warning(GRAPH, by_hand, many)
    assert message is not None
    assert f"predicts {predicted_rate(many):.2g} closures a new pose" in message
    assert "0.075 a pose" in message
    assert rate_warning(GRAPH, learned, few) is None
    cautious = ClosureModel(probability=0.05)
    assert rate_warning(GRAPH, cautious, predict_actions(GRAPH, [PATH], closures=cautious)) is None


def test_a_graph_without_closures_says_nothing() -> None:
    graph = PoseGraph(POSES, CHAIN, None, np.eye(3) * 100)
    assert rate_warning(graph, ClosureModel.by_hand(), predict_actions(graph, [PATH], closures=ClosureModel.by_hand())) is None


def test_the_rate_of_no_new_poses_is_none() -> None:
    assert predicted_rate([]) == 0
