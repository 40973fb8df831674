"""What the other rooms ask of a world, in the plane or in space: places are rows of `dim` coordinates, metres, world frame."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import BoolArray, FloatArray, frozen_floats
from topobelief.errors import InvalidInputError
from topobelief.graph.pose_graph import PoseGraph


class FreeSpace(Protocol):
    """Where a robot may be, and what it can see there. `World` is one in the plane, `World3D` one in space."""

    @property
    def dim(self) -> int:
        """2 or 3: how many coordinates a place has."""
        ...

    @property
    def corners(self) -> FloatArray:
        """Opposite corners of all that it shows, shape (2, dim)."""
        ...

    def contains(self, points: ArrayLike) -> BoolArray:
        """Whether each point is free, shape (N,)."""
        ...

    def clearance(self, points: ArrayLike) -> FloatArray:
        """Distance to the nearest place that is not free, metres, shape (N,); negative where a point is not free."""
        ...

    def segments_free(self, starts: ArrayLike, ends: ArrayLike, radius: float) -> BoolArray:
        """Whether a ball (in the plane a disc) of a radius may move along each segment, shape (N,)."""
        ...

    def visible(self, starts: ArrayLike, ends: ArrayLike) -> BoolArray:
        """Whether nothing stands on the line of sight from each start to its end, shape (N,)."""
        ...


def checked_places(places: ArrayLike, name: str, dim: int) -> FloatArray:
    """Finite places of shape (N, dim), read-only.

    Raises
    ------
    InvalidInputError
        Names the first that is not finite.
    """
    array = frozen_floats(places, name=name)
    array = array.reshape(0, dim) if array.size == 0 else array
    if array.ndim != 2 or array.shape[1] != dim:
        raise InvalidInputError(f"expected {name} of shape (N, {dim}), got {array.shape}")
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if bad.size:
        raise InvalidInputError(f"expected finite {name}, got nan or inf in row {bad[0]}")
    return array


def checked_radius(radius: float) -> float:
    """A finite radius of at least 0, metres.

    Raises
    ------
    InvalidInputError
    """
    if not (np.isfinite(radius) and radius >= 0):
        raise InvalidInputError(f"expected a radius of at least 0 m, got {radius}")
    return float(radius)


def seen_by(world: FreeSpace, places: FloatArray) -> FloatArray:
    """Places as a world knows them: in a planar world a place in space is the one below or above it.

    Parameters
    ----------
    world
    places : shape (..., k)
    """
    return places[..., : world.dim]


def require_room_for(graph: PoseGraph, world: FreeSpace) -> None:
    """Raise where a graph in the plane meets a world in space.

    Raises
    ------
    InvalidInputError
    """
    if world.dim > graph.group.position_dim:
        raise InvalidInputError(
            f"expected a planar world for a graph in {graph.group.name}, got one in space; use a floor plan, or a graph "
            "in SE(3)"
        )
