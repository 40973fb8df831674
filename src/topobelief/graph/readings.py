"""Kinds of readings: what a measurement says of the thing at the other end of its edge.

Between poses it is the relative pose. Of a point (a landmark) it is a function h of the point's position x in the frame of the
pose that sees it: the position itself, bearing and range, range alone, or bearing alone. To first order a reading with the
information Omega is one of the position, with the information J^T Omega J at x, J the Jacobian of h: that is all that
entropies, signatures and bounds ask of it. Where h is not linear it depends on where the point is estimated to be; the estimate
itself minimises the residuals of the readings as they are.

A measurement is stored as a position: range times direction, the direction alone for a bearing, range along the x axis for a
range.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from topobelief.arrays import FloatArray


class ReadingKind(ABC):
    """A function of the position of a point in the frame of a pose."""

    name: ClassVar[str]
    linear: ClassVar[bool] = False

    @abstractmethod
    def dimension(self, position_dim: int) -> int:
        """d, numbers that are read."""

    @abstractmethod
    def residual(self, measured: FloatArray, position: FloatArray) -> FloatArray:
        """h(x) less what was read, shape (m, d); both arguments of shape (m, k)."""

    @abstractmethod
    def jacobian(self, position: FloatArray) -> FloatArray:
        """Of h, shape (m, d, k)."""


class Position(ReadingKind):
    """The position itself."""

    name = "position"
    linear = True

    def dimension(self, position_dim: int) -> int:
        return position_dim

    def residual(self, measured: FloatArray, position: FloatArray) -> FloatArray:
        return position - measured

    def jacobian(self, position: FloatArray) -> FloatArray:
        k = position.shape[1]
        return np.broadcast_to(np.eye(k), (len(position), k, k))


class Range(ReadingKind):
    """The distance."""

    name = "range"

    def dimension(self, position_dim: int) -> int:
        return 1

    def residual(self, measured: FloatArray, position: FloatArray) -> FloatArray:
        return (_norm(position) - _norm(measured))[:, None]

    def jacobian(self, position: FloatArray) -> FloatArray:
        return (position / _norm(position)[:, None])[:, None, :]


class Bearing(ReadingKind):
    """The direction: an angle in the plane; in space two angles about axes across the direction (as GTSAM's Unit3 has them)."""

    name = "bearing"

    def dimension(self, position_dim: int) -> int:
        return position_dim - 1

    def residual(self, measured: FloatArray, position: FloatArray) -> FloatArray:
        across = _across(position)
        u, v = position / _norm(position)[:, None], measured / _norm(measured)[:, None]
        sideways, ahead = -np.einsum("mdk,mk->md", across, v), np.sum(u * v, axis=1)
        sine = np.linalg.norm(sideways, axis=1)
        angle = np.arctan2(sine, ahead)
        return sideways * np.where(sine > 0, angle / np.where(sine > 0, sine, 1.0), 1.0)[:, None]

    def jacobian(self, position: FloatArray) -> FloatArray:
        return _across(position) / _norm(position)[:, None, None]


class BearingRange(ReadingKind):
    """Direction, then distance."""

    name = "bearing_range"

    def dimension(self, position_dim: int) -> int:
        return position_dim

    def residual(self, measured: FloatArray, position: FloatArray) -> FloatArray:
        return np.concatenate([BEARING.residual(measured, position), RANGE.residual(measured, position)], axis=1)

    def jacobian(self, position: FloatArray) -> FloatArray:
        return np.concatenate([BEARING.jacobian(position), RANGE.jacobian(position)], axis=1)


POSITION, RANGE, BEARING, BEARING_RANGE = Position(), Range(), Bearing(), BearingRange()
READING_KINDS: tuple[ReadingKind, ...] = (POSITION, BEARING_RANGE, RANGE, BEARING)
RELATIVE_POSE = "pose"
"""The reading of an edge between poses."""


def _norm(vectors: FloatArray) -> FloatArray:
    return np.linalg.norm(vectors, axis=1)


def _across(position: FloatArray) -> FloatArray:
    """Unit vectors across the direction to a position, shape (m, k - 1, k); to the left in the plane."""
    u = position / _norm(position)[:, None]
    if position.shape[1] == 2:
        return np.stack([-u[:, 1], u[:, 0]], axis=1)[:, None, :]
    axis = np.eye(3)[np.argmin(np.abs(u), axis=1)]  # the first of the smallest, which is never along u
    first = np.cross(u, axis)
    first /= _norm(first)[:, None]
    return np.stack([first, np.cross(u, first)], axis=1)
