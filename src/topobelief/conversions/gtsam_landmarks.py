"""Observations of landmarks to and from GTSAM's factors: bearing and range, range, bearing.

GTSAM has no factor in Python for the position of a point in the frame of a pose; its readers turn positions into bearings and
ranges, and so does `observation_factor`: with the information J^-T Omega J^-1, J the Jacobian of bearing and range at the
measurement, the two are the same to first order there.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import InvalidInputError
from topobelief.graph.readings import BEARING, BEARING_RANGE, POSITION, RANGE, ReadingKind
from topobelief.symbols import node_name


def observation_factor(
    gtsam: Any, pose: int, landmark: int, position: FloatArray, information: FloatArray, reading: str
) -> Any:
    """The factor of one observation.

    Parameters
    ----------
    gtsam
        The module.
    pose, landmark
        Keys.
    position : shape (k,)
        The measurement, as `PoseGraph.measurements` stores it.
    information : shape (d, d)
        In the numbers that are read.
    reading
        Its name.

    Raises
    ------
    InvalidInputError
        Where a position is that of the pose, which has no bearing.
    """
    k = len(position)
    if reading == POSITION.name:
        if not position.any():
            raise InvalidInputError(
                f"expected landmark {node_name(landmark)} away from pose {node_name(pose)}, because GTSAM takes its position "
                "for a bearing and a range, got both at one place"
            )
        back: FloatArray = np.asarray(np.linalg.inv(BEARING_RANGE.jacobian(position[None])[0]), dtype=np.float64)
        information = back.T @ information @ back
    noise = gtsam.noiseModel.Gaussian.Information((information + information.T) / 2)
    name = {RANGE.name: "RangeFactor", BEARING.name: "BearingFactor"}.get(reading, "BearingRangeFactor")
    factor = getattr(gtsam, f"{name}{k}D")
    distance = float(np.linalg.norm(position))
    if name == "RangeFactor":
        return factor(pose, landmark, distance, noise)
    bearing = gtsam.Rot2(float(np.arctan2(position[1], position[0]))) if k == 2 else gtsam.Unit3(position / distance)
    return (
        factor(pose, landmark, bearing, noise) if name == "BearingFactor" else factor(pose, landmark, bearing, distance, noise)
    )


def observation_of(gtsam: Any, factor: Any) -> tuple[ReadingKind, FloatArray] | None:
    """What a factor reads, and its measurement as a position; None for a factor of another kind."""
    measured: Any
    if isinstance(factor, gtsam.BearingRangeFactor2D | gtsam.BearingRangeFactor3D):
        measured = factor.measured()
        return BEARING_RANGE, float(measured.range()) * _direction(gtsam, measured.bearing())
    if isinstance(factor, gtsam.BearingFactor2D | gtsam.BearingFactor3D):
        return BEARING, _direction(gtsam, factor.measured())
    if isinstance(factor, gtsam.RangeFactor2D | gtsam.RangeFactor3D):
        k = 2 if isinstance(factor, gtsam.RangeFactor2D) else 3
        return RANGE, float(factor.measured()) * np.eye(k)[0]
    return None


def _direction(gtsam: Any, bearing: Any) -> FloatArray:
    if isinstance(bearing, gtsam.Rot2):
        return np.array([bearing.c(), bearing.s()])
    return np.asarray(bearing.point3(), dtype=np.float64)
