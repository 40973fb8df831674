"""How a robot is turned where it drives or flies along straight legs.

In the plane it heads along a leg. In space it does so either *upright*, level whatever the slope of the leg, as a multicopter
flies; or *along* the leg, its x axis in the direction of travel and its z axis as near as can be to that of the graph's pose
next to the leg's middle: so a car is tilted by its ramp, and a robot on the hull of a ship stands out from it.
"""

from __future__ import annotations

from functools import cached_property
from typing import Literal

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from topobelief.arrays import FloatArray
from topobelief.candidates.polyline import checked_path, path_poses
from topobelief.errors import require_choice
from topobelief.geometry.planar import quaternions_of_headings
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.projection import tilts

Attitude = Literal["upright", "along"]

_MOST_UPRIGHT = np.pi / 6  # tilt of a robot that is still upright
_LEAST_ACROSS = 0.1  # sine of the angle between a leg and an axis that tells how to stand on it


def is_upright(graph: PoseGraph) -> bool:
    """Whether all poses of a graph are within 30 degrees of upright, as those in the plane are."""
    if graph.group.position_dim == 2:
        return True
    return bool(tilts(graph.group.rotation_matrix(graph.poses)).max() <= _MOST_UPRIGHT)


class Legs:
    """Orientations on straight legs, each of which depends on the leg and the graph alone.

    Parameters
    ----------
    graph
    attitude
        Of a graph in SE(3). Default: upright where all its poses are within 30 degrees of it, else along.
    dim
        2: legs in a plane, which are driven upright unless told otherwise.
    """

    def __init__(self, graph: PoseGraph, attitude: Attitude | None = None, *, dim: int = 3) -> None:
        if attitude is not None:
            require_choice("attitude", attitude, ("upright", "along"))
        self._graph = graph
        if attitude is None:
            attitude = "upright" if dim == 2 or is_upright(graph) else "along"
        self.attitude: Attitude = "upright" if graph.group.position_dim == 2 else attitude

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self._graph.positions)

    def headings(self, legs: FloatArray) -> FloatArray:
        """Direction of legs, shape (N, dim), seen from above, radians; 0 of those that lead straight up or down."""
        return np.arctan2(legs[:, 1], legs[:, 0])

    def rotations(self, begins: FloatArray, ends: FloatArray) -> Rotation:
        """Orientations in space on legs between places of shape (N, 3)."""
        if self.attitude == "upright":
            return Rotation.from_quat(quaternions_of_headings(self.headings(ends - begins)))
        x = (ends - begins) / np.linalg.norm(ends - begins, axis=1, keepdims=True)
        nearest = self._tree.query((begins + ends) / 2)[1]
        axes = self._graph.group.rotation_matrix(self._graph.poses[nearest])[:, :, [2, 0, 1]]  # z first
        across = axes - x[:, :, None] * np.einsum("ni,nij->nj", x, axes)[:, None]
        sine = np.linalg.norm(across, axis=1)
        chosen = np.argmax(sine > _LEAST_ACROSS, axis=1)  # the first that is not along the leg
        rows = np.arange(len(x))
        z = across[rows, :, chosen] / sine[rows, chosen][:, None]
        return Rotation.from_matrix(np.stack([x, np.cross(z, x), z], axis=2))

    def poses(self, places: FloatArray, begins: FloatArray, ends: FloatArray) -> FloatArray:
        """Poses at places on legs, each leg from its beginning to its end; shapes (N, k) to (N, pose_size)."""
        if self._graph.group.position_dim == 2:
            return np.column_stack([places, self.headings(ends - begins)])
        rotations = self.rotations(begins, ends).as_quat(canonical=True)
        return np.column_stack([places, rotations])


def waypoint_poses(graph: PoseGraph, path: FloatArray, attitude: Attitude | None = None) -> FloatArray:
    """A path as poses of a graph: its waypoints, each turned as the robot came, the first as it leaves.

    Parameters
    ----------
    graph
    path : shape (waypoints, k)
        Metres; repeated waypoints count once.
    attitude
        As for `Legs`.

    Returns
    -------
    shape (waypoints, pose_size)
    """
    waypoints = checked_path(path)
    if graph.group.position_dim == 2:
        return path_poses(waypoints)
    if len(waypoints) == 1:
        return np.column_stack([waypoints, graph.group.identity()[None, 3:]])
    first, second = np.r_[0, np.arange(len(waypoints) - 1)], np.r_[1, np.arange(1, len(waypoints))]
    return Legs(graph, attitude).poses(waypoints, waypoints[first], waypoints[second])


def lifted(places: FloatArray, graph: PoseGraph, pose: int) -> FloatArray:
    """Places in the dimension of a graph: those of a plane at the height of a pose; shape (N, 2) or (N, k) to (N, k)."""
    missing = graph.group.position_dim - places.shape[1]
    return np.column_stack([places, np.full(len(places), graph.positions[pose, 2])]) if missing == 1 else places
