"""The operations that SE(2) and SE(3) share, declared once.

Poses are rows of a plain array, so every operation works on whole trajectories: shapes broadcast over the
leading axes. A pose is `T_world_body`, the pose of the body in the world frame. Tangent vectors are ordered
(translation, rotation). `k` is the dimension of positions, `q` that of rotations, `k + q` that of the tangent.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from topobelief.arrays import FloatArray


class Group(ABC):
    """A group of rigid motions acting on poses stored as rows."""

    name: ClassVar[str]
    position_dim: ClassVar[int]  # k
    rotation_dim: ClassVar[int]  # q
    pose_size: ClassVar[int]  # numbers stored per pose

    @property
    def tangent_dim(self) -> int:
        """kappa = k + q."""
        return self.position_dim + self.rotation_dim

    @abstractmethod
    def identity(self) -> FloatArray:
        """The pose that changes nothing, shape (pose_size,)."""

    @abstractmethod
    def compose(self, T_a_b: FloatArray, T_b_c: FloatArray) -> FloatArray:
        """T_a_c, shape (..., pose_size)."""

    @abstractmethod
    def inverse(self, T_a_b: FloatArray) -> FloatArray:
        """T_b_a, shape (..., pose_size)."""

    @abstractmethod
    def exp(self, tangent: FloatArray) -> FloatArray:
        """The pose reached by moving along a constant body twist, shape (..., pose_size)."""

    @abstractmethod
    def log(self, pose: FloatArray) -> FloatArray:
        """The twist with `exp(log(pose)) == pose` and rotation angle of at most pi, shape (..., tangent_dim)."""

    @abstractmethod
    def adjoint(self, pose: FloatArray) -> FloatArray:
        """Ad with `pose exp(t) = exp(Ad t) pose`, shape (..., tangent_dim, tangent_dim)."""

    @abstractmethod
    def rotation_matrix(self, pose: FloatArray) -> FloatArray:
        """R_world_body, shape (..., k, k)."""

    @abstractmethod
    def rotation_vector(self, pose: FloatArray) -> FloatArray:
        """Logarithm of the rotation alone, radians, shape (..., q); the angle is at most pi."""

    @abstractmethod
    def lever(self, offset: FloatArray) -> FloatArray:
        """C(d) with `C(d) phi = -(phi x d)`: how a rotation phi at the origin changes the relative position of a point at `d`.

        Parameters
        ----------
        offset : shape (..., k)
            d, in the frame in which phi is expressed.

        Returns
        -------
        array, shape (..., k, q)
        """

    @abstractmethod
    def normalized(self, pose: FloatArray) -> FloatArray:
        """The same pose in its canonical representation (angle in [-pi, pi), unit quaternion)."""

    def position(self, pose: FloatArray) -> FloatArray:
        """Origin of the body in the world frame, shape (..., k), metres."""
        return pose[..., : self.position_dim]

    def between(self, T_w_a: FloatArray, T_w_b: FloatArray) -> FloatArray:
        """T_a_b, the pose of b as seen from a."""
        return self.compose(self.inverse(T_w_a), T_w_b)

    def residual(self, measured: FloatArray, predicted: FloatArray) -> FloatArray:
        """Error of a relative pose in the tangent at the measured pose, as g2o and GTSAM take it.

        Translation of `measured^-1 predicted`, then its rotation vector; shape (..., tangent_dim).
        """
        error = self.between(measured, predicted)
        return np.concatenate([self.position(error), self.rotation_vector(error)], axis=-1)
