"""A world with a differential-drive robot in it, as a MuJoCo model.

Walls are upright boxes that stand behind the boundary of the free region, so the free side of each is exact. The robot is a
Pioneer's: an upright cylinder around the axle, two driven wheels and a caster behind. Collision bits determine what collides
with what: wheels and caster with the floor alone, the cylinder with walls alone.

Measured before choosing: cylinder wheels wander by themselves (0.7 rad in 41 m), spheres with an elliptic friction cone and
`impratio` 10 least of all; the caster glides because its contact has priority over the floor's.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.optional import load
from topobelief.simulation.robot_settings import RobotSettings
from topobelief.simulation.walls import wall_segments
from topobelief.world import World

PHYSICS_STEP = 0.005  # s
_WALL_DEPTH, _WALL_HEIGHT = 0.02, 0.4  # m; deeper than any impact at a robot's speed gets
_CHASSIS_HEIGHT, _GROUND_CLEARANCE = 0.16, 0.06  # m
_BASE_MASS, _WHEEL_MASS = 8.0, 0.5  # kg
_CENTRE_OF_MASS = (-0.05, 0.0, 0.12)  # m; behind the axle, so that braking does not tip the robot over
_CASTER_OFFSET, _CASTER_RADIUS = -0.2, 0.04  # m
_SERVO_GAIN = 2.0  # N m s, of the wheels' speed controllers
_ROTOR_INERTIA = 0.02  # kg m^2, of a motor as its gear lets the wheel feel it
_TORQUE_LIMIT = 5.0  # N m
_FLOOR, _ROLLING, _WALL, _CHASSIS = 1, 2, 4, 8  # what a geom is


def load_mujoco() -> Any:
    """The physics engine.

    Raises
    ------
    InvalidInputError
        Where it is not installed.
    """
    return load("mujoco", "sim")


def build_model(world: World | None, settings: RobotSettings) -> Any:
    """The compiled model: floor, walls and one robot at the origin.

    Parameters
    ----------
    world
        None: an endless floor.
    settings
        Size of the robot.

    Returns
    -------
    mujoco.MjModel
        Joints "base" (free), "left" and "right"; actuators "left" and "right", driven by angular speed, rad/s; geom
        "chassis".
    """
    mujoco = load_mujoco()
    spec = mujoco.MjSpec()
    spec.option.timestep = PHYSICS_STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0
    floor = spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    _collides(floor, _FLOOR, _ROLLING)
    if world is not None:
        _add_walls(mujoco, spec, world)
    _add_robot(mujoco, spec, settings)
    return spec.compile()


def _add_walls(mujoco: Any, spec: Any, world: World) -> None:
    starts, ends = wall_segments(world)
    along = ends - starts
    lengths = np.linalg.norm(along, axis=1)
    outwards: FloatArray = np.stack([along[:, 1], -along[:, 0]], axis=1) / lengths[:, None]  # free space is on the left
    centres = (starts + ends) / 2 + _WALL_DEPTH / 2 * outwards
    headings = np.arctan2(along[:, 1], along[:, 0])
    for (x, y), length, heading in zip(centres.tolist(), lengths.tolist(), headings.tolist(), strict=True):
        wall = spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[x, y, _WALL_HEIGHT / 2],
            quat=[math.cos(heading / 2), 0, 0, math.sin(heading / 2)],
            size=[length / 2, _WALL_DEPTH / 2, _WALL_HEIGHT / 2],
        )
        _collides(wall, _WALL, _CHASSIS)


def _add_robot(mujoco: Any, spec: Any, settings: RobotSettings) -> None:
    base = spec.worldbody.add_body(name="base", pos=[0, 0, settings.wheel_radius])
    base.add_freejoint(name="base")
    chassis = base.add_geom(
        name="chassis",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        pos=[0, 0, _GROUND_CLEARANCE + _CHASSIS_HEIGHT / 2 - settings.wheel_radius],
        size=[settings.radius, _CHASSIS_HEIGHT / 2, 0],
        mass=0.0,
    )
    _collides(chassis, _CHASSIS, _WALL)
    x, y, z = _CENTRE_OF_MASS
    ballast = base.add_geom(
        name="ballast",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        pos=[x, y, z - settings.wheel_radius],
        size=[0.6 * settings.radius, _CHASSIS_HEIGHT / 2, 0],
        mass=_BASE_MASS,
    )
    _collides(ballast, 0, 0)
    caster = base.add_geom(
        name="caster",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        pos=[_CASTER_OFFSET, 0, _CASTER_RADIUS - settings.wheel_radius],
        size=[_CASTER_RADIUS, 0, 0],
        mass=0.0,
        condim=1,
        priority=1,
    )
    _collides(caster, _ROLLING, _FLOOR)
    for side, name in ((1, "left"), (-1, "right")):
        wheel = base.add_body(name=name, pos=[0, side * settings.track_width / 2, 0])
        wheel.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0], armature=_ROTOR_INERTIA)
        tyre = wheel.add_geom(
            name=name, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[settings.wheel_radius, 0, 0], mass=_WHEEL_MASS, condim=3
        )
        _collides(tyre, _ROLLING, _FLOOR)
        motor = spec.add_actuator(
            name=name,
            target=name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            forcelimited=True,
            forcerange=[-_TORQUE_LIMIT, _TORQUE_LIMIT],
        )
        motor.set_to_velocity(kv=_SERVO_GAIN)


def _collides(geom: Any, kind: int, partners: int) -> None:
    geom.contype, geom.conaffinity = kind, partners
