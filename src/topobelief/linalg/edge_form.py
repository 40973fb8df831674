"""Quadratic forms on graphs: sums over edges of squared, whitened rows.

Every matrix whose determinant this package takes is M = sum over edges e = (i, j) of R_e^T R_e, where the rows
R_e = [R_i R_j] touch the variables of two nodes only: a weighted Laplacian (one row, -sqrt(w) and sqrt(w)), the Fisher
information (kappa rows), and its position and rotation parts. Rows, not blocks, are what is stored: a Gram matrix loses
half of the digits, so computations that need all of them (QR, increments) start from the rows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray


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
    point_at_j : shape (m,), optional
        Edges whose node j has not all of the variables, so that holding it would not stop that motion. Default: none.
    """

    edges: IntArray
    rows_i: FloatArray
    rows_j: FloatArray
    magnitude_i: FloatArray
    magnitude_j: FloatArray
    root_errors: FloatArray | None = None
    multiplicity: int = 1
    gauge_free: bool = False
    point_at_j: BoolArray | None = None

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
            point_at_j=None if self.point_at_j is None else self.point_at_j[which],
        )

    def padded(self, point_at_j: BoolArray, carrying: BoolArray | None, padding: int) -> EdgeForm:
        """With unit rows for the last variables of nodes that have none there; these couple to nothing.

        Parameters
        ----------
        point_at_j : shape (m,)
            Edges whose node j lacks the last variables; their last rows are zero.
        carrying : shape (m,), optional
            Of these, one edge for each such node: its last rows become those unit rows. None: no edge does.
        padding
            How many variables are missing.
        """
        if carrying is None or not carrying.any():
            return replace(self, point_at_j=point_at_j)
        rows_j, magnitude_j = self.rows_j.copy(), self.magnitude_j.copy()
        rows_j[carrying, -padding:, -padding:] = np.eye(padding)
        magnitude_j[carrying, -padding:] = 1.0
        return replace(self, rows_j=rows_j, magnitude_j=magnitude_j, point_at_j=point_at_j)

    def end_strengths(self) -> FloatArray:
        """Sum of squared rows at each end of each edge, all i, then all j, shape (2 m,); -inf where it cannot be held."""
        strengths = np.sum(np.concatenate([self.magnitude_i, self.magnitude_j]) ** 2, axis=1)
        if self.point_at_j is not None:
            strengths[len(self.edges) :][self.point_at_j] = -np.inf
        return strengths

    @property
    def root_error(self) -> float:
        """Sum of `root_errors`."""
        return 0.0 if self.root_errors is None else float(self.root_errors.sum())

    def strongest_node(self) -> int:
        """The node with the largest sum of squared rows: holding it leaves the best conditioned matrix."""
        if len(self.edges) == 0:
            return 0
        return int(np.argmax(np.bincount(self.edges.T.ravel(), weights=self.end_strengths())))


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
