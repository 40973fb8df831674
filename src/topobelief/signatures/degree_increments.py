"""Von Neumann entropies by degrees of many extensions of one graph, from the degrees that they change.

With S = sum over edges of the simple graph of 1 / (d(i) d(j)), only the edges at nodes whose degree changes, and the new ones,
change their terms (docs, the mathematics, section 7): O(sum of the degrees of those nodes).
"""

from __future__ import annotations

import math

import numpy as np
from scipy import sparse

from topobelief.arrays import FloatArray, IntArray
from topobelief.graph.topology import Topology
from topobelief.linalg.compiled import compiled


class DegreeEntropy:
    """Von Neumann entropy by degrees of a graph and of its extensions.

    Parameters
    ----------
    topology
        n nodes; parallel edges collapse.
    """

    def __init__(self, topology: Topology) -> None:
        simple = topology.simple()
        i, j = simple.edges.T
        n = topology.num_nodes
        adjacency = sparse.csr_array((np.ones(2 * len(i)), (np.r_[i, j], np.r_[j, i])), shape=(n, n))
        adjacency.sort_indices()
        self._num_nodes = n
        self._start, self._neighbours = adjacency.indptr.astype(np.int64), adjacency.indices.astype(np.int64)
        d = np.maximum(np.diff(self._start), 1).astype(float)
        self._sum = float(np.sum(1 / (d[i] * d[j])))

    def of_extensions(self, edges: IntArray, edge_start: IntArray, num_new: IntArray) -> FloatArray:
        """Entropy of each extension, nats, shape (K,).

        Parameters
        ----------
        edges : shape (number of edges, 2)
            0 … n - 1, then n, n + 1, … for the new nodes of each extension.
        edge_start : shape (K + 1,)
        num_new : shape (K,)
        """
        changes = np.empty(len(num_new))
        _changes(self._start, self._neighbours, edges, edge_start, num_new, changes)
        return (self._num_nodes + num_new) / 2 * math.log(2) - 0.5 * (self._sum + changes)


@compiled
def _changes(
    start: IntArray, neighbours: IntArray, edges: IntArray, edge_start: IntArray, num_new: IntArray, changes: FloatArray
) -> None:
    """What each extension adds to S."""
    n, longest, most = len(start) - 1, 0, 0
    for k in range(len(num_new)):
        longest, most = max(longest, edge_start[k + 1] - edge_start[k]), max(most, num_new[k])
    gain = np.zeros(n + most, np.int64)  # new edges at each node
    head, link = np.full(n + most, -1), np.empty(longest, np.int64)  # new edges by the larger of their ends
    kept = np.empty(longest, np.int64)
    for k in range(len(num_new)):
        count = 0
        for e in range(edge_start[k], edge_start[k + 1]):
            low, high = min(edges[e, 0], edges[e, 1]), max(edges[e, 0], edges[e, 1])
            known = False
            if high < n:
                p, end = int(start[low]), int(start[low + 1])
                while p < end and neighbours[p] < high:
                    p += 1
                known = p < end and bool(neighbours[p] == high)
            at = head[high]
            while at >= 0 and not known:
                known = bool(min(edges[kept[at], 0], edges[kept[at], 1]) == low)
                at = link[at]
            if known:
                continue
            kept[count], link[count], head[high] = e, head[high], count
            count += 1
            gain[low] += 1
            gain[high] += 1
        total = 0.0
        for at in range(count):
            i, j = edges[kept[at], 0], edges[kept[at], 1]
            d_i = gain[i] + (start[i + 1] - start[i] if i < n else 0)
            d_j = gain[j] + (start[j + 1] - start[j] if j < n else 0)
            total += 1.0 / (d_i * d_j)
        for at in range(count):  # old edges at nodes that gain some, once: `head` >= -1 marks what is still to do
            for side in range(2):
                t = edges[kept[at], side]
                if t >= n or head[t] == -2:
                    continue
                head[t] = -2
                before = start[t + 1] - start[t]
                after = before + gain[t]
                for p in range(start[t], start[t + 1]):
                    s = neighbours[p]
                    if head[s] == -2:  # done from the other end
                        continue
                    d = start[s + 1] - start[s]
                    total += 1.0 / (after * (d + gain[s])) - 1.0 / (before * d)
        for at in range(count):
            for side in range(2):
                head[edges[kept[at], side]] = -1
                gain[edges[kept[at], side]] = 0
        changes[k] = total
