"""Whether the measurements of a graph determine it, up to a motion of all of it."""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.errors import DisconnectedGraphError, InvalidGraphError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.topology import Topology, checked_anchor
from topobelief.symbols import node_name

_FLAT = 1e-12  # of the largest information on a landmark's position; what is less is rounding


def chosen_anchor(graph: PoseGraph, anchor: int | None) -> int:
    """The node to hold, counted from the end where it is negative; None: the first pose.

    Raises
    ------
    InvalidGraphError
        Where there is no such node.
    """
    return int(graph.pose_indices[0]) if anchor is None else checked_anchor(graph.num_nodes, anchor)


def require_determined(graph: PoseGraph, *, anchor: int = 0) -> None:
    """Raise where nodes are not connected to the anchor, or where what is seen of a landmark leaves its position open.

    Raises
    ------
    DisconnectedGraphError
        Names nodes that the anchor does not reach.
    InvalidGraphError
        If the anchor is a landmark, or names the first landmark whose observations do not determine it even where all poses are
        known, such as one range.
    """
    if graph.is_landmark[anchor]:
        raise InvalidGraphError(f"expected the anchor to be a pose, got landmark {node_name(int(graph.ids[anchor]))}")
    graph.topology.require_connected(anchor=anchor, names=graph.ids)
    if graph.num_landmarks:
        _require_fixed_landmarks(graph)


def require_connected_poses(graph: PoseGraph, *, anchor: int = 0) -> None:
    """Raise where poses hang together by landmarks alone, so that the graph of rotations falls apart.

    Signatures and lower bounds of ln det I are sums over the trees of that graph; entropies do without.

    Raises
    ------
    DisconnectedGraphError
        Names poses that relative measurements do not connect to the anchor.
    """
    if not graph.num_landmarks:
        return
    poses = graph.pose_indices
    between = graph.edges[graph.reading_codes == 0]
    topology = Topology(len(poses), np.searchsorted(poses, between))
    labels = topology.component_labels
    loose = poses[labels != labels[np.searchsorted(poses, anchor)]]
    if loose.size:
        raise DisconnectedGraphError(
            graph.ids[loose].tolist(), anchor=int(graph.ids[anchor]), what="graph of relative poses, landmarks left out"
        )


def _require_fixed_landmarks(graph: PoseGraph) -> None:
    observing = np.flatnonzero(graph.reading_codes)
    edges, k = graph.edges[observing], graph.group.position_dim
    turn = graph.group.rotation_matrix(graph.poses[edges[:, 0]])
    blocks = turn @ graph.information[observing, :k, :k] @ turn.transpose(0, 2, 1)
    seen = _summed(blocks, edges[:, 1], graph.num_nodes)[graph.is_landmark]
    eigenvalues = np.linalg.eigvalsh(seen)
    open_ones = np.flatnonzero(eigenvalues[:, 0] <= _FLAT * eigenvalues[:, -1])
    if open_ones.size:
        landmark = int(np.flatnonzero(graph.is_landmark)[open_ones[0]])
        counts = int(np.count_nonzero(edges[:, 1] == landmark))
        kinds = sorted(set(graph.readings[observing][edges[:, 1] == landmark].tolist()))
        name = node_name(int(graph.ids[landmark]))
        raise InvalidGraphError(
            f"expected observations that determine the position of landmark {name}, got {counts} "
            f"of {' and '.join(kind.replace('_', ' and ') for kind in kinds)} that leave a direction open; "
            "add observations from other places or leave the landmark out"
        )


def _summed(blocks: FloatArray, nodes: IntArray, num_nodes: int) -> FloatArray:
    total = np.zeros((num_nodes, *blocks.shape[1:]))
    np.add.at(total, nodes, blocks)
    return total
