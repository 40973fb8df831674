"""The bare physics of a robot with two motors: MuJoCo's model, its state, and speeds that ramp as motor drivers ramp them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import InvalidInputError
from topobelief.simulation.mujoco_world import PHYSICS_STEP, build_model, load_mujoco
from topobelief.simulation.robot_settings import RobotSettings
from topobelief.simulation.wheel_odometry import Kinematics
from topobelief.world import World

_SETTLING_TIME = 0.5  # s, in which a robot put down comes to rest
_AWAY = 10.0  # m


class Drive:
    """A model and its state, advanced by commands; it comes to rest outside the world first.

    Parameters
    ----------
    world
        None: an endless floor.
    settings
    kinematics
        Turns commands into speeds of the wheels.

    Raises
    ------
    InvalidInputError
        Where the control period is not a whole number of physics steps, or MuJoCo is not installed.
    """

    def __init__(self, world: World | None, settings: RobotSettings, kinematics: Kinematics) -> None:
        self._substeps = round(settings.control_period / PHYSICS_STEP)
        if not math.isclose(self._substeps * PHYSICS_STEP, settings.control_period):
            raise InvalidInputError(
                f"expected a control_period in whole steps of {PHYSICS_STEP:g} s, got {settings.control_period:g} s"
            )
        self._mujoco: Any = load_mujoco()
        self._model: Any = build_model(world, settings)
        self._data: Any = self._mujoco.MjData(self._model)
        self._chassis = int(self._model.geom("chassis").id)
        changes = PHYSICS_STEP * np.array([settings.max_acceleration, settings.max_turn_acceleration])
        self._ramps = changes * np.arange(1, self._substeps + 1)[:, None]
        self._kinematics = kinematics
        self._command = np.zeros(2)
        if world is not None:  # come to rest away from all walls
            self._data.qpos[:2] = np.array(world.free.bounds[2:]) + _AWAY
        for _ in range(round(_SETTLING_TIME / PHYSICS_STEP)):
            self._mujoco.mj_step(self._model, self._data)
        self._height = float(self._data.qpos[2])

    @property
    def pose(self) -> FloatArray:
        """Where the robot is, (x, y, theta), shape (3,)."""
        x, y, _, w, i, j, k = self._data.qpos[:7].tolist()
        return np.array([x, y, math.atan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))])

    @property
    def wheel_angles(self) -> FloatArray:
        """True angles of (left, right), radians since the start, shape (2,)."""
        return self._data.qpos[7:9].copy()

    def place(self, pose: FloatArray) -> None:
        """Put the robot down at rest at (x, y, theta); the wheels keep their angles."""
        x, y, theta = pose.tolist()
        data = self._data
        data.qpos[:7] = x, y, self._height, math.cos(theta / 2), 0, 0, math.sin(theta / 2)
        data.qvel[:] = 0.0
        data.ctrl[:] = 0.0
        self._command = np.zeros(2)
        data.qacc_warmstart[:] = 0.0
        self._mujoco.mj_forward(self._model, data)

    def advance(self, speed: float, turn_rate: float) -> int:
        """One control period towards a speed (m/s) and a turn rate (rad/s); the physics steps in which the chassis touched."""
        data, model, step = self._data, self._model, self._mujoco.mj_step
        ramp = np.clip(np.array([speed, turn_rate]) - self._command, -self._ramps, self._ramps)
        commands = self._command + ramp
        touched = 0
        for wheel_speeds in self._kinematics.wheel_speeds(commands):
            data.ctrl[:] = wheel_speeds
            step(model, data)
            touched += bool((data.contact.geom == self._chassis).any())
        self._command = commands[-1]
        return touched
