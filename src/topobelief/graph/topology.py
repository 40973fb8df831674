"""Undirected graphs without geometry: nodes, edges, degrees and Laplacians.

Notation: G = (V, E); d(i) degree; L = Laplacian; L_tilde = L with the anchor's row and column removed.
Edges may be parallel; they add in degrees and Laplacians, and `simple()` collapses them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from topobelief.arrays import FloatArray, IntArray, ReadOnlyArrays, frozen_floats, frozen_ints, read_only
from topobelief.errors import DisconnectedGraphError, InvalidGraphError
from topobelief.wording import counted


@dataclass(frozen=True, eq=False, init=False)
class Topology(ReadOnlyArrays):
    """Nodes 0 … num_nodes - 1 and undirected edges between them.

    Parameters
    ----------
    num_nodes
        At least 1.
    edges : shape (num_edges, 2)
        Node indices. Parallel edges are kept; self-loops are rejected.

    Raises
    ------
    InvalidGraphError
        Names the first edge that is out of range or a self-loop.

    Examples
    --------
    >>> triangle = Topology(3, [(0, 1), (1, 2), (2, 0)])
    >>> triangle.degrees.tolist()
    [2, 2, 2]
    """

    num_nodes: int
    edges: IntArray

    def __init__(self, num_nodes: int, edges: ArrayLike) -> None:
        checked = frozen_ints(edges, name="edges")
        if checked.size == 0:
            checked = checked.reshape(0, 2)
        if checked.ndim != 2 or checked.shape[1] != 2:
            raise InvalidGraphError(f"expected edges of shape (num_edges, 2), got {checked.shape}")
        if not isinstance(num_nodes, (int, np.integer)):  # pyright: ignore[reportUnnecessaryIsInstance]  (untyped callers)
            raise InvalidGraphError(f"expected a whole number of nodes, got {num_nodes}")
        if num_nodes < 1:
            raise InvalidGraphError(f"expected at least one node, got {num_nodes}")
        bad = np.flatnonzero((checked < 0).any(axis=1) | (checked >= num_nodes).any(axis=1))
        if bad.size:
            raise InvalidGraphError(
                f"expected node indices from 0 to {num_nodes - 1}, got edge {bad[0]} = {tuple(checked[bad[0]].tolist())}"
            )
        loops = np.flatnonzero(checked[:, 0] == checked[:, 1])
        if loops.size:
            raise InvalidGraphError(
                f"expected edges between two nodes, got self-loop at node {checked[loops[0], 0]} (edge {loops[0]})"
            )
        object.__setattr__(self, "num_nodes", int(num_nodes))
        object.__setattr__(self, "edges", checked)

    def __repr__(self) -> str:
        return f"Topology({counted(self.num_nodes, 'node')}, {counted(self.num_edges, 'edge')})"

    @property
    def num_edges(self) -> int:
        """Number of edges, parallel ones counted."""
        return len(self.edges)

    @cached_property
    def degrees(self) -> IntArray:
        """d(i), parallel edges counted; shape (num_nodes,)."""
        return read_only(np.bincount(self.edges.ravel(), minlength=self.num_nodes).astype(np.int64))

    def weighted_degrees(self, weights: FloatArray) -> FloatArray:
        """Diagonal of the weighted Laplacian, shape (num_nodes,)."""
        total = np.bincount(self.edges.ravel(), weights=np.repeat(weights, 2), minlength=self.num_nodes)
        return total.astype(np.float64)

    def simple(self) -> Topology:
        """The same graph with parallel edges collapsed into one; edges sorted."""
        keys = np.unique(np.sort(self.edges, axis=1), axis=0)
        return Topology(self.num_nodes, keys)

    @cached_property
    def degree_sum(self) -> float:
        """Sum over the edges of the simple graph of 1 / (d(i) d(j)), d its degrees."""
        simple = self.simple()
        i, j = simple.edges.T
        degrees = simple.degrees.astype(np.float64)
        return float(np.sum(1 / (degrees[i] * degrees[j])))

    def laplacian(self, weights: ArrayLike | None = None) -> sparse.csr_array:
        """L = D - W, shape (num_nodes, num_nodes), sparse.

        Parameters
        ----------
        weights : shape (num_edges,), optional
            Positive, in edge order. Default: ones.
        """
        w = checked_weights(self, weights)
        i, j = self.edges.T
        adjacency = sparse.coo_array((np.r_[w, w], (np.r_[i, j], np.r_[j, i])), shape=(self.num_nodes, self.num_nodes))
        return sparse.csr_array(sparse.diags_array(self.weighted_degrees(w)) - adjacency)

    def reduced_laplacian(self, weights: ArrayLike | None = None, *, anchor: int = 0) -> sparse.csr_array:
        """L_tilde: the Laplacian without the anchor's row and column."""
        keep = np.flatnonzero(np.arange(self.num_nodes) != checked_anchor(self.num_nodes, anchor))
        return sparse.csr_array(self.laplacian(weights)[keep][:, keep])

    @cached_property
    def component_labels(self) -> IntArray:
        """Connected component of each node, shape (num_nodes,)."""
        i, j = self.edges.T
        adjacency = sparse.coo_array((np.ones(self.num_edges), (i, j)), shape=(self.num_nodes, self.num_nodes))
        return read_only(np.asarray(connected_components(adjacency, directed=False)[1], dtype=np.int64))

    @property
    def num_components(self) -> int:
        """Number of connected components."""
        return int(self.component_labels.max()) + 1

    def require_connected(self, *, anchor: int = 0, names: IntArray | None = None) -> None:
        """Raise `DisconnectedGraphError` naming nodes that the anchor does not reach (by `names`, if given)."""
        if self.num_edges >= self.num_nodes - 1 and self.num_components == 1:
            return
        unreached = np.flatnonzero(self.component_labels != self.component_labels[anchor])
        if unreached.size:
            shown = unreached if names is None else names[unreached]
            raise DisconnectedGraphError(shown.tolist(), anchor=int(anchor if names is None else names[anchor]))


def checked_anchor(num_nodes: int, anchor: int) -> int:
    """The anchor as an index from 0, counted from the end where it is negative.

    Raises
    ------
    InvalidGraphError
        Where there is no such node.
    """
    if not -num_nodes <= anchor < num_nodes:
        raise InvalidGraphError(f"expected an anchor from 0 to {num_nodes - 1}, got {anchor}")
    return int(anchor) % num_nodes


def checked_weights(topology: Topology, weights: ArrayLike | None) -> FloatArray:
    """Edge weights as an array, ones where None.

    Raises
    ------
    InvalidGraphError
        Where their number is wrong or one is not positive and finite.
    """
    if weights is None:
        return np.ones(topology.num_edges)
    w = frozen_floats(weights, name="weights")
    if w.shape != (topology.num_edges,):
        raise InvalidGraphError(f"expected one weight per edge, shape ({topology.num_edges},), got {w.shape}")
    bad = np.flatnonzero(~(np.isfinite(w) & (w > 0)))
    if bad.size:
        raise InvalidGraphError(f"expected positive finite weights, got {w[bad[0]]} at edge {bad[0]}")
    return w
