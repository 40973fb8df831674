"""Paths in whatever format the suffix of their file names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray, frozen_floats
from topobelief.errors import FileError, InvalidInputError
from topobelief.io.filed_path import FiledPath
from topobelief.io.files import StrPath, write_text
from topobelief.io.nav_path import json_of_path, read_nav_path, yaml_of_path
from topobelief.io.paths_csv import csv_of_path, read_csv_path
from topobelief.io.tum import read_tum_path, tum_of_path

_FORMATS: dict[str, tuple[Callable[[StrPath], FiledPath], Callable[[FloatArray], str]]] = {  # what reads, what writes
    ".csv": (read_csv_path, csv_of_path),
    ".tum": (read_tum_path, tum_of_path),
    ".txt": (read_tum_path, tum_of_path),
    ".yaml": (read_nav_path, yaml_of_path),
    ".yml": (read_nav_path, yaml_of_path),
    ".json": (read_nav_path, json_of_path),
}


def read_path(path: StrPath, *, in_space: bool = False) -> FloatArray:
    """Read a path by the suffix of its file.

    Parameters
    ----------
    path
        .csv (x,y or x,y,yaw; in space x,y,z or x,y,z,qx,qy,qz,qw), .tum or .txt (TUM: timestamp x y z qx qy qz qw), .yaml,
        .yml or .json (nav_msgs/Path, as `ros2 topic echo` prints it).
    in_space
        Whether to read heights and orientations.

    Returns
    -------
    shape (N, 3), or in space (N, 7)
        x and y in metres, yaw in radians; in space x, y, z in metres and a unit quaternion (x, y, z, w). Where a CSV has
        neither yaw nor quaternions, a pose is upright and heads as it is reached. Times are left out.

    Raises
    ------
    FileError
        For another suffix, where the file is not what it should be, and in space where it has no heights; names the line.
    """
    filed = read_filed_path(path)
    return filed.in_space(path) if in_space else filed.in_plane


def read_filed_path(path: StrPath) -> FiledPath:
    """As the file has them, with the line of each pose."""
    read, _ = _FORMATS[require_path_suffix(path)]
    return read(path)


def write_path(path: StrPath, poses: ArrayLike) -> None:
    """Write a path in the format that the suffix of its file names; see `read_path`.

    Parameters
    ----------
    path
    poses : shape (N, 3) or (N, 7)
        As `read_path` gives them; `path_poses` adds the yaw to x and y. In TUM the times count poses; a nav_msgs/Path has
        stamps of 0 and the frame "map".

    Raises
    ------
    InvalidInputError
        Where the poses are not finite or not of that shape.
    FileError
        For another suffix, or where the file cannot be written.
    """
    write_text(path, path_text(path, poses))


def path_text(path: StrPath, poses: ArrayLike) -> str:
    """What `write_path` writes."""
    _, write = _FORMATS[require_path_suffix(path)]
    array = frozen_floats(poses, name="poses")
    if array.ndim != 2 or array.shape[1] not in (3, 7) or len(array) == 0 or not np.isfinite(array).all():
        raise InvalidInputError(
            f"expected finite poses x, y, yaw of shape (N, 3), or poses in space of shape (N, 7), got {array.shape}; "
            "`path_poses` adds yaw"
        )
    return write(array)


def require_path_suffix(path: StrPath) -> str:
    """The suffix of a file, or `FileError` where no format has it."""
    suffix = Path(path).suffix.lower()
    if suffix not in _FORMATS:
        raise FileError(
            path,
            "expected a path that ends in .csv, .tum, .txt (TUM), .yaml, .yml or .json (nav_msgs/Path), "
            f"got {suffix or 'no suffix'}",
        )
    return suffix
