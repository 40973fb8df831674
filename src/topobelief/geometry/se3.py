"""SE(3): poses [x, y, z, qx, qy, qz, qw] with unit quaternions; tangent order (v, omega)."""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.geometry.group import Group

_UNIT_TOLERANCE = 4 * float(np.finfo(np.float64).eps)
_SMALL_ANGLE = 1e-3  # below it two terms of the series used here are exact to a few units of roundoff


class SE3(Group):
    """Rigid motions of space."""

    name = "SE(3)"
    position_dim = 3
    rotation_dim = 3
    pose_size = 7

    def identity(self) -> FloatArray:
        return np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])

    def compose(self, T_a_b: FloatArray, T_b_c: FloatArray) -> FloatArray:
        position = T_a_b[..., :3] + _rotate(T_a_b[..., 3:], T_b_c[..., :3])
        rotation = _canonical(_multiply(T_a_b[..., 3:], T_b_c[..., 3:]))
        return np.concatenate([position, rotation], axis=-1)

    def inverse(self, T_a_b: FloatArray) -> FloatArray:
        conjugate = _conjugate(T_a_b[..., 3:])
        return np.concatenate([-_rotate(conjugate, T_a_b[..., :3]), _canonical(conjugate)], axis=-1)

    def exp(self, tangent: FloatArray) -> FloatArray:
        v, omega = tangent[..., :3], tangent[..., 3:]
        angle = np.linalg.norm(omega, axis=-1, keepdims=True)
        small = angle < _SMALL_ANGLE
        safe = np.where(small, 1.0, angle)
        half_sinc = np.where(small, 0.5 - angle**2 / 48, np.sin(safe / 2) / safe)
        b = np.where(small, 0.5 - angle**2 / 24, 2 * np.sin(safe / 2) ** 2 / safe**2)
        c = np.where(small, 1 / 6 - angle**2 / 120, (safe - np.sin(safe)) / safe**3)
        w_v = np.cross(omega, v)
        position = v + b * w_v + c * np.cross(omega, w_v)
        quaternion = np.concatenate([half_sinc * omega, np.cos(angle / 2)], axis=-1)
        return np.concatenate([position, _canonical(quaternion)], axis=-1)

    def log(self, pose: FloatArray) -> FloatArray:
        omega = self.rotation_vector(pose)
        p = pose[..., :3]
        angle = np.linalg.norm(omega, axis=-1, keepdims=True)
        small = angle < _SMALL_ANGLE
        half = np.where(small, 1.0, angle) / 2
        d = np.where(small, 1 / 12 + angle**2 / 720, (1 - half / np.tan(half)) / (4 * half**2))
        w_p = np.cross(omega, p)
        return np.concatenate([p - 0.5 * w_p + d * np.cross(omega, w_p), omega], axis=-1)

    def adjoint(self, pose: FloatArray) -> FloatArray:
        rotation = self.rotation_matrix(pose)
        result = np.zeros((*pose.shape[:-1], 6, 6))
        result[..., :3, :3] = rotation
        result[..., 3:, 3:] = rotation
        result[..., :3, 3:] = _skew(pose[..., :3]) @ rotation
        return result

    def rotation_matrix(self, pose: FloatArray) -> FloatArray:
        quaternion = pose[..., 3:] / np.linalg.norm(pose[..., 3:], axis=-1, keepdims=True)
        v, w = quaternion[..., :3], quaternion[..., 3, None, None]
        cross = _skew(v)
        return np.eye(3) + 2 * w * cross + 2 * cross @ cross

    def rotation_vector(self, pose: FloatArray) -> FloatArray:
        quaternion = _canonical(pose[..., 3:])
        v, w = quaternion[..., :3], quaternion[..., 3:]
        sine = np.linalg.norm(v, axis=-1, keepdims=True)
        tiny = sine < 1e-8  # where angle / sine is 2 to the last digit
        return np.where(tiny, 2.0, 2 * np.arctan2(sine, w) / np.where(tiny, 1.0, sine)) * v

    def lever(self, offset: FloatArray) -> FloatArray:
        return _skew(offset)

    def normalized(self, pose: FloatArray) -> FloatArray:
        return np.concatenate([pose[..., :3], _canonical(pose[..., 3:])], axis=-1)


def _multiply(p: FloatArray, q: FloatArray) -> FloatArray:
    """Hamilton product of quaternions stored (x, y, z, w)."""
    pv, pw, qv, qw = p[..., :3], p[..., 3:], q[..., :3], q[..., 3:]
    return np.concatenate([pw * qv + qw * pv + np.cross(pv, qv), pw * qw - np.sum(pv * qv, axis=-1, keepdims=True)], axis=-1)


def _conjugate(q: FloatArray) -> FloatArray:
    return np.concatenate([-q[..., :3], q[..., 3:]], axis=-1)


def _rotate(q: FloatArray, vector: FloatArray) -> FloatArray:
    t = 2 * np.cross(q[..., :3], vector)
    return vector + q[..., 3:] * t + np.cross(q[..., :3], t)


def _canonical(q: FloatArray) -> FloatArray:
    """Unit norm, w >= 0: the quaternion of a rotation by at most pi; one of unit norm already keeps every digit."""
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    q = np.where(np.abs(norm - 1) <= _UNIT_TOLERANCE, q, q / norm)
    return np.where(q[..., 3:] < 0, -q, q)


def _skew(v: FloatArray) -> FloatArray:
    """[v]_x with [v]_x u = v x u."""
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    zero = np.zeros_like(x)
    return np.stack(
        [np.stack([zero, -z, y], axis=-1), np.stack([z, zero, -x], axis=-1), np.stack([-y, x, zero], axis=-1)], axis=-2
    )
