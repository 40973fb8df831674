"""Weights of an active set: a convex function minimised over a simplex, with a limit on a linear function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from scipy.optimize import minimize

from topobelief.arrays import FloatArray

_ITERATIONS = 8
_TOLERANCE = 1e-6
_ROUNDING = 1e-9  # relative
_minimize = cast("Any", minimize)  # whose stub refuses constraints of several kinds


def best_weights(
    function: Callable[[FloatArray], tuple[float, FloatArray]], start: FloatArray, lengths: FloatArray, limit: float
) -> FloatArray:
    """Weights, shape (w,), at least 0 and 1 in sum, with a mean length up to the limit: better than at the start, or the start.

    Parameters
    ----------
    function
        Value and gradient; convex, of the order of 1.
    start : shape (w,)
        May have too large a mean length.
    lengths : shape (w,)
    limit
        At least the smallest of the lengths.
    """
    if len(start) == 1:
        return start

    def normalised(weights: FloatArray) -> FloatArray:
        weights = np.maximum(weights, 0.0)
        return weights / weights.sum()

    def total(weights: FloatArray) -> float:
        return float(weights.sum()) - 1

    def ones(weights: FloatArray) -> FloatArray:
        return np.ones(len(weights))

    def slack(weights: FloatArray) -> float:
        return limit - float(lengths @ weights)

    def slopes_of_slack(weights: FloatArray) -> FloatArray:
        return -lengths

    def of_normalised(weights: FloatArray) -> tuple[float, FloatArray]:
        return function(normalised(weights))

    result = _minimize(
        of_normalised,
        start,
        jac=True,
        method="SLSQP",
        bounds=[(0.0, 1.0)] * len(start),
        constraints=[{"type": "eq", "fun": total, "jac": ones}, {"type": "ineq", "fun": slack, "jac": slopes_of_slack}],
        options={"maxiter": _ITERATIONS, "ftol": _TOLERANCE},
    )
    found = np.asarray(result.x, dtype=np.float64)
    if not np.isfinite(found).all() or np.maximum(found, 0.0).sum() < 0.5:
        return start
    found = normalised(found)
    was_too_long = start @ lengths > limit * (1 + _ROUNDING)
    return found if was_too_long or function(found)[0] <= function(start)[0] else start
