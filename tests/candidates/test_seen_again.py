"""What a path sees again is told by runs of poses, by what the file calls them."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief.candidates.seen_again import closing_edges, described, seen_again
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph

OMEGA = np.diag([100.0, 100.0, 400.0])
GRAPH = PoseGraph([[x, 0, 0] for x in range(20)], [(x, x + 1) for x in range(19)], None, OMEGA, ids=range(100, 120))


def action_on(old: list[int], *, start: int = 19, probabilities: list[float] | None = None) -> Action:
    """Two new poses, the first of which closes loops; the second closes one with the first pose seen."""
    edges = [(start, 20), (20, 21), *((20, seen) for seen in old), *((21, seen) for seen in old[:1])]
    return Action([(0, 1, 0), (1, 1, 0)], edges, OMEGA, probabilities=probabilities)


def test_odometry_is_no_closure_wherever_the_robot_starts():
    assert closing_edges(GRAPH, 19, action_on([3])).tolist() == [False, False, True, True]
    assert closing_edges(GRAPH, 7, action_on([3], start=7)).tolist() == [False, False, True, True]


def test_runs_go_on_across_two_unseen_poses_and_those_with_most_closures_come_first():
    stretches = seen_again(GRAPH, 19, action_on([15, 0, 4, 6, 9]))
    assert [(each.first, each.last, each.num_closures) for each in stretches] == [(4, 9, 3), (15, 15, 2), (0, 0, 1)]
    assert [(each.first_new, each.last_new) for each in stretches] == [(0, 0), (0, 1), (0, 0)]
    assert [each.name(GRAPH) for each in stretches] == ["104 to 109", "115", "100"]


@pytest.mark.parametrize(
    ("old", "text"),
    [
        ([], "sees no pose again"),
        ([3], "sees pose 103 again, 2 closures"),
        ([3, 4], "sees poses 103 to 104 again, 3 closures"),
        ([3, 9], "sees poses 103 and 109 again, 3 closures"),
        ([0, 4, 8, 12], "sees poses 100, 104, 108 and 1 more stretch again, 5 closures"),
        ([0, 4, 8, 12, 16], "sees poses 100, 104, 108 and 2 more stretches again, 6 closures"),
    ],
)
def test_they_are_put_in_words(old, text):
    assert described(GRAPH, seen_again(GRAPH, 19, action_on(old))) == text


def test_closures_that_are_not_certain_are_counted_by_their_probability():
    action = action_on([3, 4], probabilities=[1, 1, 0.5, 0.25, 0.25])
    assert described(GRAPH, seen_again(GRAPH, 19, action)) == "sees poses 103 to 104 again, 1.0 of 3 possible closures"
