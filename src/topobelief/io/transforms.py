"""Rigid motions that files give as matrices: poses of them, where the matrices are what they should be."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from topobelief.arrays import FloatArray

FARTHEST = 1e9  # metres from the origin, at which positions still resolve a micrometre
_SKEW = 0.01  # of a rotation matrix, which files give in few digits


def poses_of_matrices(matrices: FloatArray) -> tuple[FloatArray, int | None]:
    """Poses of shape (n, 7) from the upper three rows of matrices, shape (n, 3, 4), or the index of the first that is none.

    A pose has a right-handed rotation and a position within 1e9 m.

    Examples
    --------
    >>> poses_of_matrices(np.eye(4)[None, :3])[0].tolist()
    [[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]
    >>> poses_of_matrices(np.stack([np.eye(4)[:3], np.ones((3, 4))]))[1]
    1
    """
    rotations = matrices[:, :, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        proper = np.abs(rotations @ rotations.mT - np.eye(3)).max(axis=(1, 2), initial=0.0) <= _SKEW
    proper &= np.abs(matrices[:, :, 3]).max(axis=1, initial=0.0) <= FARTHEST
    proper[proper] = np.linalg.det(rotations[proper]) > 0
    if not proper.all():
        return np.zeros((0, 7)), int(np.argmin(proper))
    quaternions = Rotation.from_matrix(rotations).as_quat() if len(rotations) else np.zeros((0, 4))
    return np.column_stack([matrices[:, :, 3], quaternions]), None
