"""Calibration of wheel odometry: the wheel radius and track width with which it comes out right.

Wheels sink into the floor and creep a little, so the effective values are not those as built. After UMBmark (Borenstein and
Feng, "Measurement and correction of systematic odometry errors in mobile robots", IEEE Trans. Robotics and Automation 1996)
a straight drive gives the radius and a turn on the spot the track. For the default robot: 97.31 mm (97.5 as built), 330.0 mm.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.geometry import SE2_GROUP
from topobelief.simulation.drive import Drive
from topobelief.simulation.robot_settings import RobotSettings
from topobelief.simulation.wheel_odometry import Kinematics

_SETTLING_TIME = 1.0  # s at full speed before measuring
_MEASURED_TIME = 4.0  # s


@cache
def calibrated_kinematics(settings: RobotSettings) -> Kinematics:
    """The effective kinematics of a robot, from two drives at full speed on an endless floor, free of slip and noise.

    Parameters
    ----------
    settings
        Every robot of the same settings shares the result.
    """
    built = Kinematics(wheel_radius=settings.wheel_radius, track_width=settings.track_width)
    distance, _, turns = _measured(Drive(None, settings, built), settings, settings.max_speed, 0.0)
    wheel_radius = distance / float(np.mean(turns))
    _, rotation, turns = _measured(Drive(None, settings, built), settings, 0.0, settings.max_turn_rate)
    return Kinematics(wheel_radius=wheel_radius, track_width=wheel_radius * float(turns[1] - turns[0]) / rotation)


def _measured(drive: Drive, settings: RobotSettings, speed: float, turn_rate: float) -> tuple[float, float, FloatArray]:
    """Distance, rotation (radians, not wrapped) and turns of the wheels, shape (2,), at a constant command."""
    ramp = max(settings.max_speed / settings.max_acceleration, settings.max_turn_rate / settings.max_turn_acceleration)
    for _ in range(math.ceil((ramp + _SETTLING_TIME) / settings.control_period)):
        drive.advance(speed, turn_rate)
    begin, angles, rotation = drive.pose, drive.wheel_angles, 0.0
    for _ in range(math.ceil(_MEASURED_TIME / settings.control_period)):
        before = drive.pose
        drive.advance(speed, turn_rate)
        rotation += float(SE2_GROUP.between(before, drive.pose)[2])
    return math.dist(begin[:2].tolist(), drive.pose[:2].tolist()), rotation, drive.wheel_angles - angles
