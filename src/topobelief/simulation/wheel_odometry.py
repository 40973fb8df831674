"""Wheel odometry: the pose that the turns of two wheels add up to.

Between two readings the robot is taken to move on an arc: wheels that roll by l and r metres turn it by (r - l) / b about a
point on the axle, b the track width, and drive it (l + r) / 2 along the arc (Siegwart and Nourbakhsh, "Introduction to
Autonomous Mobile Robots", section 5.2.4, with the arc instead of its chord).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import InvalidInputError
from topobelief.geometry import SE2_GROUP


@dataclass(frozen=True, slots=True, kw_only=True)
class Kinematics:
    """What a turn of the wheels moves the robot by.

    Parameters
    ----------
    wheel_radius, track_width
        Effective values, metres: those with which odometry comes out right.
    """

    wheel_radius: float
    track_width: float

    def motion(self, wheel_turns: FloatArray) -> FloatArray:
        """Pose after an arc, in the frame before it, from the turns of (left, right), radians; shape (3,)."""
        left, right = (self.wheel_radius * wheel_turns).tolist()
        return SE2_GROUP.exp(np.array([(left + right) / 2, 0.0, (right - left) / self.track_width]))

    def wheel_speeds(self, commands: FloatArray) -> FloatArray:
        """Angular speeds of (left, right), rad/s, for speeds (m/s) and turn rates (rad/s); shapes (..., 2)."""
        half = self.track_width / 2
        return commands @ np.array([[1.0, 1.0], [-half, half]]) / self.wheel_radius


class WheelEncoders:
    """Counts the turns of two wheels, with slip and noise.

    A wheel that slips turns without moving the robot, or is moved without turning. Here the count takes the error: after a
    metre it is off by `wheel_slip` metres (standard deviation), a random walk in the distance rolled, so that it does not
    depend on how often the encoders are read.

    Parameters
    ----------
    slip
        Metres per root metre.
    noise
        Standard deviation of a reading, radians.
    wheel_radius
        Metres, of a metre's turn.
    rng
    """

    def __init__(self, *, slip: float, noise: float, wheel_radius: float, rng: np.random.Generator) -> None:
        self._slip = slip / np.sqrt(wheel_radius)  # radians per root radian
        self._noise = noise
        self._rng = rng
        self._angles, self._slipped = np.zeros(2), np.zeros(2)

    def read(self, angles: FloatArray) -> FloatArray:
        """Counted angles of (left, right) for the true ones, radians since the start."""
        turned = np.abs(angles - self._angles)
        self._angles = angles.copy()
        self._slipped = self._slipped + self._slip * np.sqrt(turned) * self._rng.standard_normal(2)
        return angles + self._slipped + self._noise * self._rng.standard_normal(2)


class WheelOdometry:
    """Adds the readings of the encoders up to a pose, from the identity on.

    Parameters
    ----------
    kinematics
    """

    def __init__(self, kinematics: Kinematics) -> None:
        self._kinematics = kinematics
        self._angles = np.zeros(2)
        self._pose = SE2_GROUP.identity()

    @property
    def pose(self) -> FloatArray:
        """Pose since the start, shape (3,)."""
        return self._pose.copy()

    def update(self, angles: FloatArray) -> None:
        """Take in one reading of the wheels' angles (left, right), radians since the start.

        Raises
        ------
        InvalidInputError
            Where a reading is not two finite numbers.
        """
        if angles.shape != (2,) or not np.isfinite(angles).all():
            raise InvalidInputError(f"expected the angles of two wheels, got {angles.tolist()}")
        self._pose = SE2_GROUP.compose(self._pose, self._kinematics.motion(angles - self._angles))
        self._angles = angles.copy()
