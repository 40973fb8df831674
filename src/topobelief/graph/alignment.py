"""What the error of a map is measured by: positions of a sample of poses, the best rigid alignment taken out.

Moving all poses together changes no map. A small motion moves the position p of a pose by t + omega x (p - c); these motions
span the columns of an orthonormal U, and Pi = I - U U^T takes them out, as the alignment before a trajectory error does
(docs, the mathematics, section 12).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.errors import InvalidInputError
from topobelief.linalg.inverse import Projection

DEFAULT_SAMPLE_SIZE = 500
"""Poses of the map at most over which its error is taken."""

_FLAT = 1e-9  # of the largest extent: what is less moves by no turn


def sample_of(num_poses: int, size: int) -> IntArray:
    """All poses or, where there are more than `size`, so many evenly spaced ones, the first and the last among them."""
    return np.unique(np.rint(np.linspace(0, num_poses - 1, min(num_poses, size))).astype(np.int64))


def checked_sample_size(size: int) -> int:
    """The size of a sample.

    Raises
    ------
    InvalidInputError
        Where it is below 2.
    """
    if size < 2:
        raise InvalidInputError(f"expected a sample of at least 2 poses, got {size}")
    return size


def centring(nodes: IntArray) -> Projection:
    """Takes the mean out of a number on each node."""
    return Projection(nodes, np.full((len(nodes), 1, 1), 1 / math.sqrt(len(nodes))))


@dataclass(frozen=True, eq=False, slots=True)
class Alignment:
    """Pi for some positions.

    Attributes
    ----------
    nodes : shape (s,)
        The poses.
    turns : shape (s, k, t)
        Orthonormal directions of the turns about the centre; t = 1 in the plane, 3 in space, fewer where positions coincide
        or lie on a line. They are orthogonal to translations.
    """

    nodes: IntArray
    turns: FloatArray

    @staticmethod
    def of(positions: FloatArray, size: int) -> Alignment:
        """For the positions of a map, shape (n, k), of which at most `size` are taken."""
        nodes = sample_of(len(positions), size)
        centred = positions[nodes] - positions[nodes].mean(axis=0)
        scale = np.abs(centred).max(initial=0.0)
        if scale <= _FLAT * np.abs(positions[nodes]).max(initial=0.0):
            return Alignment(nodes, np.zeros((*centred.shape, 0)))
        directions = _turned(centred / scale)
        left, sizes, _ = np.linalg.svd(directions.reshape(-1, directions.shape[2]), full_matrices=False)
        left = left[:, sizes > _FLAT * sizes[0]]
        return Alignment(nodes, left.reshape(*centred.shape, -1))

    @property
    def count(self) -> int:
        """s, poses of the sample."""
        return len(self.nodes)

    @property
    def projection(self) -> Projection:
        """Pi, on the positions."""
        count, k, _ = self.turns.shape
        moves = np.broadcast_to(np.eye(k), (count, k, k)) / math.sqrt(count)
        return Projection(self.nodes, np.concatenate([moves, self.turns], axis=2))


def _turned(positions: FloatArray) -> FloatArray:
    """How turns about each axis move positions, shape (s, k, number of axes)."""
    if positions.shape[1] == 2:
        x, y = positions.T
        return np.stack([-y, x], axis=1)[:, :, None]
    return np.cross(np.eye(3)[:, None, :], positions[None, :, :]).transpose(1, 2, 0)
