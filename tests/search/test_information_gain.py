"""Gains of plans: exact on walks, concave, with the right gradient."""

import math
from dataclasses import replace

import numpy as np
import pytest

import topobelief as tb
from roadmap_walks import map_error, plan_of, random_case
from topobelief.search.criteria import Criterion
from topobelief.search.information_gain import gain, gain_and_slopes
from topobelief.search.plans import Background, Mixture, Plan
from topobelief.search.reduced_prior import ReducedPrior

KINDS = ("map", "joint", "error")


def _prior(case, seen, factors=None) -> ReducedPrior:
    return ReducedPrior(
        case.graph,
        case.graph.num_poses - 1,
        seen,
        case.information,
        probability=case.rule.probability,
        min_index_gap=case.rule.min_index_gap,
        with_errors=True,
        factors=factors,
    )


@pytest.mark.parametrize("held", [None, 0])
def test_factors_that_a_planner_has_made_give_the_same_prior(held):
    """Those that hold another pose give the sample alone."""
    case = random_case(16)
    planner = tb.Planner(case.graph, objective="error", engine="incremental", anchor=held)
    planner.entropies([case.action(case.walks()[0])])
    every = np.arange(case.graph.num_poses)
    shared, own = _prior(case, every, planner.factors), _prior(case, every)
    assert shared.mean_square == pytest.approx(own.mean_square, rel=1e-9)
    assert shared.sigma(every, every) == pytest.approx(own.sigma(every, every), rel=1e-9, abs=1e-12)
    assert shared.kernel(every, every) == pytest.approx(own.kernel(every, every), rel=1e-9, abs=1e-12)


def _random_plan(rng: np.random.Generator, count: int, num_seen: int) -> Plan:
    closures = rng.uniform(0, 1, (count, num_seen)) * (rng.random((count, num_seen)) < 0.3)
    root = rng.normal(size=(count, 3, 3)) * 10
    return Plan(closures, root @ root.transpose(0, 2, 1) + np.eye(3), count, 0.0, 0.0)


@pytest.mark.parametrize("seed", [5, 16, 25, 34])
def test_a_walk_is_worth_what_the_planner_says(seed):
    """Entropies to 1e-9, with idle poses too; errors against dense matrices."""
    case = random_case(seed)
    for walk in case.walks()[:6]:
        action = case.action(walk)
        if action.num_new_poses == 0:
            continue
        seen = np.union1d(action.edges[action.num_new_poses :, 1], [0, 3])
        prior = _prior(case, seen)
        for objective in ("map", "joint", "per_pose"):
            plan = plan_of(case.graph, action, seen, num_idle=2)
            criterion = Criterion.of(objective, prior, plan.odometry[-1], len(plan.closures), 0)
            value = criterion.of_gain(gain(prior, criterion.kind, plan)) + criterion.linear(plan)
            if objective == "per_pose":  # J - reference times its poses, so this is J of a reference of 0
                value = criterion.of_gain(gain(prior, "joint", plan)) + criterion.compared_with(0.0).linear(plan)
                value /= criterion.free_poses + plan.num_poses
            exact = tb.Planner(case.graph, objective=objective, engine="scratch").entropies([action])[0]
            assert value == pytest.approx(exact, abs=1e-9)
        plan = plan_of(case.graph, action, seen)
        error = math.sqrt(prior.mean_square - gain(prior, "error", plan))
        assert error == pytest.approx(map_error(case.graph, action), rel=1e-8)
        assert error == pytest.approx(tb.expected_errors(case.graph, action).map_rmse, rel=1e-8)
        planned = tb.Planner(case.graph, objective="error", engine="scratch").entropies([action])[0]
        assert error == pytest.approx(planned, rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_slopes_are_derivatives(kind):
    rng = np.random.default_rng(4)
    case = random_case(5)
    seen = np.array([0, 2, 3, 7, case.graph.num_poses - 1])
    prior = _prior(case, seen)
    at, towards = (_random_plan(rng, 4, len(seen)) for _ in range(2))
    value, slopes = gain_and_slopes(prior, kind, at)
    assert value == gain(prior, kind, at)
    step = 1e-5
    one, two = (
        gain(prior, kind, Plan(at.closures + h * towards.closures, at.odometry + h * towards.odometry, 0, 0, 0))
        for h in (step, 2 * step)
    )
    assert (4 * one - two - 3 * value) / (2 * step) == pytest.approx(slopes.of(towards), rel=1e-3)
    assert (slopes.closures >= 0).all()
    touched = gain_and_slopes(prior, kind, at, among=np.flatnonzero(at.closures.any(axis=0)))[1]
    assert touched.of(at) == pytest.approx(slopes.of(at), rel=1e-12)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(6))
def test_concave_and_below_the_bound_by_its_gradient(kind, seed):
    """Along segments, and the two bounds that use a root of the determinant and the inverse of the trace."""
    rng = np.random.default_rng(seed)
    case = random_case(5)
    seen = np.array([0, 1, 3, 6, case.graph.num_poses - 1])
    prior = _prior(case, seen)
    left, right = (_random_plan(rng, 3, len(seen)) for _ in range(2))
    middle = Plan((left.closures + right.closures) / 2, (left.odometry + right.odometry) / 2, 3, 0, 0)
    ends = gain(prior, kind, left), gain(prior, kind, right)
    assert gain(prior, kind, middle) >= sum(ends) / 2 - 1e-12
    value, slopes = gain_and_slopes(prior, kind, left)
    ahead = slopes.of(right) - slopes.of(left)
    assert ends[1] <= value + ahead + 1e-12
    criterion = Criterion.of({"joint": "joint", "map": "map", "error": "error"}[kind], prior, np.eye(3), 3, 0)
    least = criterion.least(value, ahead)
    assert criterion.of_gain(value + ahead) - 1e-12 <= least <= criterion.of_gain(ends[1]) + 1e-9
    assert criterion.needed(value, least) == pytest.approx(ahead, rel=1e-6)


@pytest.mark.parametrize("kind", ["map", "error"])
def test_mixtures_in_different_cells_gain_less(kind):
    """Two walks as one variable a pose see more together than as two; slopes of both are derivatives."""
    rng = np.random.default_rng(1)
    case = random_case(5)
    seen = np.array([0, 2, 3, 7, case.graph.num_poses - 1])
    prior = _prior(case, seen)
    left, right = (_random_plan(rng, 3, len(seen)) for _ in range(2))
    nothing = Background(2, np.zeros((6, len(seen))), np.zeros(0, int), np.zeros(0, int), np.zeros((0, 3, 3)))
    apart = replace(right, cells=np.array([0, 1, 1]))
    half = np.array([0.5, 0.5])
    together = gain(prior, kind, Mixture([left, right], half, nothing, 0.0))
    value, slopes = gain_and_slopes(prior, kind, Mixture([left, apart], half, nothing, 0.0))
    ends = gain(prior, kind, left), gain(prior, kind, right)
    assert sum(ends) / 2 <= value < together
    for plan, other in ((left, ends[0]), (apart, ends[1])):
        ahead = slopes.of(plan) - (slopes.of(left) + slopes.of(apart)) / 2
        assert other <= value + ahead + 1e-12
    step = 1e-5
    one, two = (gain(prior, kind, Mixture([left, apart], half + np.array([h, -h]), nothing, 0.0)) for h in (step, 2 * step))
    assert (4 * one - two - 3 * value) / (2 * step) == pytest.approx(slopes.of(left) - slopes.of(apart), rel=1e-3)
