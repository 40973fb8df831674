"""The TUM format of trajectories and paths: `timestamp x y z qx qy qz qw` a line, separated by blanks; # begins a comment."""

from __future__ import annotations

from topobelief.arrays import FloatArray
from topobelief.geometry.planar import upright_poses
from topobelief.io.filed_path import FiledPath, numbered_rows, path_of_quaternions
from topobelief.io.files import StrPath

_COLUMNS = "timestamp x y z qx qy qz qw"


def read_tum_path(path: StrPath) -> FiledPath:
    """Read a path in TUM format; its times do not matter.

    Raises
    ------
    FileError
        Names the line that is not what it should be.
    """
    rows, lines = numbered_rows(path, _COLUMNS)
    return path_of_quaternions(path, [row[1:] for row in rows], lines)


def tum_of_path(poses: FloatArray) -> str:
    """The text of a TUM file of poses of shape (N, 3), at height 0, or (N, 7); they have no times, so these count poses."""
    rows: list[list[float]] = (poses if poses.shape[1] == 7 else upright_poses(poses)).tolist()
    return f"# {_COLUMNS}\n" + "".join(f"{time} {' '.join(map(str, row))}\n" for time, row in enumerate(rows))
