"""Poses as rows, as graphs and actions are given them: checked, brought to canonical form, and of points without rotation."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import BoolArray, FloatArray, frozen_floats, read_only
from topobelief.errors import InvalidGraphError
from topobelief.geometry import Group, group_of_size


def checked_pose_rows(
    values: ArrayLike, *, name: str, size: int | None = None, count: int | None = None
) -> tuple[FloatArray, Group]:
    """Poses as rows in canonical representation, read-only, and their group.

    Raises
    ------
    InvalidGraphError
        Where a row is not finite, the shape is wrong, or a quaternion is zero.
    """
    array = frozen_floats(values, name=name)
    if array.size == 0 and size is not None:
        array = array.reshape(0, size)
    expected = f"({'n' if count is None else count}, {'3 or 7' if size is None else size})"
    if array.ndim != 2 or (size is not None and array.shape[1] != size) or (count is not None and len(array) != count):
        raise InvalidGraphError(f"expected {name} of shape {expected}, got {array.shape}")
    if array.shape[1] not in (3, 7):
        raise InvalidGraphError(f"expected {name} of shape {expected}, got {array.shape}")
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if bad.size:
        raise InvalidGraphError(f"expected finite {name}, got nan or inf in row {bad[0]}")
    group = group_of_size(array.shape[1])
    if group.pose_size == 7:
        zero = np.flatnonzero(np.linalg.norm(array[:, 3:], axis=1) < 1e-6)
        if zero.size:
            raise InvalidGraphError(f"expected unit quaternions in {name}, got a zero one in row {zero[0]}")
    return read_only(group.normalized(array)), group


def without_rotations(group: Group, rows: FloatArray, points: BoolArray) -> FloatArray:
    """Rows of poses, of points with the rotation of the identity."""
    if not points.any():
        return rows
    cleared = rows.copy()
    cleared[points, group.position_dim :] = group.identity()[group.position_dim :]
    return read_only(cleared)
