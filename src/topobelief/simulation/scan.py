"""One revolution of a planar lidar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, ReadOnlyArrays, frozen_floats
from topobelief.errors import InvalidInputError


@dataclass(frozen=True, slots=True, eq=False)
class Scan(ReadOnlyArrays):
    """Ranges by direction, measured at one moment from the centre of the robot.

    Parameters
    ----------
    ranges : shape (B,)
        Metres; inf where nothing stands within `max_range`, nan where the beam gave no answer.
    angles : shape (B,)
        Direction of each beam in the base frame (x ahead, y left), radians.
    time
        Seconds since the robot started.
    max_range
        Metres.

    Raises
    ------
    InvalidInputError
        Where shapes differ, an angle is not finite, or a range is negative or beyond `max_range` without being inf.

    Examples
    --------
    >>> scan = Scan([2.0, np.inf, np.nan], [np.pi / 2, 0.0, -np.pi / 2], time=0.0, max_range=10.0)
    >>> scan.points.round(3)
    array([[0., 2.]])
    """

    ranges: FloatArray
    angles: FloatArray
    time: float
    max_range: float

    def __post_init__(self) -> None:
        ranges, angles = frozen_floats(self.ranges, name="ranges"), frozen_floats(self.angles, name="angles")
        if ranges.ndim != 1 or ranges.shape != angles.shape:
            raise InvalidInputError(f"expected a range for each angle, shapes (B,), got {ranges.shape} and {angles.shape}")
        if not np.isfinite(angles).all():
            raise InvalidInputError(f"expected finite angles, got {angles[~np.isfinite(angles)][0]}")
        bad = np.flatnonzero((ranges < 0) | ((ranges > self.max_range) & np.isfinite(ranges)))
        if bad.size:
            raise InvalidInputError(
                f"expected ranges from 0 to {self.max_range:g} m, inf or nan, got {ranges[bad[0]]:g} at beam {bad[0]}"
            )
        object.__setattr__(self, "ranges", ranges)
        object.__setattr__(self, "angles", angles)

    @property
    def hits(self) -> BoolArray:
        """Which beams met something, shape (B,)."""
        return np.isfinite(self.ranges)

    @property
    def points(self) -> FloatArray:
        """What the beams met, in the base frame, shape (k, 2), in the order of the beams."""
        hits = self.hits
        return self.ranges[hits, None] * np.stack([np.cos(self.angles[hits]), np.sin(self.angles[hits])], axis=1)
