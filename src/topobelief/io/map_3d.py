"""Maps in space: occupancy grids as NumPy arrays (.npy), and point clouds (.ply, .pcd)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from topobelief.arrays import BoolArray
from topobelief.errors import FileError, InvalidMapError
from topobelief.io.files import StrPath, read_head
from topobelief.io.point_cloud import read_point_cloud
from topobelief.io.ros_map import Unknown
from topobelief.world import World3D

CLOUD_RESOLUTION = 0.2
"""Side of the cubes of a point cloud, metres, unless told otherwise."""

_CLOUDS = (".ply", ".pcd")
_OCCUPIED = 0.5  # from this probability on a cell is occupied


def is_map_3d(path: StrPath) -> bool:
    """Whether the suffix of a file is that of a map in space."""
    return Path(path).suffix.lower() in (".npy", *_CLOUDS)


def read_world_3d(
    path: StrPath,
    *,
    resolution: float | None = None,
    origin: Sequence[float] | None = None,
    unknown: Unknown = "occupied",
) -> World3D:
    """A world in space by the suffix of its file.

    Parameters
    ----------
    path
        .npy: an occupancy grid of shape (nx, ny, nz), cell (0, 0, 0) the lowest in x, y and z. True or 1 are occupied cells;
        numbers up to 100 are percent as in ROS, -1 unknown; fractions are probabilities, nan unknown. .ply or .pcd: a point
        cloud; cubes with a point are occupied, all others around the cloud free.
    resolution
        Side of a cell or cube, metres. Needed for .npy; 0.2 m for a cloud.
    origin : (x, y, z), optional
        Of a grid: its lowest corner in the world, metres. Default: 0 0 0.
    unknown
        What unknown cells are taken for.

    Raises
    ------
    FileError
        For another suffix, where the file is not what it should be, and for a grid without a resolution.
    """
    suffix = Path(path).suffix.lower()
    try:
        if suffix in _CLOUDS:
            if origin is not None:
                raise FileError(path, "expected an origin for a grid in .npy alone, got one for a point cloud; leave it out")
            return World3D.from_points(read_point_cloud(path), CLOUD_RESOLUTION if resolution is None else resolution)
        if suffix == ".npy":
            if resolution is None:
                raise FileError(path, "expected a resolution for a grid in .npy, got none; give --resolution, metres a cell")
            free = _free_cells(path, unknown)
            return World3D.from_cells(free, resolution, (0.0, 0.0, 0.0) if origin is None else origin)
    except InvalidMapError as error:
        raise FileError(path, str(error)) from None
    raise FileError(path, f"expected a 3D map that ends in .npy, .ply or .pcd, got {suffix or 'no suffix'}")


def _free_cells(path: StrPath, unknown: Unknown) -> BoolArray:
    read_head(path, 1)  # says what is wrong with a path
    try:
        cells: NDArray[Any] = np.lib.format.open_memmap(path, mode="r")  # of the size that it states, or refused
    except Exception as error:  # of whatever kind: a header that is none gets as far as Python's parser
        reason = str(error).splitlines() or [type(error).__name__]
        raise FileError(path, f"expected a grid as numpy.save writes it, got: {reason[0][:120]}") from None
    if cells.ndim != 3 or cells.size == 0 or cells.dtype.kind not in "biuf":
        raise FileError(path, f"expected a grid of numbers of shape (nx, ny, nz), got {cells.dtype} of {cells.shape}")
    if cells.dtype.kind == "b":
        return ~np.asarray(cells)
    with np.errstate(invalid="ignore"):
        values = np.asarray(cells, dtype=np.float64)
        not_known = np.isnan(values) | (values < 0)
        values = values / 100 if values.max(initial=0.0, where=~not_known) > 1 else values
        free = values < _OCCUPIED
    return np.where(not_known, unknown == "free", free)
