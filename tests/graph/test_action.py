"""Actions: what they may hold, what they may not, and the posterior that they lead to."""

import numpy as np
import pytest
from hypothesis import given

from graphs import sessions
from topobelief.errors import InvalidActionError
from topobelief.graph.action import Action, check_actions, driven_lengths, posterior
from topobelief.graph.pose_graph import PoseGraph

EYE = np.eye(3)
PRIOR = PoseGraph(
    [[0, 0, 0], [1, 0, 0], [2, 0, 0]], [(0, 1), (1, 2)], [[1, 0, 0.1], [1, 0, -0.1]], 4 * EYE, ids=[5, 9, 7], fixed=(2,)
)
SPATIAL = PoseGraph([[0, 0, 0, 0, 0, 0, 1], [1, 0, 0, 0, 0, 0, 1]], [(0, 1)], None, np.eye(6))


def chain(length):
    return [[3 + step, 0, 0] for step in range(length)]


def test_a_length_is_what_the_action_says_or_runs_along_its_new_poses():
    """From the old pose that the first new one is joined to; a later one may hang elsewhere."""
    from_the_last = Action([[2, 1, 0], [5, 5, 0]], [(2, 3), (3, 4), (4, 0)], EYE)
    from_the_first = Action([[0, 3, 0]], [(3, 0), (3, 2)], EYE)
    loose_at_first = Action([[9, 9, 0], [9, 8, 0]], [(3, 4), (4, 2)], EYE)
    stay = Action(np.zeros((0, 3)), [(0, 2)], EYE)
    said = Action([[2, 1, 0]], [(2, 3)], EYE, length=7.5)
    assert driven_lengths(PRIOR, [from_the_last, from_the_first, loose_at_first, stay, said]) == [6, 3, 1, 0, 7.5]


@pytest.mark.parametrize("length", [-1.0, np.inf, np.nan])
def test_a_length_that_is_none_is_refused(length):
    with pytest.raises(InvalidActionError, match="expected a length of at least 0 m"):
        Action([[2, 1, 0]], [(2, 3)], EYE, length=length)


@given(sessions())
def test_the_posterior_is_the_prior_and_then_the_action(session):
    graph = session.graph
    for action in session.actions:
        after = posterior(graph, action)
        n, m = graph.num_poses, graph.num_edges
        assert (after.num_poses, after.num_edges) == (n + action.num_new_poses, m + len(action.edges))
        assert action.num_closures == len(action.edges) - action.num_new_poses
        assert np.array_equal(after.poses[:n], graph.poses)
        assert np.array_equal(after.poses[n:], action.poses)
        assert np.array_equal(after.edges[m:], action.edges)
        assert np.array_equal(after.measurements[:m], graph.measurements)
        assert np.array_equal(after.information[m:], action.information)
        assert len(set(after.ids.tolist())) == after.num_poses
        after.topology.require_connected()
        i, j = action.edges.T
        assert np.array_equal(after.measurements[m:], graph.group.between(after.poses[i], after.poses[j]))
        rebuilt = PoseGraph(after.poses, after.edges, after.measurements, after.information)
        assert np.array_equal(rebuilt.poses, after.poses)


def test_the_posterior_keeps_ids_and_measurements_of_the_prior():
    after = posterior(PRIOR, Action(chain(2), [(2, 3), (4, 3), (0, 4)], EYE))
    assert after.ids.tolist() == [5, 9, 7, 10, 11]
    assert after.fixed == (2,)
    assert after.measurements[:2].tolist() == PRIOR.measurements.tolist()
    assert after.measurements[3].tolist() == [-1, 0, 0]
    for array in (after.poses, after.edges, after.measurements, after.information, after.ids):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    assert PRIOR.num_poses == 3


@pytest.mark.parametrize("poses", [[], np.zeros((0, 3))], ids=["list", "array"])
@pytest.mark.parametrize("edges", [[], np.zeros((0, 2), dtype=int)], ids=["list", "array"])
def test_staying_is_an_action(poses, edges):
    after = posterior(PRIOR, Action(poses, edges, EYE))
    assert (after.num_poses, after.num_edges) == (3, 2)


def test_staying_is_an_action_in_space_too():
    for stay in (Action([], [], np.eye(6)), Action(np.zeros((0, 7)), [], np.zeros((0, 6, 6)))):
        assert posterior(SPATIAL, stay).num_poses == 2
    assert posterior(SPATIAL, Action(np.zeros((0, 7)), [], [])).num_poses == 2


@pytest.mark.parametrize(
    ("poses", "edges"),
    [
        (chain(2), [(2, 3), (3, 4)]),
        (chain(2), [(3, 2), (4, 3)]),  # turned
        (chain(2), [(3, 4), (2, 3)]),  # any order
        (chain(2), [(0, 4), (4, 3)]),  # numbered backwards
        (chain(3), [(1, 3), (3, 4), (3, 5)]),  # a branch
        (chain(3), [(0, 3), (1, 4), (2, 5)]),  # several chains
        (chain(3), [(2, 3), (3, 4), (4, 5), (5, 3)]),  # a loop among new poses
        (chain(1), [(2, 3), (2, 3), (3, 2)]),  # parallel edges
        ([], [(0, 2)]),  # no new poses
    ],
)
def test_any_shape_of_action_is_welcome(poses, edges):
    action = Action(poses, edges, EYE)
    check_actions(PRIOR, [action])
    assert posterior(PRIOR, action).edges[2:].tolist() == [list(edge) for edge in edges]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((chain(1), [(2, -3)], EYE), r"action \('left'\), edge 0: expected indices from 0, got a negative one"),
        ((chain(1), [(2, 3, 4)], EYE), r"expected edges of shape \(c, 2\), got \(1, 3\)"),
        ((chain(1), [(2.0, 3.0)], EYE), "expected edges to be integers, got dtype float64"),
        (([[0, 0, np.nan]], [(2, 3)], EYE), "expected finite poses, got nan or inf in row 0"),
        (([[0, 0]], [(2, 3)], EYE), r"expected poses of shape .*got \(1, 2\)"),
        ((chain(1), [(2, 3)], np.zeros((3, 3))), "expected a positive definite information matrix.* at edge 0"),
        ((chain(2), [(2, 3), (3, 4)], [EYE, -EYE]), "expected a positive definite information matrix.* at edge 1"),
        ((chain(1), [(2, 3)], np.eye(6)), r"expected information of shape \(1, 3, 3\) or \(3, 3\).*got \(6, 6\)"),
        ((chain(1), [(2, 3)], 1.0), r"expected information of shape .*got \(\)"),
        ((chain(1), [(2, 3)], [EYE, EYE]), r"expected information of shape \(1, 3, 3\).*got \(2, 3, 3\)"),
    ],
)
def test_a_malformed_action_is_refused_when_it_is_made(arguments, message):
    with pytest.raises(InvalidActionError, match=message):
        Action(*arguments, label="left")


