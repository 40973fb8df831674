"""A path as a file gives it: poses, and the line on which each stands."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from topobelief.arrays import FloatArray, ReadOnlyArrays, frozen_floats
from topobelief.errors import FileError
from topobelief.geometry.planar import headings_of_quaternions
from topobelief.io.files import StrPath, read_text

_UNIT_TOLERANCE = 0.01  # on the length of a quaternion, which files may give in few digits


@dataclass(frozen=True, eq=False)
class FiledPath(ReadOnlyArrays):
    """Poses in the world frame, and the line of each, counted from 1.

    `poses` has shape (N, 7), x, y, z in metres and a unit quaternion (x, y, z, w); where the file has no heights (N, 3), x and
    y in metres and yaw in radians.
    """

    poses: FloatArray
    lines: tuple[int, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "poses", frozen_floats(self.poses, name="poses"))

    @property
    def in_plane(self) -> FloatArray:
        """x, y and yaw, shape (N, 3): without heights and tilts."""
        if self.poses.shape[1] == 3:
            return self.poses
        return np.column_stack([self.poses[:, :2], headings_of_quaternions(self.poses[:, 3:])])

    def in_space(self, path: StrPath) -> FloatArray:
        """x, y, z and quaternions, shape (N, 7), as the file at `path` has them.

        Raises
        ------
        FileError
            Where it has no heights.
        """
        if self.poses.shape[1] == 3:
            raise FileError(path, "expected a path with heights, got x and y alone; add the column z", line=self.lines[0])
        return self.poses


def path_of_quaternions(path: StrPath, rows: Sequence[Sequence[float]], lines: Sequence[int]) -> FiledPath:
    """A path from rows x, y, z, qx, qy, qz, qw.

    Raises
    ------
    FileError
        Names the line of a quaternion whose length is not 1.
    """
    numbers = np.array(rows, dtype=np.float64)
    unit, bad, problem = normalised(numbers[:, 3:])
    if bad is not None:
        raise FileError(path, problem, line=lines[bad])
    return FiledPath(np.column_stack([numbers[:, :3], unit]), tuple(lines))


def normalised(quaternions: FloatArray) -> tuple[FloatArray, int | None, str]:
    """Quaternions of shape (N, 4), normalised; the index of the first that is none, and what is wrong with it."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        lengths = np.linalg.norm(quaternions, axis=1)
        unit = quaternions / lengths[:, None]
    bad = np.flatnonzero(~(np.abs(lengths - 1) <= _UNIT_TOLERANCE))
    if not bad.size:
        return unit, None, ""
    first, length = int(bad[0]), float(lengths[bad[0]])
    advice = "; give 0 0 0 1 where the heading does not matter" if length == 0 else ""
    return unit, first, f"expected a quaternion of length 1, got one of {length:.4g}{advice}"


def numbered_lines(text: str) -> Iterator[tuple[int, str]]:
    """The lines that are neither empty nor comments, with their numbers."""
    for number, line in enumerate(text.splitlines(), start=1):
        stripped = line.strip()
        if stripped and not stripped.startswith("#"):
            yield number, stripped


def numbered_rows(path: StrPath, names: str) -> tuple[list[list[float]], list[int]]:
    """The numbers of each line of a file, separated by blanks, and the lines; at least one, whose names are separated so too.

    Raises
    ------
    FileError
        Names the line that is not as many finite numbers.
    """
    lines = list(numbered_lines(read_text(path)))
    if not lines:
        raise FileError(path, f"expected at least one pose {names}, got none")
    return [finite_numbers(path, number, line.split(), names) for number, line in lines], [number for number, _ in lines]


def finite_numbers(path: StrPath, line: int, fields: Sequence[str], names: str) -> list[float]:
    """As many finite numbers as there are names, which are separated by blanks.

    Raises
    ------
    FileError
        Names the line.
    """
    try:
        numbers = [float(field) for field in fields]
    except ValueError:
        numbers = []
    if len(numbers) != len(names.split()) or not all(map(math.isfinite, numbers)):
        raise FileError(path, f"expected finite numbers {names}, got {' '.join(fields)[:60]!r}", line=line)
    return numbers
