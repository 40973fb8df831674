"""Quadratic forms on graphs: sums over edges of squared, whitened rows.

Every matrix whose determinant this package takes is M = sum over edges e = (i, j) of R_e^T R_e, where the rows
R_e = [R_i R_j] touch the variables of two nodes only: a weighted Laplacian (one row, -sqrt(w) and sqrt(w)), the Fisher
information (kappa rows), and its position and rotation parts. Rows, not blocks, are what is stored: a Gram matrix loses
half of the digits, so computations that need all of them (QR, increments) start from the rows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from topobelief.arrays import FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class EdgeForm:
    """Whitened rows of a quadratic form, edge by edge.

    Parameters
    ----------
    edges : shape (m, 2)
        Nodes i and j.
    rows_i, rows_j : shape (m, r, b)
        The r rows of each edge on the b variables of its nodes.
    magnitude_i, magnitude_j : shape (m, b)
        Size of the terms from which each column was computed: its rounding error is a few units of roundoff times this.
    root_errors : shape (m,), optional
        What rounding in the square root of each edge's noise adds to the error of the log-determinant, nats. Default: nothing.
    multiplicity
        The matrix meant is M kron I_multiplicity.
    gauge_free
        Whether a motion of all nodes together leaves the rows' values as they are. Then it does not matter for ln det which one
        node is held, and ln det is a sum over blocks (docs, the mathematics, section 4).
    """

    edges: IntArray
    rows_i: FloatArray
    rows_j: FloatArray
    magnitude_i: FloatArray
    magnitude_j: FloatArray
    root_errors: FloatArray | None = None
    multiplicity: int = 1
    gauge_free: bool = False

    @property
    def block_size(self) -> int:
        """b, variables per node."""
        return self.rows_i.shape[2]

    def between(self, which: IntArray, edges: IntArray) -> EdgeForm:
        """The rows of some edges, between nodes of other numbers.

        Parameters
        ----------
        which : shape (m',)
        edges : shape (m', 2)
        """
        return replace(
            self,
            edges=edges,
            rows_i=self.rows_i[which],
            rows_j=self.rows_j[which],
            magnitude_i=self.magnitude_i[which],
            magnitude_j=self.magnitude_j[which],
            root_errors=None if self.root_errors is None else self.root_errors[which],
        )

    @property
    def root_error(self) -> float:
        """Sum of `root_errors`."""
        return 0.0 if self.root_errors is None else float(self.root_errors.sum())

    def strongest_node(self) -> int:
        """The node with the largest sum of squared rows: holding it leaves the best conditioned matrix."""
        if len(self.edges) == 0:
            return 0
        strength = np.sum(np.concatenate([self.magnitude_i, self.magnitude_j]) ** 2, axis=1)
        return int(np.argmax(np.bincount(self.edges.T.ravel(), weights=strength)))


def laplacian_form(edges: IntArray, weights: FloatArray, *, multiplicity: int = 1) -> EdgeForm:
    """The weighted Laplacian: one row sqrt(w) (x_j - x_i) an edge.

    Parameters
    ----------
    edges : shape (m, 2)
    weights : shape (m,)
        Positive.
    multiplicity
        Copies of the Laplacian on the diagonal.
    """
    root = np.sqrt(weights)[:, None]
    return EdgeForm(edges, -root[..., None], root[..., None], root, root, multiplicity=multiplicity, gauge_free=True)
