"""How well a signature ranks actions: Definition 1 of Kitanov and Indelman (arXiv 1903.00927), and correlations.

Notation: U* the action of least entropy, U^ the one of largest signature.

    epsilon = |J(U*) - J(U^)|
    gamma   = min over monotone f with f(s(U^)) = J(U^) of max over U of |J(U) - f(s(U))|

f decreases in s. Fitting it is minimax isotonic regression with one point pinned, which has a closed form: half of the worst
order violation between two actions, or the whole of it where the pinned action takes part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray, frozen_floats
from topobelief.errors import InvalidInputError

_RELATIVE_TOLERANCE = 1e-12  # entropies closer than this are the same


@dataclass(frozen=True, slots=True)
class DecisionQuality:
    """Quality of a ranking by signature against exact entropies.

    Attributes
    ----------
    error
        epsilon, nats: what choosing by signature loses.
    gamma
        Nats: how far the order of all actions is from being kept.
    action_consistent, order_consistent
        Whether epsilon, and gamma, vanish (to rounding).
    spearman, kendall, pearson
        Correlations of J with -s; 1 is perfect, nan where J or s is constant.
    """

    error: float
    gamma: float
    action_consistent: bool
    order_consistent: bool
    spearman: float
    kendall: float
    pearson: float


def decision_quality(entropies: ArrayLike, signatures: ArrayLike) -> DecisionQuality:
    """Compare a signature with the entropies that it stands for.

    Parameters
    ----------
    entropies : shape (K,)
        Exact J of each action, nats, all finite; K >= 1.
    signatures : shape (K,)
        s of each action; the larger, the better. The first of equal ones is chosen.

    Raises
    ------
    InvalidInputError
        Where the shapes differ or a value is not finite.

    Examples
    --------
    >>> quality = decision_quality([-10.0, -12.0, -11.0], [1.0, 3.0, 2.0])
    >>> quality.error, quality.gamma, quality.order_consistent
    (0.0, 0.0, True)
    """
    J, s = frozen_floats(entropies, name="entropies"), frozen_floats(signatures, name="signatures")
    if J.ndim != 1 or J.shape != s.shape or len(J) == 0:
        raise InvalidInputError(f"expected entropies and signatures of one shape (K,), K >= 1, got {J.shape} and {s.shape}")
    if not (np.isfinite(J).all() and np.isfinite(s).all()):
        raise InvalidInputError("expected finite entropies and signatures, got nan or inf; evaluate every action first")
    chosen = int(np.argmax(s))
    error = float(J[chosen] - J.min())
    gamma = max(_worst_violation(J, s) / 2, _pinned_violation(J, s, chosen))
    tolerance = _RELATIVE_TOLERANCE * float(np.abs(J).max())
    spearman, kendall, pearson = _correlations(J, -s)
    return DecisionQuality(error, gamma, error <= tolerance, gamma <= tolerance, spearman, kendall, pearson)


def rank_correlation(a: ArrayLike, b: ArrayLike) -> float:
    """Spearman's rank correlation; nan where an input is constant or has fewer than two values."""
    first, second = _mean_ranks(a), _mean_ranks(b)
    if len(first) < 2 or np.ptp(first) == 0 or np.ptp(second) == 0:
        return float("nan")
    return float(np.corrcoef(first, second)[0, 1])


def _mean_ranks(values: ArrayLike) -> FloatArray:
    """Ranks from 1, ties sharing their mean."""
    _, group, counts = np.unique(np.asarray(values, dtype=np.float64), return_inverse=True, return_counts=True)
    return (np.cumsum(counts) - (counts - 1) / 2)[group]


def _worst_violation(J: FloatArray, s: FloatArray) -> float:
    """max of J_a - J_b over pairs with s_a >= s_b, which f would have to map to f(s_a) <= f(s_b)."""
    order = np.argsort(-s, kind="stable")
    running = np.maximum.accumulate(J[order])
    last_of_ties = np.searchsorted(-s[order], -s[order], side="right") - 1
    return float(np.max(running[last_of_ties] - J[order]))


def _pinned_violation(J: FloatArray, s: FloatArray, chosen: int) -> float:
    """max of J(U^) - J, and of |J(U^) - J| where s ties with the chosen: f cannot meet these half-way."""
    below = float(np.max(J[chosen] - J))
    return max(below, float(np.max(np.abs(J - J[chosen])[s == s[chosen]])))


def _correlations(a: FloatArray, b: FloatArray) -> tuple[float, float, float]:
    if len(a) < 2 or np.ptp(a) == 0 or np.ptp(b) == 0:
        return float("nan"), float("nan"), float("nan")
    from scipy import stats  # heavy, and needed only when quality is asked for

    kendall = float(stats.kendalltau(a, b).statistic)
    scaled = [(values - values.mean()) / np.ptp(values) for values in (a, b)]  # whatever the unit, nothing overflows
    return rank_correlation(a, b), kendall, float(np.corrcoef(*scaled)[0, 1])
