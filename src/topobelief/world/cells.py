"""The free region of an occupancy grid, exactly: the union of its free cells, each the square that it is.

The sides between free and other cells are merged into straight runs, which meet only at their ends, and close to
polygons; all in whole numbers, free of rounding. Only then is the region scaled and placed in the world.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from topobelief.arrays import BoolArray, FloatArray, IntArray, frozen_floats
from topobelief.errors import InvalidMapError
from topobelief.world import shapes

_MOST_RUNS = 500_000  # in one direction; with so many in both, polygons take some 10 s and 1 GB


class GridRegion(NamedTuple):
    """The free part of a grid, and the whole of it, in the world frame."""

    free: shapes.Shape
    grid: shapes.Shape


def region_of_cells(free: ArrayLike, resolution: float, origin: Sequence[float]) -> GridRegion:
    """The free cells of a grid as polygons in the world frame.

    Parameters
    ----------
    free : shape (rows, columns), bool
        Row 0 is the lowest in y.
    resolution
        Side of a cell, metres.
    origin : (x, y, yaw)
        Pose of the lower left corner of cell (0, 0), T_world_grid.

    Raises
    ------
    InvalidMapError
        Where the shape, resolution or origin is wrong, or the outline has more than a million pieces.
    """
    cells = np.asarray(free)
    if cells.ndim != 2 or cells.size == 0 or cells.dtype != np.bool_:
        raise InvalidMapError(f"expected boolean cells of shape (rows, columns), got {cells.dtype} of {cells.shape}")
    if not (np.isfinite(resolution) and resolution > 0):
        raise InvalidMapError(f"expected a resolution above 0 m, got {resolution}")
    pose = frozen_floats(origin, name="origin")
    if pose.shape != (3,) or not np.isfinite(pose).all():
        raise InvalidMapError(f"expected a finite origin (x, y, yaw), got {pose.tolist()}")
    x, y, yaw = pose.tolist()
    R_world_grid = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])

    def placed(grid_corners: FloatArray) -> FloatArray:
        return resolution * grid_corners @ R_world_grid.T + np.array([x, y])

    rows, columns = cells.shape
    whole = shapes.rectangles(np.array([[0, 0, columns, rows]]))[0]
    faces = shapes.faces(*outline_runs(cells))
    column, row = np.floor(shapes.points_within(faces)).astype(np.int64).T
    free_faces = shapes.together(faces[cells[row, column]])
    return GridRegion(shapes.transformed(free_faces, placed), shapes.transformed(whole, placed))


def outline_runs(cells: BoolArray) -> tuple[FloatArray, FloatArray]:
    """The outline of the true cells as straight runs: their starts and ends (column, row), shapes (N, 2), in cells.

    A run ends where the outline turns, also where two true cells touch at a corner only: there the true side changes.

    Examples
    --------
    >>> starts, ends = outline_runs(np.array([[True, True, False]]))
    >>> np.hstack([starts, ends]).tolist()
    [[0.0, 0.0, 2.0, 0.0], [0.0, 1.0, 2.0, 1.0], [0.0, 0.0, 0.0, 1.0], [2.0, 0.0, 2.0, 1.0]]
    """
    padded = np.pad(cells, 1).astype(np.int8)
    row, first, last = _runs(np.diff(padded, axis=0)[:, 1:-1])
    column, low, high = _runs(np.diff(padded, axis=1)[1:-1].T)
    starts = np.concatenate([np.stack([first, row], axis=1), np.stack([column, low], axis=1)])
    ends = np.concatenate([np.stack([last, row], axis=1), np.stack([column, high], axis=1)])
    return starts.astype(np.float64), ends.astype(np.float64)


def _runs(signs: NDArray[np.int8]) -> tuple[IntArray, IntArray, IntArray]:
    """Runs of equal signs along the rows, zeros left out: row, first column and the one past the last."""
    steps = [np.diff(np.pad(signs == sign, ((0, 0), (1, 1))).astype(np.int8), axis=1) for sign in (1, -1)]
    count = sum(int(np.count_nonzero(step == 1)) for step in steps)
    if count > _MOST_RUNS:
        raise InvalidMapError(
            f"expected a map whose outline has at most {_MOST_RUNS} straight pieces in each direction, got {count}; "
            "this looks like noise: remove specks, or save the map with larger cells"
        )
    row, first = np.concatenate([np.argwhere(step == 1) for step in steps]).T
    last = np.concatenate([np.argwhere(step == -1) for step in steps])[:, 1]
    return row, first, last
