"""Where to cut weighted places or numbers in two, so that the variance between the two sides is largest."""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray

_LEAST_WEIGHT = 1e-9


def best_line(places: FloatArray, weights: FloatArray, least: float) -> tuple[float, FloatArray, float] | None:
    """Score, normal of a line across the main axis of some places, and where along it the line is."""
    mean = weights @ places / weights.sum()
    scatter = (places - mean).T @ ((places - mean) * weights[:, None])
    normal = np.linalg.eigh(scatter)[1][:, -1]
    cut = best_place(places @ normal, weights, least)
    return None if cut is None else (cut[0], normal, cut[1])


def best_place(values: FloatArray, weights: FloatArray, least: float) -> tuple[float, float] | None:
    """Score and place of the best cut between two numbers that are further than `least` apart."""
    order = np.argsort(values)
    values, share = values[order], weights[order] / weights.sum()
    left = np.cumsum(share)[:-1]
    below = np.cumsum(share * values)[:-1] / left
    above = (share @ values - left * below) / np.maximum(1 - left, _LEAST_WEIGHT)
    between = np.where(np.diff(values) > least, left * (1 - left) * (above - below) ** 2, 0.0)
    cut = int(np.argmax(between))
    return (float(between[cut]), float((values[cut] + values[cut + 1]) / 2)) if between[cut] > 0 else None
