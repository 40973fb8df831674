"""Extensions of a graph: new nodes and edges, many candidates for the same graph one after the other.

The new nodes of each are attached to the graph by a spanning forest of its edges; the other edges are its closures. Chains and
branches may be attached anywhere; closures may join new nodes, existing ones or both, in either direction, and be parallel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from topobelief.arrays import BoolArray, IntArray
from topobelief.linalg.compiled import compiled, unset


class Extensions(NamedTuple):
    """K extensions of one graph.

    Attributes
    ----------
    num_existing
        n, nodes that are there already.
    edges : shape (number of edges, 2)
        Existing nodes 0 … n - 1, then all new nodes, counted through the extensions.
    edge_start, node_start : shape (K + 1,)
        Where each extension begins, among edges and new nodes.
    stem : shape (number of new nodes,)
        Edge of the forest that leads to each new node, away from the graph.
    order : shape (number of new nodes,)
        New nodes of each extension, a node before those that it leads to.
    planted : shape (number of edges,)
        Whether an edge belongs to the forest.
    """

    num_existing: int
    edges: IntArray
    edge_start: IntArray
    node_start: IntArray
    stem: IntArray
    order: IntArray
    planted: BoolArray

    @staticmethod
    def of(
        num_existing: int, edges: IntArray, edge_start: IntArray, node_start: IntArray, stems: BoolArray | None = None
    ) -> Extensions:
        """Choose the forests: edges between consecutive new nodes first, then by place in the list.

        Parameters
        ----------
        num_existing, edges, edge_start, node_start
            As above. Every new node is connected to an existing one.
        stems : shape (number of edges,), optional
            Edges that may belong to a forest; those alone connect every new node. Default: all.
        """
        num_new = int(node_start[-1])
        stem, order = np.full(num_new, -1), np.empty(num_new, np.int64)
        planted = np.zeros(len(edges), np.bool_)
        usable = np.ones(len(edges), np.bool_) if stems is None else stems
        _plant_forests(num_existing, edges, edge_start, node_start, usable, stem, order, planted)
        return Extensions(num_existing, edges, edge_start, node_start, stem, order, planted)

    @property
    def num_extensions(self) -> int:
        """K."""
        return len(self.edge_start) - 1


@compiled
def _root(group: IntArray, node: int) -> int:
    """The node that represents a node's group (union-find with path halving)."""
    while group[node] != node:
        above = int(group[node])
        group[node] = group[above]
        node = int(group[node])
    return node


@compiled
def _plant_forests(
    num_existing: int,
    edges: IntArray,
    edge_start: IntArray,
    node_start: IntArray,
    usable: BoolArray,
    stem: IntArray,
    order: IntArray,
    planted: BoolArray,
) -> None:
    """Kruskal's algorithm on each extension, all existing nodes taken as one; then a walk from there."""
    for k in range(len(node_start) - 1):
        first_new, num_new = node_start[k], int(node_start[k + 1] - node_start[k])
        offset = num_existing + first_new - 1  # new nodes are 1, 2, …; all existing ones together are 0
        group, head = np.empty(num_new + 1, np.int64), unset(num_new + 1)
        for node in range(num_new + 1):
            group[node] = node
        link = np.empty((edge_start[k + 1] - edge_start[k], 2), np.int64)  # stems at each node, from its `head` on
        for sweep in range(2):
            for e in range(edge_start[k], edge_start[k + 1]):
                i, j = max(int(edges[e, 0]) - offset, 0), max(int(edges[e, 1]) - offset, 0)
                if not usable[e] or (i > 0 and j > 0 and abs(i - j) == 1) != (sweep == 0):
                    continue
                a, b = _root(group, i), _root(group, j)
                if a == b:
                    continue
                group[a] = b
                planted[e] = True
                slot = e - edge_start[k]
                link[slot, 0], link[slot, 1] = head[i], head[j]
                head[i], head[j] = 2 * slot, 2 * slot + 1
        placed = 0  # the nodes reached so far form a queue
        for reached in range(num_new + 1):
            half = head[0 if reached == 0 else order[first_new + reached - 1] - first_new + 1]
            while half >= 0:
                slot, side = half // 2, half % 2
                other = max(edges[edge_start[k] + slot, 1 - side] - offset, 0)
                if other > 0 and stem[first_new + other - 1] < 0:
                    stem[first_new + other - 1] = edge_start[k] + slot
                    order[first_new + placed] = first_new + other - 1
                    placed += 1
                half = link[slot, side]
