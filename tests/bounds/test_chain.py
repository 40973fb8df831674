"""The chain rule along the closures: a bound for every window, tighter with each closure, exact with all."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engines import DenseEngine, judge
from graphs import SE2_GROUP, SE3_GROUP, Noise, random_action, random_pose_graph, sessions
from topobelief.benchmark.sessions import candidate_paths, city_drive
from topobelief.errors import InvalidInputError
from topobelief.graph.information import block_isotropic
from topobelief.planning.planner import Planner

OBJECTIVES = ("joint", "map", "per_pose")


@given(sessions(log_ratio=(-3.0, 2.0)), st.sampled_from(OBJECTIVES), st.integers(0, 4), st.integers(0, 2**32 - 1))
def test_bounds_hold_for_every_window_and_objective(session, objective, window, seed):
    anchor = int(np.random.default_rng(seed).integers(session.graph.num_poses))
    found = judge(session.graph, bounds="chain", objective=objective, window=window, anchor=anchor)
    lower, upper = found.bounds(session.actions)
    values, errors = found.entropies(session.actions)
    assert (lower <= values + errors).all()
    assert (values - errors <= upper).all()


@given(sessions(log_ratio=(-2.0, 1.0)), st.integers(0, 2**32 - 1))
def test_a_larger_window_is_tighter_and_the_largest_exact(session, seed):
    anchor = int(np.random.default_rng(seed).integers(session.graph.num_poses))
    values, errors = judge(session.graph, anchor=anchor).entropies(session.actions)
    before = np.full(len(values), -np.inf)
    for window in range(12):
        lower, _ = judge(session.graph, bounds="chain", window=window, anchor=anchor).bounds(session.actions)
        rounding = 1e-9 * (1 + np.abs(values))
        assert (before <= lower + rounding).all()
        before = lower
    np.testing.assert_allclose(before, values, rtol=1e-9, atol=1e-7 + 2 * errors.max())


@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP])
@pytest.mark.parametrize("kind", ["equal", "isotropic", "full"])
@pytest.mark.parametrize("window", [0, 1, 2, 5])
def test_the_formula_with_dense_matrices(group, kind, window):
    rng = np.random.default_rng(3)
    graph = random_pose_graph(rng, Noise(group, kind, 100.0, 0.4, 2.0), 25, 12)
    actions = [random_action(rng, graph, Noise(group, kind, 100.0, 0.4, 2.0), max_new=8, max_closures=9) for _ in range(8)]
    if kind == "equal":
        actions = [type(a)(a.poses, a.edges, graph.information[0]) for a in actions]
    found = judge(graph, bounds="chain", window=window).bounds(actions)
    expected = judge(graph, DenseEngine, bounds="chain", window=window).bounds(actions)
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-6)


def test_along_a_path_it_is_20_times_tighter_than_the_anchored_bound_and_shares_its_upper_bound():
    graph = city_drive(500, block_isotropic(0.1, 0.035), rng=np.random.default_rng(3))
    actions = candidate_paths(graph, 30, num_new_poses=100, num_closures=20, rng=np.random.default_rng(4))
    values, _ = judge(graph).entropies(actions)
    anchored, chain = (judge(graph, bounds=family).bounds(actions) for family in ("anchored", "chain"))
    np.testing.assert_allclose(chain[1], anchored[1], rtol=1e-9, atol=1e-7)
    assert np.mean(values - chain[0]) < np.mean(values - anchored[0]) / 20


def test_a_negative_window_is_refused():
    graph = random_pose_graph(np.random.default_rng(0), Noise(SE2_GROUP, "equal", 1.0, 1.0, 1.0), 3, 0)
    with pytest.raises(InvalidInputError, match="expected a window of at least 0 closures, got -1"):
        Planner(graph, bounds="chain", window=-1)
