"""Rigid motions: `SE2` and `SE3` behind one set of operations, and the group that a pose array belongs to."""

from __future__ import annotations

from topobelief.errors import InvalidInputError
from topobelief.geometry.group import Group
from topobelief.geometry.se2 import SE2, wrap_angle
from topobelief.geometry.se3 import SE3

SE2_GROUP = SE2()
SE3_GROUP = SE3()
_GROUPS: dict[int, Group] = {group.pose_size: group for group in (SE2_GROUP, SE3_GROUP)}


def group_of_size(pose_size: int) -> Group:
    """The group whose poses are stored in rows of `pose_size` numbers (3: SE(2), 7: SE(3)).

    Raises
    ------
    InvalidInputError
        For any other size.
    """
    try:
        return _GROUPS[pose_size]
    except KeyError:
        raise InvalidInputError(
            f"expected poses with 3 columns [x, y, theta] or 7 [x, y, z, qx, qy, qz, qw], got {pose_size}"
        ) from None


__all__ = ["SE2", "SE2_GROUP", "SE3", "SE3_GROUP", "Group", "group_of_size", "wrap_angle"]
