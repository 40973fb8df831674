"""The TUM format of trajectories and paths: `timestamp x y z qx qy qz qw` a line, separated by blanks; # begins a comment."""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import FileError
from topobelief.geometry.planar import upright_poses
from topobelief.io.filed_path import FiledPath, finite_numbers, numbered_lines, path_of_quaternions
from topobelief.io.files import StrPath, read_text

_COLUMNS = "timestamp x y z qx qy qz qw"


def read_tum_path(path: StrPath) -> FiledPath:
    """Read a path in TUM format; its times do not matter.

    Raises
    ------
    FileError
        Names the line that is not what it should be.
    """
    rows, lines = tum_rows(path)
    return path_of_quaternions(path, rows[:, 1:].tolist(), lines)


def tum_rows(path: StrPath) -> tuple[FloatArray, list[int]]:
    """The rows of a file in TUM format, shape (N, 8), N > 0, and their lines.

    Raises
    ------
    FileError
        Names the line that is not eight finite numbers.
    """
    rows: list[list[float]] = []
    lines: list[int] = []
    for number, line in numbered_lines(read_text(path)):
        rows.append(finite_numbers(path, number, line.split(), _COLUMNS))
        lines.append(number)
    if not rows:
        raise FileError(path, f"expected at least one pose {_COLUMNS}, got none")
    return np.array(rows), lines


def tum_of_path(poses: FloatArray) -> str:
    """The text of a TUM file of poses of shape (N, 3), at height 0, or (N, 7); they have no times, so these count poses."""
    rows: list[list[float]] = (poses if poses.shape[1] == 7 else upright_poses(poses)).tolist()
    return f"# {_COLUMNS}\n" + "".join(f"{time} {' '.join(map(str, row))}\n" for time, row in enumerate(rows))
