"""Where a robot starts: at a pose of the graph, or at a place from which it sees one."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray, frozen_floats
from topobelief.candidates.ends import shown_place
from topobelief.errors import InvalidInputError, PlanningError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.symbols import node_name
from topobelief.world import FreeSpace
from topobelief.world.space import seen_by

_SAME_PLACE = 1e-9  # metres


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """Where paths begin, and which pose of the graph their first new pose is joined to."""

    pose: int  # index
    place: FloatArray  # shape (k,) of the graph, metres, world frame

    def distance(self, graph: PoseGraph) -> float:
        """Metres from the pose to the place; 0 where the robot stands at the pose."""
        distance = float(np.linalg.norm(graph.positions[self.pose] - self.place))
        return distance if distance > _SAME_PLACE else 0.0


def find_start(graph: PoseGraph, start: int | ArrayLike | Start | None = None, *, world: FreeSpace | None = None) -> Start:
    """The start that a caller means.

    Parameters
    ----------
    graph
    start
        Index of a pose (counted from the end where it is negative), or a place in metres: of shape (2,) or (3,) in SE(2), where
        a heading is ignored, and x, y, z in SE(3). Default: the last pose. What this function returned is taken as it is.
    world
        Where given, a place must be in sight of a pose.

    Returns
    -------
    Start
        From a place: with the nearest pose in sight, the last of equally near ones.

    Raises
    ------
    InvalidInputError
        For an index out of range, what is neither index nor place, and a place in a graph in SE(3) without its height, where
        poses of several storeys may lie above one another.
    PlanningError
        Where no pose is in sight of the place.
    """
    if isinstance(start, Start):
        return start
    if start is None or isinstance(start, Integral):
        index = graph.last_pose if start is None else int(start)
        if not -graph.num_nodes <= index < graph.num_nodes:
            raise InvalidInputError(f"expected start as the index of a pose, at most {graph.num_poses - 1}, got {index}")
        if graph.is_landmark[index]:
            raise InvalidInputError(f"expected start as the index of a pose, got landmark {node_name(int(graph.ids[index]))}")
        return Start(index % graph.num_nodes, graph.positions[index])
    place = frozen_floats(start, name="start")
    in_space = graph.group.position_dim == 3
    if place.shape not in ((3,), (7,) if in_space else (2,)) or not np.isfinite(place).all():
        expected = f"(x, y, z) in a graph in {graph.group.name}" if in_space else "(x, y)"
        raise InvalidInputError(f"expected start as the index of a pose or a finite place {expected}, got {start!r}")
    place = place[: graph.group.position_dim]
    distances = np.linalg.norm(graph.positions - place, axis=1)
    in_sight = ~graph.is_landmark
    if world is not None:
        in_sight = in_sight & world.visible(
            *(seen_by(world, ends) for ends in (np.broadcast_to(place, graph.positions.shape), graph.positions))
        )
    if not in_sight.any():
        raise PlanningError(
            f"expected a start in sight of a pose of the graph, got {shown_place(place)}, from which no pose is; "
            "start at a pose"
        )
    distances[~in_sight] = np.inf
    nearest = np.flatnonzero(distances <= distances.min() + _SAME_PLACE)[-1]
    return Start(int(nearest), place)
