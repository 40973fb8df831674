"""Connected components of a pose graph, as pose graphs."""

from __future__ import annotations

import numpy as np

from topobelief.arrays import IntArray
from topobelief.graph.pose_graph import PoseGraph


def components(graph: PoseGraph) -> list[PoseGraph]:
    """The connected components, the one with the most poses first; of equal ones the one with the first pose.

    Landmarks that no pose sees are in none. Ids, the order of poses and of edges, and fixed poses are kept.

    Examples
    --------
    >>> graph = PoseGraph([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [(1, 2)], None, np.eye(3), ids=[7, 8, 9])
    >>> [part.ids.tolist() for part in components(graph)]
    [[8, 9], [7]]
    """
    labels = graph.topology.component_labels
    members = [np.flatnonzero(labels == label) for label in np.unique(labels[graph.pose_indices])]
    parts = [part_of(graph, nodes) for nodes in sorted(members, key=lambda nodes: (-len(nodes), nodes[0]))]
    return sorted(parts, key=lambda part: -part.num_poses)


def part_of(graph: PoseGraph, nodes: IntArray) -> PoseGraph:
    """Whole components, by the indices of their poses in increasing order."""
    return graph.part(nodes)
