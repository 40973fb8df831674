"""Definition 1: epsilon and gamma in closed form against a linear program, consistency, and correlations."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from scipy.optimize import linprog

from topobelief.errors import InvalidInputError
from topobelief.planning.decision_quality import decision_quality, rank_correlation

numbers = st.one_of(st.integers(-4, 4).map(float), st.floats(-50, 50).map(lambda value: round(value, 6)))
values = st.lists(st.tuples(numbers, numbers), min_size=1, max_size=9)


def gamma_by_linear_program(J, s):
    """min over f, decreasing in s and pinned at the largest s, of max |J - f(s)|."""
    K, chosen = len(J), int(np.argmax(s))
    rows, limits = [], []
    for a in range(K):
        fit = np.zeros(K + 1)
        fit[[a, K]] = 1, -1
        rows += [fit, np.where(np.arange(K + 1) == K, -1.0, -fit)]
        limits += [J[a], -J[a]]
        for b in range(K):
            if a != b and s[a] >= s[b]:  # f(s_a) <= f(s_b); ties both ways
                order = np.zeros(K + 1)
                order[[a, b]] = 1, -1
                rows.append(order)
                limits.append(0.0)
    pin = np.zeros((1, K + 1))
    pin[0, chosen] = 1
    cost = np.zeros(K + 1)
    cost[K] = 1
    solution = linprog(
        cost,
        A_ub=np.array(rows),
        b_ub=limits,
        A_eq=pin,
        b_eq=[J[chosen]],
        bounds=[(None, None)] * K + [(0, None)],
        method="highs",
    )
    assert solution.status == 0
    return solution.fun


@settings(max_examples=150)
@given(values)
def test_gamma_is_the_minimax_monotone_fit(pairs):
    J, s = np.array(pairs).T
    quality = decision_quality(J, s)
    assert quality.gamma == pytest.approx(gamma_by_linear_program(J, s), abs=1e-6)
    assert quality.error == pytest.approx(J[np.argmax(s)] - J.min(), abs=1e-12)
    assert quality.error <= quality.gamma + 1e-12  # the pinned point is too high by epsilon for U*
    assert quality.action_consistent == (quality.error <= 1e-12 * np.abs(J).max())
    assert quality.order_consistent == (quality.gamma <= 1e-12 * np.abs(J).max())


@given(values, st.floats(0.1, 10), st.floats(-5, 5))
def test_quality_sees_the_order_of_signatures_only(pairs, slope, offset):
    J, s = np.array(pairs).T
    order = np.unique(s, return_inverse=True)[1]
    before, after = decision_quality(J, s), decision_quality(J, slope * order + offset)
    assert (before.error, before.gamma) == (after.error, after.gamma)
    shifted = decision_quality(J + 7, s)
    assert (shifted.error, shifted.gamma) == (pytest.approx(before.error, abs=1e-12), pytest.approx(before.gamma, abs=1e-12))


@given(values)
def test_correlations_are_those_of_scipy_between_J_and_minus_s(pairs):
    J, s = np.array(pairs).T
    quality = decision_quality(J, s)
    if len(J) < 2 or np.ptp(J) == 0 or np.ptp(s) == 0:
        assert all(math.isnan(value) for value in (quality.spearman, quality.kendall, quality.pearson))
        return
    assert quality.spearman == pytest.approx(stats.spearmanr(J, -s).statistic, abs=1e-12)
    assert quality.kendall == pytest.approx(stats.kendalltau(J, -s).statistic, abs=1e-12)
    if np.ptp(J) > 1e-6 and np.ptp(s) > 1e-6:
        assert quality.pearson == pytest.approx(stats.pearsonr(J, -s).statistic, abs=1e-9)


def test_a_perfect_signature():
    J = np.array([3.0, 1.0, 2.0, -5.0])
    quality = decision_quality(J, -J)
    assert (quality.error, quality.gamma, quality.action_consistent, quality.order_consistent) == (0, 0, True, True)
    assert (quality.spearman, quality.kendall) == (1, 1)
    assert quality.pearson == 1


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=2, max_size=40))
def test_a_perfect_order_correlates_with_exactly_1(J):
    """And the opposite one with exactly -1, whatever the numbers are."""
    J = np.array(J)
    perfect, opposite = decision_quality(J, -J), decision_quality(J, J)
    if len(np.unique(J)) == 1:
        assert math.isnan(perfect.spearman)
        return
    assert (perfect.error, perfect.gamma, perfect.order_consistent) == (0, 0, True)
    assert (perfect.spearman, perfect.kendall, perfect.pearson) == (1, 1, 1)
    assert (opposite.spearman, opposite.kendall, opposite.pearson) == (-1, -1, pytest.approx(-1))
    assert rank_correlation(J, J) == 1


@pytest.mark.parametrize("unit", [5e-324, 1e-320, 1e-300, 1e300, 3e307])
def test_numbers_near_the_ends_of_double_precision_neither_overflow_nor_vanish(unit):
    """Warnings are errors in these tests."""
    J, s = np.array([5.0, 1.0, -5.0, 2.0]), np.array([3.0, 2.0, 1.0, 0.0])
    usual, extreme = decision_quality(J, s), decision_quality(np.float64(unit) * J, np.float64(unit) * s)
    assert extreme.error == (np.float64(unit) * 10 if unit < 1e307 else math.inf)  # 3e308 is no double
    assert (usual.error, usual.gamma) == (10, 10)
    assert (extreme.action_consistent, extreme.order_consistent) == (False, False)
    assert (extreme.spearman, extreme.kendall) == (usual.spearman, usual.kendall)
    assert extreme.pearson == pytest.approx(usual.pearson)


def test_a_gamma_that_is_a_double_is_found_though_the_difference_is_none():
    quality = decision_quality([-1.6e308, 1.6e308, -1.5e308], [3.0, 2.0, 1.0])
    assert (quality.error, quality.gamma) == (0, pytest.approx(1.55e308))


def test_a_swap_among_losers_costs_half_of_it_and_one_with_the_winner_the_whole():
    assert decision_quality([0, 10, 6], [3, 2, 1]).gamma == 2  # f meets 10 and 6 half-way
    assert decision_quality([0, 10, 6], [3, 2, 1]).action_consistent
    swapped = decision_quality([4, 0, 10], [3, 2, 1])  # f(s of the first) = 4 stays above the second's 0
    assert (swapped.error, swapped.gamma, swapped.action_consistent) == (4, 4, False)


def test_ties_of_the_chosen_are_pinned_too():
    quality = decision_quality([1.0, 5.0, 9.0], [2.0, 2.0, 1.0])
    assert (quality.error, quality.gamma) == (0, 4)


def test_ties_among_losers_meet_half_way():
    """One signature, two entropies: f takes the middle, in whatever order they are listed."""
    for J in ([0.0, 3.0, 9.0], [0.0, 9.0, 3.0]):
        assert decision_quality(J, [5.0, 1.0, 1.0]).gamma == 3


@pytest.mark.parametrize("unit", [1e-290, 1e-160, 1e160, 1e290])
def test_correlations_do_not_depend_on_the_unit_of_a_signature(unit):
    """Squares of tiny or huge numbers vanish or overflow; a correlation does not."""
    quality = decision_quality([0.0, 1.0, 5.0], [-unit * value for value in (0.0, 2.0, 3.0)])
    assert quality.pearson == pytest.approx(stats.pearsonr([0, 1, 5], [0, 2, 3]).statistic)
    assert (quality.spearman, quality.kendall) == (pytest.approx(1), pytest.approx(1))


def test_one_action_is_consistent():
    quality = decision_quality([-7.0], [3.0])
    assert (quality.error, quality.gamma, quality.action_consistent, quality.order_consistent) == (0, 0, True, True)
    assert math.isnan(quality.spearman)


def test_rank_correlation_of_a_constant_is_nan():
    assert rank_correlation([1, 2, 3], [10, 20, 15]) == pytest.approx(0.5)
    assert math.isnan(rank_correlation([1, 1, 1], [1, 2, 3]))
    assert math.isnan(rank_correlation([1], [2]))


@pytest.mark.parametrize(
    ("J", "s", "message"),
    [
        ([], [], r"of one shape \(K,\), K >= 1, got \(0,\) and \(0,\)"),
        ([1.0], [1.0, 2.0], r"got \(1,\) and \(2,\)"),
        ([[1.0]], [[1.0]], r"got \(1, 1\) and \(1, 1\)"),
        ([1.0, math.nan], [1.0, 2.0], "got nan or inf; evaluate every action first"),
        ([1.0, 2.0], [1.0, math.inf], "got nan or inf; evaluate every action first"),
    ],
)
def test_bad_input_is_refused(J, s, message):
    with pytest.raises(InvalidInputError, match=message):
        decision_quality(J, s)


def test_the_unit_is_told_where_it_is_known():
    assert repr(decision_quality([1.0, 2.0], [0.0, 1.0])).startswith("DecisionQuality(error 1, gamma 1, ")
    assert "error 1 m, gamma 1 m" in repr(decision_quality([1.0, 2.0], [0.0, 1.0], unit="m"))
