"""What a path sees again: the stretches of existing poses that its loop closures lead to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from topobelief.arrays import IntArray
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.symbols import node_name
from topobelief.wording import counted

_GAP = 3  # poses; one stretch goes on across fewer that are not seen


@dataclass(frozen=True, slots=True)
class Stretch:
    """Existing poses, one after another, and the closures of an action with them."""

    first: int  # index of a pose
    last: int
    num_closures: int
    first_new: int  # of the action's new poses that close them, counted from 0
    last_new: int


def closures_of(graph: PoseGraph, start: int, action: Action) -> IntArray:
    """The measurements of an action that are not its odometry, smaller index first, shape (number of closures, 2).

    Parameters
    ----------
    graph
    start
        Index of the pose from which the robot leaves.
    action
    """
    low, high = np.sort(action.edges, axis=1).T
    odometry = (low == start) & (high == graph.num_poses)
    odometry |= (low >= graph.num_poses) & (high - low == 1)
    return np.stack([low, high], axis=1)[~odometry]


def seen_again(graph: PoseGraph, start: int, action: Action) -> list[Stretch]:
    """Stretches of the graph's poses with which an action closes loops, those with most closures first; as `closures_of`."""
    closures = closures_of(graph, start, action)
    old, new = closures[closures[:, 0] < graph.num_poses].T
    if not old.size:
        return []
    order = np.argsort(old, kind="stable")
    old, new = old[order], new[order] - graph.num_poses
    parts = np.split(np.arange(len(old)), np.flatnonzero(np.diff(old) > _GAP) + 1)
    stretches = [
        Stretch(int(old[part[0]]), int(old[part[-1]]), len(part), int(new[part].min()), int(new[part].max())) for part in parts
    ]
    return sorted(stretches, key=lambda stretch: -stretch.num_closures)


def described(graph: PoseGraph, stretches: Sequence[Stretch], *, most: int = 3) -> str:
    """The stretches in words, by what the file calls poses: "sees poses 31 to 46 and 3 again, 12 closures"."""
    if not stretches:
        return "sees no pose again"
    ids: list[int] = graph.ids.tolist()
    names = [
        node_name(ids[each.first]) + (f" to {node_name(ids[each.last])}" if each.last > each.first else "")
        for each in stretches[:most]
    ]
    if len(stretches) > most:
        names.append(f"{len(stretches) - most} more stretches" if len(stretches) > most + 1 else "1 more stretch")
    listed = " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
    one = len(stretches) == 1 and stretches[0].first == stretches[0].last
    total = sum(each.num_closures for each in stretches)
    return f"sees pose{'' if one else 's'} {listed} again, {counted(total, 'closure')}"
