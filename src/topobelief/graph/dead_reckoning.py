"""Dead reckoning: poses from relative measurements alone, composed along a spanning tree.

The tree prefers odometry: edges are taken in the order of their index gap |i - j|, then of their place in the list (Kruskal's
minimum spanning tree), so a trajectory with all of its odometry is chained from pose to pose and a loop closure serves
only where the chain is broken.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from topobelief.arrays import FloatArray, IntArray
from topobelief.geometry import Group


def dead_reckoned_poses(
    group: Group,
    num_poses: int,
    edges: IntArray,
    measurements: FloatArray,
    *,
    known: ArrayLike,
    known_poses: FloatArray,
) -> FloatArray:
    """Poses composed from measurements, outwards from those that are known.

    Parameters
    ----------
    group
        SE(2) or SE(3).
    num_poses
        n.
    edges : shape (m, 2)
    measurements : shape (m, pose_size)
        T_i_j.
    known : shape (a,), a >= 1
        Indices of poses that are given; they stay as they are.
    known_poses : shape (a, pose_size)

    Returns
    -------
    array, shape (n, pose_size)
        Rows of nan where no known pose is reached.

    Examples
    --------
    >>> from topobelief.geometry import SE2_GROUP
    >>> start, step = np.array([[1.0, 2.0, 0.0]]), np.array([[0.5, 0.0, 0.25]])
    >>> dead_reckoned_poses(SE2_GROUP, 2, np.array([[0, 1]]), step, known=[0], known_poses=start).tolist()
    [[1.0, 2.0, 0.0], [1.5, 2.0, 0.25]]
    """
    known = np.asarray(known, dtype=np.int64)
    parent, tree_edge = _spanning_tree(num_poses, edges, known)
    root = num_poses
    poses = np.full((num_poses, group.pose_size), np.nan)
    poses[known] = known_poses
    placed = np.flatnonzero(tree_edge >= 0)
    edge = tree_edge[placed]
    outward = edges[edge, 1] == placed
    step = measurements[edge]
    poses[placed] = np.where(outward[:, None], step, group.inverse(step))
    # each row is the pose in the frame of its ancestor; composing with the ancestor's row doubles the distance to it
    while (rest := np.flatnonzero((parent >= 0) & (parent != root))).size:
        ancestor = parent[rest]
        poses[rest] = group.compose(poses[ancestor], poses[rest])
        parent[rest] = parent[ancestor]
    return poses


def _spanning_tree(num_poses: int, edges: IntArray, known: IntArray) -> tuple[IntArray, IntArray]:
    """Parent of each pose (num_poses above the known ones, -1 where unreached) and the edge to it (-1 where there is none)."""
    root = num_poses
    order = np.argsort(np.abs(edges[:, 0] - edges[:, 1]), kind="stable")
    ends = np.concatenate([np.stack([known, np.full_like(known, root)], axis=1), np.sort(edges[order], axis=1)])
    _, first = np.unique(ends[:, 0] * (root + 1) + ends[:, 1], return_index=True)  # of parallel edges the best
    weights = 1.0 + first
    graph = sparse.csr_array((weights, ends[first].T), shape=(root + 1, root + 1))
    tree = minimum_spanning_tree(graph)
    predecessors = breadth_first_order(tree, root, directed=False)[1]
    parent = np.where(predecessors[:-1] >= 0, predecessors[:-1], -1).astype(np.int64)
    links = sparse.coo_array(tree)
    a, b = (index.astype(np.int64) for index in links.coords)
    rank = links.data.astype(np.int64) - 1 - len(known)
    inner = (b != root) & (parent[a] >= 0)
    a, b, rank = a[inner], b[inner], rank[inner]
    tree_edge = np.full(num_poses, -1)
    tree_edge[np.where(parent[a] == b, a, b)] = order[rank]
    return parent, tree_edge
