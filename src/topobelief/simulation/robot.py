"""The robot: MuJoCo moves it, its encoders count, its lidar looks around.

The commands (speed, turn rate) become wheel speeds, ramped as motor drivers do; friction of wheels and floor does the rest.
The base frame stands in the middle of the axle, x ahead.
"""

from __future__ import annotations

import math

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import InvalidInputError
from topobelief.simulation.calibration import calibrated_kinematics
from topobelief.simulation.drive import Drive
from topobelief.simulation.lidar import Lidar, LidarSettings
from topobelief.simulation.mujoco_world import PHYSICS_STEP
from topobelief.simulation.robot_settings import RobotSettings
from topobelief.simulation.scan import Scan
from topobelief.simulation.wheel_odometry import WheelEncoders, WheelOdometry
from topobelief.world import World

__all__ = ["LidarSettings", "Robot", "RobotSettings"]


class Robot:
    """A robot in a world, advanced one control period at a time.

    Parameters
    ----------
    world
        Whose walls it meets and sees.
    start : shape (3,)
        True pose (x, y, theta) at time 0.
    settings, lidar
        Of the robot and of its lidar.
    rng
        Of slip and noise; wheels and lidar draw from streams of their own, so scans do not change the driving.

    Attributes
    ----------
    settings, kinematics
        As given, and as calibrated.
    contacts : int
        Physics steps (of 5 ms) in which the chassis touched a wall.

    Raises
    ------
    InvalidInputError
        Where the chassis does not fit at the start, or MuJoCo is not installed.
    """

    def __init__(
        self,
        world: World,
        start: FloatArray,
        *,
        settings: RobotSettings | None = None,
        lidar: LidarSettings | None = None,
        rng: np.random.Generator,
    ) -> None:
        self.settings = settings or RobotSettings()
        self.kinematics = calibrated_kinematics(self.settings)
        self.contacts = 0
        self._world = world
        wheel_rng, self._lidar_rng = rng.spawn(2)
        self._lidar = Lidar(world, lidar or LidarSettings())
        self._drive = Drive(world, self.settings, self.kinematics)
        self._encoders = WheelEncoders(
            slip=self.settings.wheel_slip,
            noise=self.settings.encoder_noise,
            wheel_radius=self.settings.wheel_radius,
            rng=wheel_rng,
        )
        self._odometry = WheelOdometry(self.kinematics)
        self._periods = 0
        self._last_scan: Scan | None = None
        self.place(start)

    @property
    def time(self) -> float:
        """Seconds since the start."""
        return self._periods * self.settings.control_period

    @property
    def true_pose(self) -> FloatArray:
        """Where the robot is, shape (3,). For scoring alone."""
        return self._drive.pose

    @property
    def wheel_odometry(self) -> FloatArray:
        """Where the encoders believe it to be, relative to the start, shape (3,); the identity at the start."""
        return self._odometry.pose

    def step(self, speed: float, turn_rate: float) -> None:
        """Drive for one control period.

        Parameters
        ----------
        speed, turn_rate
            m/s ahead and rad/s counter-clockwise; cut to what the robot can do.

        Raises
        ------
        InvalidInputError
            Where a command is not finite.
        """
        if not (math.isfinite(speed) and math.isfinite(turn_rate)):
            raise InvalidInputError(f"expected a finite command, got {speed} m/s and {turn_rate} rad/s")
        settings = self.settings
        speed = min(max(speed, -settings.max_speed), settings.max_speed)
        turn_rate = min(max(turn_rate, -settings.max_turn_rate), settings.max_turn_rate)
        self.contacts += self._drive.advance(speed, turn_rate)
        self._odometry.update(self._encoders.read(self._drive.wheel_angles))
        self._periods += 1

    def scan(self) -> Scan:
        """The newest revolution of the lidar: a new one where a period of the lidar has passed, else the same again."""
        due = self._last_scan is None or self.time - self._last_scan.time > 1 / self._lidar.settings.rate - PHYSICS_STEP / 2
        if self._last_scan is None or due:
            self._last_scan = self._lidar.scan(self.true_pose, self.time, rng=self._lidar_rng)
        return self._last_scan

    def place(self, pose: FloatArray) -> None:
        """Lift the robot and put it down at rest elsewhere; the encoders do not change, and no time passes.

        Parameters
        ----------
        pose : shape (3,)
            x, y, theta.

        Raises
        ------
        InvalidInputError
            Where the chassis does not fit.
        """
        target = np.asarray(pose, dtype=np.float64)
        if target.shape != (3,) or not np.isfinite(target).all():
            raise InvalidInputError(f"expected a finite pose (x, y, theta), got {target.tolist()}")
        clearance = float(self._world.clearance(target[None, :2])[0])
        if clearance <= self.settings.radius:
            raise InvalidInputError(
                f"expected a place with room for the robot's radius of {self.settings.radius:g} m, "
                f"got ({target[0]:g}, {target[1]:g}) with {clearance:.2f} m; choose a place in the open"
            )
        self._drive.place(target)
        self._last_scan = None
