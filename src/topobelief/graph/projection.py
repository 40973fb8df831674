"""Pose graphs in space projected onto the plane z = 0, for planar graphs that were saved in 3D."""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.errors import InvalidGraphError
from topobelief.geometry import SE3_GROUP
from topobelief.graph.pose_graph import PoseGraph
from topobelief.symbols import node_name

_MAX_TILT = np.pi / 6  # beyond it the heading in the plane says little
_LEVEL = 1e-3  # metres of height, radians of tilt
_PLANAR = np.array([0, 1, 5])  # x, y and yaw in the tangent of SE(3)


def projected_to_plane(graph: PoseGraph) -> tuple[PoseGraph, str]:
    """A graph in SE(2) from one in SE(3), and a sentence that says what was dropped.

    Poses and measurements keep x, y and the direction of their x axis in the plane. Heights and tilts are taken for known, as
    they are for a robot on a floor, so that information matrices keep their rows and columns of x, y and yaw (the information
    given height, roll and pitch).

    Parameters
    ----------
    graph
        In SE(3), with z up.

    Raises
    ------
    InvalidGraphError
        If the graph is in SE(2) already, or if a pose or a measurement is tilted by more than 30 degrees; names the first.

    Examples
    --------
    >>> graph = PoseGraph([[0, 0, 0, 0, 0, 0, 1], [1, 0, 2, 0, 0, 1, 1]], [(0, 1)], None, np.eye(6))
    >>> planar, dropped = projected_to_plane(graph)
    >>> planar.poses.round(3).tolist()
    [[0.0, 0.0, 0.0], [1.0, 0.0, 1.571]]
    >>> dropped
    'projected onto the plane: dropped heights from 0 to 2 m, tilts of up to 0 degrees, and the information about both'
    """
    if graph.group is not SE3_GROUP:
        raise InvalidGraphError(f"expected a graph in SE(3) to project onto the plane, got one in {graph.group.name}")
    if (graph.reading_codes > 1).any():
        raise InvalidGraphError(
            "expected landmarks whose positions are seen to project them onto the plane, got ranges or bearings"
        )
    poses, tilts = _planar(graph.poses)
    measurements, measured_tilts = _planar(graph.measurements)
    _require_upright(tilts, graph.ids[:, None], "poses", "pose")
    _require_upright(measured_tilts, graph.ids[graph.edges], "measurements", "the edge")
    heights, tilt = graph.poses[:, 2], np.rad2deg(max(tilts.max(), measured_tilts.max(initial=0.0)))
    planar = PoseGraph(
        poses,
        graph.edges,
        measurements,
        graph.information[:, _PLANAR[:, None], _PLANAR],
        graph.kinds if graph.num_landmarks else None,
        ids=graph.ids,
        fixed=graph.fixed,
    )
    return planar, (
        f"projected onto the plane: dropped heights from {heights.min():.3g} to {heights.max():.3g} m, "
        f"tilts of up to {tilt:.3g} degrees, and the information about both"
    )


def _planar(poses: FloatArray) -> tuple[FloatArray, FloatArray]:
    """x, y and heading, shape (count, 3), and the angle between the z axis and the vertical, shape (count,)."""
    rotation = SE3_GROUP.rotation_matrix(poses)
    heading = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    return np.column_stack([poses[:, :2], heading]), tilts(rotation)


def tilts(rotation: FloatArray) -> FloatArray:
    """Angle between the z axis of rotations and the vertical, radians; shape (N, 3, 3) to (N,)."""
    return np.arctan2(np.hypot(rotation[:, 0, 2], rotation[:, 1, 2]), rotation[:, 2, 2])


def is_planar(graph: PoseGraph) -> bool:
    """Whether a graph in SE(3) lies in a horizontal plane, poses and measurements, and was only saved in 3D.

    That is within a millimetre of height and a milliradian of tilt, the rounding of a file.
    """
    if graph.group is not SE3_GROUP:
        return False
    heights = graph.positions[:, 2]
    level = float(np.ptp(heights)) <= _LEVEL and float(np.abs(graph.measurements[:, 2]).max(initial=0.0)) <= _LEVEL
    turned = [tilts(SE3_GROUP.rotation_matrix(poses)).max(initial=0.0) for poses in (graph.poses, graph.measurements)]
    return level and max(turned) <= _LEVEL


def _require_upright(tilts: FloatArray, ids: IntArray, what: str, one: str) -> None:
    """Raise where something is tilted too far; `ids` has the poses of each in a row."""
    tilted = np.flatnonzero(tilts > _MAX_TILT)
    if tilted.size:
        names = " - ".join(node_name(int(node)) for node in ids[tilted[0]])
        raise InvalidGraphError(
            f"expected {what} within {np.rad2deg(_MAX_TILT):.0f} degrees of upright to project them onto the plane, "
            f"got {one} {names} at {np.rad2deg(tilts[tilted[0]]):.0f} degrees; turn the graph so that z is up, or optimise it"
        )
