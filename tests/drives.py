"""Drives along polylines without physics: poses, slipping wheels, and a lidar, for tests of SLAM."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

import topobelief as tb
from topobelief.arrays import FloatArray
from topobelief.geometry import SE2_GROUP
from topobelief.simulation.front_end import FrontEnd
from topobelief.simulation.lidar import Lidar, LidarSettings
from topobelief.simulation.scan import Scan

_STEP, _TURN = 0.1, math.radians(5)
_SLIP, _TRACK = 0.005, 0.33  # m per root metre of each wheel, m

_WALLS = [(3.9, 0, 4.1, 2.4), (3.9, 3.6, 4.1, 6), (0, 5.9, 1.4, 6.1), (2.6, 5.9, 6.4, 6.1), (7.6, 5.9, 10, 6.1)]
_FURNITURE = [(1, 1, 1.6, 1.5), (8, 2, 8.5, 3), (4.5, 8, 5.5, 8.6), (0.5, 8.2, 0.9, 9)]

ROOMS = tb.World.from_boxes([*_WALLS, *_FURNITURE], bounds=(0, 0, 10, 10))
"""Two rooms and a hall, joined by three doors."""

LOOP = np.array(
    [(2.1, 2.2), (2, 3.1), (6.1, 2.95), (7.05, 3.4), (6.95, 7.1), (2, 7.2), (2.05, 2.7), (6, 2.9), (7, 3.6), (7, 7), (3, 7.1)]
)
"""Through all three doors, and again."""


@dataclass(frozen=True)
class KeyPose:
    """What a robot has at a key pose, and where it truly was."""

    truth: FloatArray
    wheel: FloatArray
    scan: Scan


def poses_along(path: ArrayLike) -> Iterator[FloatArray]:
    """Poses of a robot that turns on the spot at each corner and drives straight between them."""
    waypoints = np.asarray(path, dtype=float)
    heading = None
    for start, end in itertools.pairwise(waypoints):
        towards = math.atan2(*(end - start)[::-1])
        if heading is None:
            heading = towards
            yield np.array([*start, heading])
        turn = (towards - heading + math.pi) % (2 * math.pi) - math.pi
        for share in np.linspace(0, 1, math.ceil(abs(turn) / _TURN) + 1)[1:]:
            yield np.array([*start, heading + share * turn])
        heading = towards
        for share in np.linspace(0, 1, math.ceil(np.linalg.norm(end - start) / _STEP) + 1)[1:]:
            yield np.array([*(start + share * (end - start)), heading])


def driven(
    world: tb.World, path: ArrayLike, *, seed: int, lidar: LidarSettings | None = None, front_end: FrontEnd | None = None
) -> list[KeyPose]:
    """Key poses along a path, by the front end's own rule."""
    rng = np.random.default_rng(seed)
    eyes = Lidar(world, lidar or LidarSettings())
    gate = FrontEnd() if front_end is None else front_end
    nothing = Scan(np.zeros(0), np.zeros(0), 0.0, 10.0)
    key_poses: list[KeyPose] = []
    before, wheel = None, SE2_GROUP.identity()
    for time, pose in enumerate(poses_along(path)):
        if before is not None:
            motion = SE2_GROUP.log(SE2_GROUP.between(before, pose))
            rolled = abs(motion[0]) + abs(motion[2]) * _TRACK / 2
            left, right = _SLIP * math.sqrt(rolled) * rng.standard_normal(2)
            slipped = np.array([(left + right) / 2, 0, (right - left) / _TRACK])
            wheel = SE2_GROUP.compose(wheel, SE2_GROUP.exp(motion + slipped))
        before = pose
        if gate.wants_key_pose(wheel):
            gate.add(wheel, nothing)
            key_poses.append(KeyPose(pose, wheel, eyes.scan(pose, float(time), rng=rng)))
    return key_poses
