"""How well a signature ranks actions: Definition 1 of Kitanov and Indelman (arXiv 1903.00927), and correlations.

Notation: U* the action of least entropy, U^ the one of largest signature.

    epsilon = |J(U*) - J(U^)|
    gamma   = min over monotone f with f(s(U^)) = J(U^) of max over U of |J(U) - f(s(U))|

f decreases in s. Fitting it is minimax isotonic regression with f prescribed at one point, which has a closed form: half of the
worst violation of the order between two actions, or the whole of it where the chosen action is one of them.
"""

from __future__ import annotations

import math
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
        epsilon, in the unit of J: what choosing by signature loses; inf where that is more than the largest double.
    gamma
        In the unit of J: how far the order of all actions is from being kept.
    action_consistent, order_consistent
        Whether epsilon, and gamma, vanish (to rounding).
    spearman, kendall, pearson
        Correlations of J with -s; 1 is perfect, nan where J or s is constant.
    unit
        Of the error and gamma; empty where it is not known.
    """

    error: float
    gamma: float
    action_consistent: bool
    order_consistent: bool
    spearman: float
    kendall: float
    pearson: float
    unit: str = ""

    def __repr__(self) -> str:
        correlations = f"Spearman {self.spearman:.3g}, Kendall {self.kendall:.3g}, Pearson {self.pearson:.3g}"
        error, gamma = (f"{value:.3g} {self.unit}".rstrip() for value in (self.error, self.gamma))
        return f"DecisionQuality(error {error}, gamma {gamma}, {correlations})"


def decision_quality(entropies: ArrayLike, signatures: ArrayLike, *, unit: str = "") -> DecisionQuality:
    """Compare a signature with the entropies that it stands for.

    Parameters
    ----------
    entropies : shape (K,)
        Exact J of each action, all finite; K >= 1.
    signatures : shape (K,)
        s of each action; the larger, the better. The first of equal ones is chosen.
    unit
        Of J, such as "nats" or "m" (`Decision.unit`), for the text that shows the quality.

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
    spearman, kendall, pearson = _correlations(J, -s)
    scaled, exponent = _moderate(J)
    chosen = int(np.argmax(s))
    error = float(scaled[chosen] - scaled.min())
    gamma = max(_worst_violation(scaled, s) / 2, _violation_of_chosen(scaled, s, chosen))
    tolerance = _RELATIVE_TOLERANCE * float(np.abs(scaled).max())
    with np.errstate(over="ignore"):
        error_of_J, gamma_of_J = np.ldexp([error, gamma], exponent).tolist()
    return DecisionQuality(error_of_J, gamma_of_J, error <= tolerance, gamma <= tolerance, spearman, kendall, pearson, unit)


def rank_correlation(a: ArrayLike, b: ArrayLike) -> float:
    """Spearman's rank correlation; nan where an input is constant or has fewer than two values."""
    first, second = _mean_ranks(a), _mean_ranks(b)
    if len(first) < 2 or np.ptp(first) == 0 or np.ptp(second) == 0:
        return math.nan
    return _correlation(first, second)


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


def _violation_of_chosen(J: FloatArray, s: FloatArray, chosen: int) -> float:
    """max of J(U^) - J, and of |J(U^) - J| where s ties with the chosen: f cannot meet these half-way."""
    below = float(np.max(J[chosen] - J))
    return max(below, float(np.max(np.abs(J - J[chosen])[s == s[chosen]])))


def _correlations(a: FloatArray, b: FloatArray) -> tuple[float, float, float]:
    """Spearman's, Kendall's and Pearson's; nan where an input is constant."""
    if len(np.unique(a)) < 2 or len(np.unique(b)) < 2:
        return math.nan, math.nan, math.nan
    return rank_correlation(a, b), _kendall(a, b), _correlation(_from_zero_to_one(a), _from_zero_to_one(b))


def _correlation(a: FloatArray, b: FloatArray) -> float:
    """Pearson's correlation; exactly 1 for equal inputs, since the root of a square is exact."""
    a, b = a - a.mean(), b - b.mean()
    return min(1.0, max(-1.0, float(a @ b) / math.sqrt(float(a @ a) * float(b @ b))))


def _kendall(a: FloatArray, b: FloatArray) -> float:
    """Kendall's tau_b, without the rounding of SciPy's: concordant less discordant pairs are a whole number."""
    from scipy import stats  # heavy, and needed only when quality is asked for

    scale = math.sqrt(_num_untied_pairs(a) * _num_untied_pairs(b))
    return round(float(stats.kendalltau(a, b).statistic) * scale) / scale


def _num_untied_pairs(values: FloatArray) -> int:
    counts = np.unique(values, return_counts=True)[1]
    return (len(values) ** 2 - int(np.sum(counts**2))) // 2


def _from_zero_to_one(values: FloatArray) -> FloatArray:
    moderate, _ = _moderate(values)
    return (moderate - moderate.min()) / np.ptp(moderate)


def _moderate(values: FloatArray) -> tuple[FloatArray, int]:
    """Values between -1/2 and 1/2, whose differences cannot overflow, and the power of two by which they were divided."""
    exponent = int(np.frexp(np.abs(values).max())[1]) + 1
    return np.ldexp(values, -exponent), exponent
