"""The order of actions: by score, independent of other actions, ties by index."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from graphs import SE2_GROUP, Noise, random_action, random_pose_graph, sessions
from topobelief.errors import IllConditionedError
from topobelief.graph.action import Action
from topobelief.planning.planner import Planner
from topobelief.planning.ranking import first_alike, ranking_of

ENGINES = ("incremental", "scratch")
SIGNATURES = ("spanning_trees", "von_neumann", "von_neumann_approx")
numbers = st.one_of(st.floats(-1e4, 1e4), st.integers(-3, 3).map(lambda step: 100 + step * 1e-9), st.floats(-1e-300, 1e300))
scores = st.lists(st.tuples(numbers, numbers), min_size=1, max_size=8)


def ranked(pairs):
    signatures, costs = np.array(pairs).T
    return ranking_of(signatures, costs).tolist()


@given(scores, st.tuples(numbers, numbers), st.integers(0, 8))
def test_another_score_does_not_reorder_the_others(pairs, another, place):
    place = min(place, len(pairs))
    with_another = ranked([*pairs[:place], another, *pairs[place:]])
    assert [index - (index > place) for index in with_another if index != place] == ranked(pairs)


@given(scores)
def test_scores_that_differ_by_more_than_a_digit_are_in_order(pairs):
    signatures, costs = np.array(pairs).T
    ranking = ranked(pairs)
    digit = 2.0**-31 * np.maximum(1, np.maximum(np.abs(signatures), np.abs(costs)))
    for position, earlier in enumerate(ranking):
        for later in ranking[position + 1 :]:
            score, other = signatures[earlier] - costs[earlier], signatures[later] - costs[later]
            assert score >= other - max(digit[earlier], digit[later])
            assert pairs[earlier] != pairs[later] or earlier < later


def test_scores_that_are_equal_but_for_rounding_go_by_index():
    noise = 1e-13 * np.random.default_rng(0).normal(size=50)
    assert ranking_of(1234.5 + noise, np.zeros(50)).tolist() == list(range(50))
    assert ranking_of(1234.5 + noise, np.full(50, 1234.0)).tolist() == list(range(50))


def badly_scaled(graph, factor):
    """Three poses ahead and back to the first, the first two steps of opposite weight."""
    n, kappa = graph.num_poses, graph.tangent_dim
    place = np.repeat(graph.poses[-1:], 3, axis=0)
    place[:, 0] += np.arange(1, 4)
    weights = np.array([1 / factor, factor, 1.0, 1.0])
    return Action(place, [(n - 1, n), (n, n + 1), (n + 1, n + 2), (n + 2, 0)], weights[:, None, None] * np.eye(kappa))


@settings(max_examples=60)
@given(
    sessions(min_actions=2),
    st.sampled_from(SIGNATURES),
    st.sampled_from([1.0, 1e4, 1e8, 1e12]),
    st.integers(0, 6),
    st.sampled_from(ENGINES),
)
def test_another_action_does_not_reorder_the_others(session, signature, factor, place, engine):
    """At any place, at any scale, in both engines."""
    actions, place = list(session.actions), min(place, len(session.actions))
    more = [*actions[:place], badly_scaled(session.graph, factor), *actions[place:]]
    planner = Planner(session.graph, signature=signature, engine=engine)
    try:
        before, after = planner.decide(actions, proof="none"), planner.decide(more, proof="none")
    except IllConditionedError:
        return
    found = [int(index) - (index > place) for index in after.ranking if index != place]
    assert found == before.ranking.tolist()


def test_a_badly_scaled_action_among_a_thousand():
    """Its rounding error, far above the differences of the others, once made ties of all of them."""
    rng, noise = np.random.default_rng(0), Noise(SE2_GROUP, "equal", 100.0, 0.4, 2.0)
    graph = random_pose_graph(rng, noise, 50, 12)
    actions = [random_action(rng, graph, noise, max_new=8, max_closures=6) for _ in range(1000)]
    before = Planner(graph, engine="incremental").decide(actions, proof="none").ranking
    after = Planner(graph, engine="incremental").decide([*actions, badly_scaled(graph, 1e12)], proof="none").ranking
    assert after[after < 1000].tolist() == before.tolist()


def test_equal_actions_are_found():
    omega = np.diag([1.0, 1.0, 4.0])
    one = Action([[1, 0, 0]], [(0, 1)], omega, label="one", cost=1.0)
    stay, others = (
        Action([], [], omega),
        [
            Action([[1, 0, -0.0]], [(0, 1)], [omega]),
            Action([[1, 0, 0]], [(1, 0)], omega),
            Action([[1, 0, 0]], [(0, 1)], 2 * omega),
            Action([[1, 0, 1e-300]], [(0, 1)], omega),
            Action([[1, 0, 0], [1, 0, 0]], [(0, 1), (1, 2)], omega),
        ],
    )
    assert first_alike([one, *others, stay, stay, one]).tolist() == [0, 0, 2, 3, 4, 5, 6, 6, 0]


@pytest.mark.parametrize("engine", ENGINES)
def test_actions_that_differ_in_the_order_of_their_edges_tie(engine):
    """The same graph, summed up in other orders."""
    rng, noise = np.random.default_rng(1), Noise(SE2_GROUP, "isotropic", 100.0, 0.4, 2.0)
    graph = random_pose_graph(rng, noise, 40, 12)
    action = random_action(rng, graph, noise, max_new=8, max_closures=6)
    shuffled = [
        Action(action.poses, action.edges[order], action.information[order])
        for order in (rng.permutation(len(action.edges)) for _ in range(20))
    ]
    assert Planner(graph, engine=engine).decide(shuffled, proof="none").ranking.tolist() == list(range(20))
