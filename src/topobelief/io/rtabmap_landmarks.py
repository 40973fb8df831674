"""Tags that a database of RTAB-Map has beside its nodes, as landmarks: points, of which nodes see the position.

A link to a tag measures its pose. Of that the position counts, with the information that the link has on it whatever the
rotation is; RTAB-Map itself takes a tag for a point where its rotation is as good as unknown.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.geometry import SE3_GROUP
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.readings import POSITION, RELATIVE_POSE
from topobelief.graph.variable_kinds import LANDMARK, POSE
from topobelief.wording import counted

_SYMBOL = ord("l") << 56  # tags are numbered apart from nodes: tag 5 is l5


def with_landmarks(
    graph: PoseGraph, ends: IntArray, transforms: FloatArray, information: FloatArray, optimised: Mapping[int, FloatArray]
) -> tuple[PoseGraph, list[str]]:
    """The graph with the tags that its poses see, and what was left out.

    Parameters
    ----------
    graph
        Of poses alone, ids ascending.
    ends : shape (m, 2)
        Ids of node and tag, in any order; those of tags are negative.
    transforms : shape (m, 7)
        The second end in the frame of the first.
    information : shape (m, 6, 6)
        Positive definite.
    optimised
        Poses by id. A tag without one is where it was seen first.
    """
    backwards = ends[:, 0] < 0
    nodes, tags = np.where(backwards, ends[:, 1], ends[:, 0]), -ends.min(axis=1)
    seen = np.where(backwards[:, None], SE3_GROUP.inverse(transforms), transforms)
    linked = np.isin(nodes, graph.ids)
    notes = ["took tags for points: what is measured of their orientation is not counted"]
    if not linked.all():
        lost = counted(int(np.count_nonzero(~linked)), "sighting of a landmark", "sightings of landmarks")
        notes.append(f"left out {lost} from nodes without a link to another")
    nodes, tags, seen, backwards = nodes[linked], tags[linked], seen[linked], backwards[linked]
    if not len(nodes):
        return graph, notes
    names, which = np.unique(tags, return_inverse=True)
    source = np.searchsorted(graph.ids, nodes)
    omega = information[linked]
    alone = omega[:, :3, :3] - omega[:, :3, 3:] @ np.linalg.solve(omega[:, 3:, 3:], omega[:, 3:, :3])
    turn = np.where(backwards[:, None, None], np.eye(3), SE3_GROUP.rotation_matrix(seen))  # it holds in the frame of the end
    rotated = turn @ alone @ turn.mT
    of_positions = np.zeros_like(omega)
    of_positions[:, :3, :3] = (rotated + rotated.mT) / 2
    first = np.unique(which, return_index=True)[1]
    places = SE3_GROUP.compose(graph.poses[source[first]], seen[first])
    for row, tag in enumerate(names.tolist()):
        places[row] = optimised.get(-tag, places[row])
    n = graph.num_poses
    whole = PoseGraph(
        np.concatenate([graph.poses, places]),
        np.concatenate([graph.edges, np.stack([source, n + which], axis=1)]),
        np.concatenate([graph.measurements, seen]),
        np.concatenate([graph.information, of_positions]),
        [POSE.name] * n + [LANDMARK.name] * len(names),
        ids=np.concatenate([graph.ids, names + _SYMBOL]),
        readings=[RELATIVE_POSE] * graph.num_edges + [POSITION.name] * len(nodes),
    )
    return whole, notes
