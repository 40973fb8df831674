"""The robot's size, its motors, and the errors of its wheel encoders."""

from __future__ import annotations

import math
from dataclasses import dataclass

from topobelief.errors import InvalidInputError, require_positive


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotSettings:
    """A differential-drive robot of a Pioneer 3-DX's size.

    Parameters
    ----------
    radius
        Of the chassis, a disc around the middle of the axle, metres.
    wheel_radius, track_width
        As built, metres; wheel odometry uses calibrated values instead (see `calibration`).
    max_speed, max_turn_rate
        Commands are cut to these, m/s and rad/s.
    max_acceleration, max_turn_acceleration
        With which the motors ramp up and down to a command, m/s² and rad/s².
    control_period
        Time between commands, seconds; a whole number of physics steps of 5 ms.
    wheel_slip
        Standard deviation of what a wheel's odometry is off after one metre, metres per root metre: it grows with the root of
        the distance, each wheel for itself.
    encoder_noise
        Standard deviation of one reading of a wheel's angle, radians; readings do not add up.
    """

    radius: float = 0.25
    wheel_radius: float = 0.0975
    track_width: float = 0.33
    max_speed: float = 0.7
    max_turn_rate: float = 1.5
    max_acceleration: float = 1.0
    max_turn_acceleration: float = 4.0
    control_period: float = 0.1
    wheel_slip: float = 0.005
    encoder_noise: float = 0.002

    def __post_init__(self) -> None:
        for name in (
            "radius",
            "wheel_radius",
            "track_width",
            "max_speed",
            "max_turn_rate",
            "max_acceleration",
            "control_period",
        ):
            require_positive(f"a robot's {name}", getattr(self, name))
        for name in ("wheel_slip", "encoder_noise"):
            if not (math.isfinite(value := getattr(self, name)) and value >= 0):
                raise InvalidInputError(f"expected a robot's {name} of at least 0, got {value}")
