"""Paths in CSV: a pose a line, `x,y` or `x,y,yaw`, metres and radians, with or without these names as header; # comments."""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import FileError
from topobelief.geometry.planar import travel_headings
from topobelief.io.filed_path import FiledPath, finite_numbers, numbered_lines
from topobelief.io.files import StrPath, read_text

_HEADERS = (["x", "y"], ["x", "y", "yaw"])


def read_csv_path(path: StrPath) -> FiledPath:
    """Read a path in CSV; without a column yaw each pose heads as it is reached.

    Raises
    ------
    FileError
        Names the line that is not what it should be.
    """
    rows: list[list[float]] = []
    lines: list[int] = []
    names: list[str] = []
    for number, line in numbered_lines(read_text(path)):
        fields = [field.strip() for field in line.split(",")]
        if not names:
            header = [field.lower() for field in fields]
            if header in _HEADERS:
                names = header
                continue
            if len(fields) not in (2, 3) or fields[0][:1].isalpha():
                raise FileError(path, f"expected the columns x,y or x,y,yaw, got {line[:60]!r}", line=number)
            names = _HEADERS[len(fields) - 2]
        rows.append(finite_numbers(path, number, fields, " ".join(names)))
        lines.append(number)
    if not rows:
        raise FileError(path, "expected at least one pose x,y or x,y,yaw, got none")
    poses = np.array(rows)
    if poses.shape[1] == 2:
        poses = np.column_stack([poses, travel_headings(poses)])
    return FiledPath(poses, tuple(lines))


def csv_of_path(poses: FloatArray) -> str:
    """The text of a CSV file of poses of shape (N, 3), or (N, 7), which `read_csv_path` does not read."""
    rows: list[list[float]] = poses.tolist()
    names = ["x", "y", "yaw"] if poses.shape[1] == 3 else ["x", "y", "z", "qx", "qy", "qz", "qw"]
    return "".join(f"{','.join(map(str, row))}\n" for row in (names, *rows))
