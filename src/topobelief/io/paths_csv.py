"""Paths in CSV, a pose a line, metres and radians; # begins a comment.

    x,y        x,y,yaw        x,y,z        x,y,z,qx,qy,qz,qw

These names are the header, which may be left out; three columns without one are x, y and yaw.
"""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import FileError
from topobelief.geometry.planar import quaternions_of_headings, travel_headings
from topobelief.io.filed_path import FiledPath, finite_numbers, numbered_lines, path_of_quaternions
from topobelief.io.files import StrPath, read_text

_PLANAR, _SPATIAL = ["x", "y", "yaw"], ["x", "y", "z", "qx", "qy", "qz", "qw"]
_HEADERS = (_PLANAR[:2], _PLANAR, _SPATIAL[:3], _SPATIAL)
_EXPECTED = "x,y or x,y,yaw, in space x,y,z or x,y,z,qx,qy,qz,qw"


def read_csv_path(path: StrPath) -> FiledPath:
    """Read a path in CSV; without a column yaw or quaternions each pose is upright and heads as it is reached.

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
            names = next((each for each in _HEADERS if len(each) == len(fields)), list[str]())
            if not names or fields[0][:1].isalpha():
                raise FileError(path, f"expected the columns {_EXPECTED}, got {line[:60]!r}", line=number)
        rows.append(finite_numbers(path, number, fields, " ".join(names)))
        lines.append(number)
    if not rows:
        raise FileError(path, f"expected at least one pose {_EXPECTED}, got none")
    poses = np.array(rows)
    if names == _SPATIAL:
        return path_of_quaternions(path, rows, lines)
    if names != _PLANAR:
        headings = travel_headings(poses[:, :2])
        turned = quaternions_of_headings(headings) if "z" in names else headings
        poses = np.column_stack([poses, turned])
    return FiledPath(poses, tuple(lines))


def csv_of_path(poses: FloatArray) -> str:
    """The text of a CSV file of poses of shape (N, 3) or (N, 7)."""
    rows: list[list[float]] = poses.tolist()
    names = _PLANAR if poses.shape[1] == 3 else _SPATIAL
    return "".join(f"{','.join(map(str, row))}\n" for row in (names, *rows))
