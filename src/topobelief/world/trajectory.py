"""The region that a robot is known to have driven through: all that lies within a width of its trajectory.

Real pose graphs come without a map, but where the robot has been, it can drive again. The region is the union of one
capsule (a segment with round ends) for each step of the odometry.
"""

from __future__ import annotations

import numpy as np

from topobelief.arrays import IntArray
from topobelief.errors import InvalidInputError, require_positive
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world import shapes

_WIDTH_PER_STEP = 2.0


def region_of_trajectory(graph: PoseGraph, width: float | None = None) -> shapes.Shape:
    """Union of the capsules around the steps between consecutive poses, and of discs around all other poses.

    Parameters
    ----------
    graph
        In SE(2).
    width
        Metres to each side; `default_width` where None.

    Raises
    ------
    InvalidInputError
        For a graph in SE(3), and for a width that is not positive.
    """
    if graph.positions.shape[1] != 2:
        raise InvalidInputError(
            f"expected a graph in SE(2), got {graph.group.name}: a planar world would join storeys that lie above one "
            "another; use World3D.from_trajectory, or give a floor plan"
        )
    graph = graph.poses_alone
    if width is None:
        width = default_width(graph)
    require_positive("a width", width, unit="m")
    steps = odometry_steps(graph)
    alone = np.setdiff1d(np.arange(graph.num_poses), steps)
    starts, ends = graph.positions[steps[:, 0]], graph.positions[steps[:, 1]]
    corridors = shapes.capsules(starts, ends, width)
    spots = shapes.discs(graph.positions[alone], width)
    return shapes.union(np.concatenate([corridors, spots]))


def default_width(graph: PoseGraph) -> float:
    """Twice the step on which the robot covered its median metre: half the distance went in steps at least as long.

    Unlike the median step, it does not collapse where a robot turns on the spot for most of its steps.

    Raises
    ------
    InvalidInputError
        Where no step has a length, so that the graph suggests no width.
    """
    graph = graph.poses_alone
    first, second = odometry_steps(graph).T
    lengths = np.sort(np.linalg.norm(graph.positions[second] - graph.positions[first], axis=1))
    travelled = np.cumsum(lengths)
    if len(lengths) == 0 or travelled[-1] == 0:
        raise InvalidInputError(
            "expected edges between consecutive poses from which to take the width, got none with a length; "
            "give a width in metres"
        )
    return float(_WIDTH_PER_STEP * lengths[np.searchsorted(travelled, travelled[-1] / 2)])


def odometry_steps(graph: PoseGraph) -> IntArray:
    """Edges between consecutive poses of a graph without landmarks, each once, shape (steps, 2)."""
    low, high = np.sort(graph.edges, axis=1).T
    first = np.unique(low[high - low == 1])
    return np.stack([first, first + 1], axis=1)