@pytest.mark.parametrize("cost", [np.nan, np.inf, -np.inf])
def test_a_cost_is_finite(cost):
    with pytest.raises(InvalidActionError, match="expected a finite cost in nats, got"):
        Action(chain(1), [(2, 3)], EYE, cost=cost)


GOOD = Action(chain(1), [(2, 3)], EYE)


@pytest.mark.parametrize(
    ("bad", "message", "edge"),
    [
        (
            Action(chain(1), [(2, 3), (1, 4)], EYE, label="left"),
            r"action 1 \('left'\), edge 1: expected indices below 4 \(3 poses and 1 new ones\), got \(1, 4\)",
            1,
        ),
        (
            Action(chain(1), [(2, 3), (1, 1)], EYE),
            "action 1, edge 1: expected an edge between two poses, got a self-loop at 1",
            1,
        ),
        (Action(chain(1), [(3, 3)], EYE), "action 1, edge 0: expected an edge between two poses, got a self-loop at 3", 0),
        (
            Action(chain(2), [(2, 3)], EYE),
            "action 1: expected every new pose to be attached to the graph, got new pose 4 without",
            None,
        ),
        (
            Action(chain(2), [(3, 4)], EYE),
            "action 1: expected every new pose to be attached to the graph, got new pose 3 without",
            None,
        ),
        (
            Action(chain(1), [], EYE),
            "action 1: expected every new pose to be attached to the graph, got new pose 3 without",
            None,
        ),
        (
            Action(chain(1), [(0, 1)], EYE),
            "action 1: expected every new pose to be attached to the graph, got new pose 3 without",
            None,
        ),
        (
            Action(np.zeros((1, 7)) + np.eye(7)[6], [(2, 3)], np.eye(6)),
            r"action 1: expected information matrices of size 3",
            None,
        ),
    ],
)
def test_a_misfit_names_action_and_edge_before_any_work(bad, message, edge):
    with pytest.raises(InvalidActionError, match=message) as info:
        check_actions(PRIOR, [GOOD, bad])
    assert (info.value.action, info.value.edge) == (1, edge)
    with pytest.raises(InvalidActionError, match=message.replace("action 1", "action")):
        posterior(PRIOR, bad)


def test_nothing_to_choose_from_is_an_error():
    with pytest.raises(InvalidActionError, match="expected at least one action to choose from, got none"):
        check_actions(PRIOR, [])


def test_actions_copy_their_arrays():
    poses, edges = np.array(chain(1), dtype=float), np.array([(2, 3)])
    action = Action(poses, edges, EYE)
    poses[:], edges[:] = 0, 0
    assert (action.poses.tolist(), action.edges.tolist()) == ([[3, 0, 0]], [[2, 3]])
    with pytest.raises(AttributeError):
        action.cost = 3.0


def test_new_poses_get_ids_after_the_largest_or_where_there_is_room():
    """Ids end at 2^63 - 1; from there on new poses take the smallest ones that are free."""
    for ids, expected in (([5, 7], [8, 9]), ([1, 2**63 - 4], [2**63 - 3, 2**63 - 2]), ([1, 2**63 - 1], [0, 2])):
        graph = PoseGraph([[0, 0, 0], [1, 0, 0]], [(0, 1)], None, np.eye(3), ids=ids)
        action = Action([[2, 0, 0], [3, 0, 0]], [(1, 2), (2, 3)], np.eye(3))
        assert posterior(graph, action).ids.tolist() == [*ids, *expected]


class TestProbabilities:
    def test_count_closures_as_often_as_they_are_expected(self) -> None:
        action = Action([[2, 0, 0]], [(1, 2), (2, 0), (2, 0)], np.eye(3), probabilities=[1, 0.5, 0.25])
        assert action.probabilities.tolist() == [1, 0.5, 0.25]
        assert (action.num_closures, action.expected_closures) == (2, 0.75)
        certain = Action([[2, 0, 0]], [(1, 2), (2, 0)], np.eye(3))
        assert certain.probabilities is None
        assert certain.expected_closures == 1

    @pytest.mark.parametrize(
        ("given", "message"),
        [
            ([1], "a probability for each of the 2 edges, got shape"),
            ([1, 0], "above 0"),
            ([1, 1.1], "above 0"),
            ([1, np.nan], "above 0"),
        ],
    )
    def test_that_are_none_are_refused(self, given: list, message: str) -> None:
        with pytest.raises(InvalidActionError, match=message):
            Action([[2, 0, 0]], [(1, 2), (2, 0)], np.eye(3), probabilities=given)
