"""Degree sums of many extensions of one graph, from the degrees that they change.

In S = sum over the edges of the simple graph of 1 / (d(i) d(j)) only the edges at nodes whose degree changes, and the new ones,
change their terms (docs, the mathematics, section 7): O(sum of the degrees of those nodes).
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from topobelief.arrays import FloatArray, IntArray
from topobelief.graph.topology import Topology
from topobelief.linalg.compiled import compiled, in_parallel, num_threads, unset

_EDGES_PER_THREAD = 10_000  # fewer are done before a thread has started


class DegreeSums:
    """S of a graph and of its extensions.

    Parameters
    ----------
    topology
        n nodes; parallel edges collapse.
    """

    def __init__(self, topology: Topology) -> None:
        n = topology.num_nodes
        low, high = np.sort(topology.edges, axis=1).T
        i, j = np.divmod(np.unique(low * n + high), n)
        adjacency = sparse.csr_array((np.ones(2 * len(i)), (np.r_[i, j], np.r_[j, i])), shape=(n, n))
        adjacency.sort_indices()
        self._start, self._neighbours = adjacency.indptr.astype(np.int64), adjacency.indices.astype(np.int64)
        d = np.maximum(np.diff(self._start), 1).astype(float)
        self._sum = float(np.sum(1 / (d[i] * d[j])))

    def of_extensions(self, edges: IntArray, edge_start: IntArray, num_new: IntArray) -> FloatArray:
        """S of each extension, shape (K,).

        Parameters
        ----------
        edges : shape (number of edges, 2)
            0 … n - 1, then n, n + 1, … for the new nodes of each extension.
        edge_start : shape (K + 1,)
        num_new : shape (K,)
        """
        changes = np.empty(len(num_new))

        def work(first: int, last: int) -> None:
            part = slice(first, last)
            _changes(self._start, self._neighbours, edges, edge_start[first : last + 1], num_new[part], changes[part])

        parts = min(num_threads(), 1 + len(edges) // _EDGES_PER_THREAD)
        in_parallel(work, np.linspace(0, len(num_new), parts + 1).astype(int).tolist())
        return self._sum + changes


@compiled
def _changes(
    start: IntArray, neighbours: IntArray, edges: IntArray, edge_start: IntArray, num_new: IntArray, changes: FloatArray
) -> None:
    """What each extension adds to S."""
    n, longest, most = len(start) - 1, 0, 0
    for k in range(len(num_new)):
        longest, most = max(longest, edge_start[k + 1] - edge_start[k]), max(most, num_new[k])
    gain = np.zeros(n + most, np.int64)  # new edges at each node
    head, link = unset(n + most), np.empty(longest, np.int64)  # new edges by the larger of their ends
    low, high = np.empty(longest, np.int64), np.empty(longest, np.int64)
    for k in range(len(num_new)):
        count = 0
        for e in range(edge_start[k], edge_start[k + 1]):
            i, j = min(edges[e, 0], edges[e, 1]), max(edges[e, 0], edges[e, 1])
            known = False
            if j < n:
                p, end = int(start[i]), int(start[i + 1])
                while p < end and neighbours[p] < j:
                    p += 1
                known = p < end and bool(neighbours[p] == j)
            at = head[j]
            while at >= 0 and not known:
                known = bool(low[at] == i)
                at = link[at]
            if not known:
                low[count], high[count], link[count], head[j] = i, j, head[j], count
                gain[i] += 1
                gain[j] += 1
                count += 1
        total = 0.0
        for at in range(count):  # new edges; and old ones at nodes that gain some, from the end that comes first: head -2
            d = gain[high[at]]
            if high[at] < n:
                d += start[high[at] + 1] - start[high[at]]
                total += _old_edges(start, neighbours, gain, head, high[at])
            if low[at] < n:
                total += _old_edges(start, neighbours, gain, head, low[at])
                total += 1.0 / (d * (gain[low[at]] + start[low[at] + 1] - start[low[at]]))
            else:
                total += 1.0 / (d * gain[low[at]])
        for at in range(count):
            head[low[at]] = head[high[at]] = -1
            gain[low[at]] = gain[high[at]] = 0
        changes[k] = total


@compiled
def _old_edges(start: IntArray, neighbours: IntArray, gain: IntArray, done: IntArray, t: int) -> float:
    """What the graph's own edges at node t add to S by the new degrees, but for those to nodes that are done (-2)."""
    total = 0.0
    if done[t] == -2:
        return total
    done[t] = -2
    before = start[t + 1] - start[t]
    after = before + gain[t]
    for p in range(start[t], start[t + 1]):
        s = neighbours[p]
        if done[s] != -2:
            d = start[s + 1] - start[s]
            total += 1.0 / (after * (d + gain[s])) - 1.0 / (before * d)
    return total
