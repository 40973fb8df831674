"""Distances to straight segments, in the plane or in space."""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray

_TINY = np.finfo(float).tiny


def distances_to_segments(points: FloatArray, starts: FloatArray, ends: FloatArray) -> FloatArray:
    """Distance of points to segments, metres; shapes (…, k), which are broadcast, to (…)."""
    along, to_point = ends - starts, points - starts
    share = products(to_point, along) / np.maximum(products(along, along), _TINY)
    apart = to_point - np.clip(share, 0.0, 1.0)[..., None] * along
    return np.sqrt(products(apart, apart))


def products(a: FloatArray, b: FloatArray) -> FloatArray:
    """Products of vectors of 2 or 3 components, shapes (…, k), broadcast; faster than a sum over the last axis."""
    plane = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]
    return plane if a.shape[-1] == 2 else plane + a[..., 2] * b[..., 2]
