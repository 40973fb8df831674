"""SE(2): planar poses [x, y, theta], metres and radians; tangent order (v_x, v_y, omega)."""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.geometry.group import Group

_SMALL_ANGLE = 1e-4  # below it the series of sin(t)/t and (1 - cos t)/t are exact in double precision


def wrap_angle(angle: FloatArray) -> FloatArray:
    """The same angle in [-pi, pi); angles that lie there already keep every digit."""
    inside = (angle >= -np.pi) & (angle < np.pi)
    wrapped = (angle + np.pi) % (2 * np.pi) - np.pi
    return np.where(inside, angle, np.where(wrapped < np.pi, wrapped, -np.pi))


class SE2(Group):
    """Rigid motions of the plane."""

    name = "SE(2)"
    position_dim = 2
    rotation_dim = 1
    pose_size = 3

    def identity(self) -> FloatArray:
        return np.zeros(3)

    def compose(self, T_a_b: FloatArray, T_b_c: FloatArray) -> FloatArray:
        x, y, theta = _columns(T_a_b)
        u, v, phi = _columns(T_b_c)
        c, s = np.cos(theta), np.sin(theta)
        return np.stack(np.broadcast_arrays(x + c * u - s * v, y + s * u + c * v, wrap_angle(theta + phi)), axis=-1)

    def inverse(self, T_a_b: FloatArray) -> FloatArray:
        x, y, theta = _columns(T_a_b)
        c, s = np.cos(theta), np.sin(theta)
        return np.stack([-c * x - s * y, s * x - c * y, wrap_angle(-theta)], axis=-1)

    def exp(self, tangent: FloatArray) -> FloatArray:
        u, v, omega = _columns(tangent)
        a, b = _sinc_terms(omega)
        return np.stack([a * u - b * v, b * u + a * v, wrap_angle(omega)], axis=-1)

    def log(self, pose: FloatArray) -> FloatArray:
        x, y, theta = _columns(self.normalized(pose))
        half = theta / 2
        small = np.abs(theta) < _SMALL_ANGLE
        safe = np.where(small, 1.0, half)
        cot = np.where(small, 1 - half**2 / 3, safe / np.tan(safe))  # (theta/2) cot(theta/2)
        return np.stack([cot * x + half * y, -half * x + cot * y, theta], axis=-1)

    def adjoint(self, pose: FloatArray) -> FloatArray:
        x, y, _ = _columns(pose)
        result = np.zeros((*pose.shape[:-1], 3, 3))
        result[..., :2, :2] = self.rotation_matrix(pose)
        result[..., 0, 2], result[..., 1, 2], result[..., 2, 2] = y, -x, 1.0
        return result

    def rotation_matrix(self, pose: FloatArray) -> FloatArray:
        c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
        return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)

    def rotation_vector(self, pose: FloatArray) -> FloatArray:
        return wrap_angle(pose[..., 2:])

    def lever(self, offset: FloatArray) -> FloatArray:
        return np.stack([offset[..., 1], -offset[..., 0]], axis=-1)[..., None]

    def normalized(self, pose: FloatArray) -> FloatArray:
        result = np.array(pose, dtype=np.float64)
        result[..., 2] = wrap_angle(result[..., 2])
        return result


def _columns(pose: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    return pose[..., 0], pose[..., 1], pose[..., 2]


def _sinc_terms(omega: FloatArray) -> tuple[FloatArray, FloatArray]:
    """sin(w)/w and (1 - cos w)/w, well behaved at zero."""
    small = np.abs(omega) < _SMALL_ANGLE
    safe = np.where(small, 1.0, omega)
    a = np.where(small, 1 - omega**2 / 6, np.sin(safe) / safe)
    b = np.where(small, omega / 2, 2 * np.sin(safe / 2) ** 2 / safe)
    return a, b
