"""Paths in the TUM format of trajectories: `timestamp x y z qx qy qz qw` a line, separated by blanks; # begins a comment."""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import FileError
from topobelief.geometry.planar import quaternions_of_headings
from topobelief.io.filed_path import FiledPath, finite_numbers, numbered_lines, path_of_quaternions
from topobelief.io.files import StrPath, read_text

_COLUMNS = "timestamp x y z qx qy qz qw"


def read_tum_path(path: StrPath) -> FiledPath:
    """Read a path in TUM format; times, heights and tilts do not matter in the plane.

    Raises
    ------
    FileError
        Names the line that is not what it should be.
    """
    rows: list[list[float]] = []
    lines: list[int] = []
    for number, line in numbered_lines(read_text(path)):
        _, x, y, _, *quaternion = finite_numbers(path, number, line.split(), _COLUMNS)
        rows.append([x, y, *quaternion])
        lines.append(number)
    if not rows:
        raise FileError(path, f"expected at least one pose {_COLUMNS}, got none")
    return path_of_quaternions(path, rows, lines)


def tum_of_path(poses: FloatArray) -> str:
    """The text of a TUM file of poses of shape (N, 3), at height 0; a path has no times, so they count poses."""
    count = np.arange(len(poses))
    numbers = np.column_stack([poses[:, :2], 0.0 * count, quaternions_of_headings(poses[:, 2])])
    rows: list[list[float]] = numbers.tolist()
    return f"# {_COLUMNS}\n" + "".join(f"{time} {' '.join(map(str, row))}\n" for time, row in enumerate(rows))
