"""Sparsity patterns of block matrices on graphs, built once and filled many times.

The upper triangle of a block matrix with one block per node and one per pair of adjacent nodes, in compressed columns,
with the held (anchored) nodes left out. Parallel edges add into one block.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.linalg.edge_form import EdgeForm


@dataclass(frozen=True, slots=True)
class BlockPattern:
    """Where the blocks of the free nodes go, and which edges add into which block."""

    size: int
    block_size: int
    indptr: IntArray
    indices: IntArray
    gather: IntArray  # entry of the compressed columns -> entry of the stacked blocks
    diagonal_sum: sparse.csr_array  # free node <- edge ends (i then j)
    off_diagonal_sum: sparse.csr_array  # upper block <- edges, those stored (i < j) then those stored (i > j)
    flipped: BoolArray  # among edges between free nodes: stored with i > j
    inner: IntArray  # edges between free nodes

    @staticmethod
    def build(edges: IntArray, free: BoolArray, block_size: int) -> BlockPattern:
        """Pattern of the nodes marked `free`.

        Parameters
        ----------
        edges : shape (m, 2)
        free : shape (num_nodes,)
        block_size
            Variables per node.
        """
        b, num_free, num_edges = block_size, int(free.sum()), len(edges)
        position = np.cumsum(free) - 1
        ends = edges.T.ravel()
        touching = np.flatnonzero(free[ends])
        diagonal_sum = sparse.csr_array(
            (np.ones(len(touching)), (position[ends[touching]], touching)), shape=(num_free, 2 * num_edges)
        )
        inner = np.flatnonzero(free[edges].all(axis=1))
        low, high = np.sort(position[edges[inner]], axis=1).T
        keys, block_of_edge = np.unique(high * num_free + low, return_inverse=True)
        off_diagonal_sum = sparse.csr_array(
            (np.ones(len(inner)), (block_of_edge, np.arange(len(inner)))), shape=(len(keys), len(inner))
        )
        # entries of all stacked blocks, the upper triangle of diagonal blocks and the whole of the others
        block_row = np.concatenate([np.arange(num_free), keys % num_free if num_free else keys])
        block_column = np.concatenate([np.arange(num_free), keys // num_free if num_free else keys])
        r, c = (index.ravel() for index in np.indices((b, b)))
        row = (block_row[:, None] * b + r).ravel()
        column = (block_column[:, None] * b + c).ravel()
        upper = np.flatnonzero(row <= column)
        gather = upper[np.argsort(column[upper] * (num_free * b) + row[upper], kind="stable")]
        counts = np.bincount(column[gather], minlength=num_free * b)
        return BlockPattern(
            size=num_free * b,
            block_size=b,
            indptr=np.concatenate([[0], np.cumsum(counts)]),
            indices=row[gather],
            gather=gather,
            diagonal_sum=diagonal_sum,
            off_diagonal_sum=off_diagonal_sum,
            flipped=position[edges[inner, 0]] > position[edges[inner, 1]],
            inner=inner,
        )

    def upper(self, form: EdgeForm, *, shift: float = 0.0) -> sparse.csc_array:
        """Upper triangle of the form's matrix plus `shift` times I; explicit zeros stay, so equal patterns stay equal."""
        b = self.block_size
        diagonal = self.diagonal_blocks(form) + shift * np.eye(b)
        cross = form.rows_i[self.inner].transpose(0, 2, 1) @ form.rows_j[self.inner]
        cross = np.where(self.flipped[:, None, None], cross.transpose(0, 2, 1), cross)
        off_diagonal = self.off_diagonal_sum @ cross.reshape(-1, b * b)
        data = np.concatenate([diagonal.ravel(), off_diagonal.ravel()])[self.gather]
        return sparse.csc_array((data, self.indices, self.indptr), shape=(self.size, self.size))

    def diagonal_blocks(self, form: EdgeForm) -> FloatArray:
        """Diagonal blocks of the form's matrix, shape (num_free, b, b)."""
        ends = np.concatenate([form.rows_i, form.rows_j])
        b = self.block_size
        return (self.diagonal_sum @ (ends.transpose(0, 2, 1) @ ends).reshape(-1, b * b)).reshape(self.size // b, b, b)

    def magnitude(self, form: EdgeForm) -> FloatArray:
        """Sum of squared term sizes behind each diagonal entry, shape (size,)."""
        return (self.diagonal_sum @ np.concatenate([form.magnitude_i, form.magnitude_j]) ** 2).ravel()

    def rows_transposed_times(self, form: EdgeForm, values: FloatArray) -> FloatArray:
        """Sum of R_e^T values_e over edges, on the free variables.

        Parameters
        ----------
        values : shape (m, r, c)
            A value for each row, in c columns.

        Returns
        -------
        array, shape (size, c)
        """
        pulled = np.concatenate([form.rows_i.transpose(0, 2, 1) @ values, form.rows_j.transpose(0, 2, 1) @ values])
        return (self.diagonal_sum @ pulled.reshape(len(pulled), -1)).reshape(self.size, values.shape[2])

    def scattered(self, edges: IntArray, rows_i: FloatArray, rows_j: FloatArray) -> FloatArray:
        """Single rows on all free variables, dense.

        Parameters
        ----------
        edges : shape (s,)
            The edge of each row.
        rows_i, rows_j : shape (s, b)
            The row on the variables of both ends.

        Returns
        -------
        array, shape (s, size)
        """
        num_edges = self.diagonal_sum.shape[1] // 2
        place = np.full(2 * num_edges, -1)
        node, slot = self.diagonal_sum.tocoo().coords
        place[slot] = node
        dense = np.zeros((len(edges), self.size // self.block_size, self.block_size))
        for at, rows in ((place[edges], rows_i), (place[edges + num_edges], rows_j)):
            free = np.flatnonzero(at >= 0)
            dense[free, at[free]] += rows[free]
        return dense.reshape(len(edges), self.size)

    def dense_rows(self, form: EdgeForm) -> FloatArray:
        """All rows on all free variables, dense, shape (m r, size)."""
        b = self.block_size
        edge_of_row = np.indices(form.rows_i.shape[:2])[0].ravel()
        return self.scattered(edge_of_row, form.rows_i.reshape(-1, b), form.rows_j.reshape(-1, b))

    def rows_at(self, form: EdgeForm, node: int) -> tuple[FloatArray, FloatArray]:
        """All rows on the variables of one free node, shape (d r, b), and what `magnitude` says of them, shape (b,)."""
        start, stop = self.diagonal_sum.indptr[node : node + 2]
        slots: IntArray = np.asarray(self.diagonal_sum.indices[start:stop], dtype=np.int64)
        edges, at_j = slots % len(form.edges), slots >= len(form.edges)
        rows = np.where(at_j[:, None, None], form.rows_j[edges], form.rows_i[edges])
        magnitudes = np.where(at_j[:, None], form.magnitude_j[edges], form.magnitude_i[edges])
        return rows.reshape(-1, self.block_size), np.sum(magnitudes**2, axis=0)
