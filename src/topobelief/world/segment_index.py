"""Straight segments, indexed by where they are, in the plane or in space."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import shapely
from scipy.spatial import KDTree

from topobelief.arrays import FloatArray, IntArray
from topobelief.world import shapes


class SegmentIndex:
    """Straight segments, indexed by where they are.

    Parameters
    ----------
    starts, ends : shape (N, dim)
    """

    def __init__(self, starts: FloatArray, ends: FloatArray) -> None:
        self._boxes = cast("Any", shapely.STRtree)(shapes.segments(starts, ends)) if starts.shape[1] == 2 else None
        if self._boxes is None:
            self._middles = KDTree((starts + ends) / 2)
            self._reach = float(np.linalg.norm(ends - starts, axis=1).max(initial=0.0)) / 2

    def near(self, place: FloatArray, distance: float) -> IntArray:
        """All segments within a distance from a place, and some others."""
        if self._boxes is None:
            return np.array(self._middles.query_ball_point(place, distance + self._reach), dtype=np.int64)
        x, y = place.tolist()
        return self._boxes.query(shapely.box(x - distance, y - distance, x + distance, y + distance))
