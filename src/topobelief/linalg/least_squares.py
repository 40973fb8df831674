"""Sparse linear least squares on a graph: min over x of the sum over edges (i, j) of |R_i x_i + R_j x_j + r|^2.

Some nodes are held at x = 0. The normal equations are factored as L D L^T (qdldl); ordering and symbolic factor are
reused from one solution to the next, as Gauss-Newton iterations need it.
"""

from __future__ import annotations

import math
from typing import Any, cast

import numpy as np
import qdldl

from topobelief.arrays import FloatArray, IntArray
from topobelief.linalg.block_pattern import BlockPattern
from topobelief.linalg.edge_form import EdgeForm


class LeastSquaresSolver:
    """Least squares on one graph with one set of held nodes.

    Parameters
    ----------
    edges : shape (m, 2)
    num_nodes
        n.
    block_size
        b, variables per node.
    held
        Nodes that stay at zero.
    """

    def __init__(self, edges: IntArray, num_nodes: int, block_size: int, held: int | IntArray) -> None:
        self._edges = edges
        self._free = np.ones(num_nodes, dtype=np.bool_)
        self._free[held] = False
        self._pattern = BlockPattern.build(edges, self._free, block_size)
        self._factor: Any = None

    def solve(self, rows_i: FloatArray, rows_j: FloatArray, residuals: FloatArray) -> tuple[FloatArray, float]:
        """The minimiser, and how much it lowers the sum of squares from what it is at x = 0.

        Parameters
        ----------
        rows_i, rows_j : shape (m, r, b)
            R_i and R_j, whitened.
        residuals : shape (m, r) or (m, r, s)
            r; s right-hand sides share one factor.

        Returns
        -------
        x : shape (n, b) or (n, b, s)
            Zero at held nodes.
        decrease
            g^T M^-1 g with M x = -g the normal equations: the squared distance that x moves, in standard deviations. nan where
            M is singular to double precision.
        """
        unused = np.zeros((len(self._edges), rows_i.shape[2]))
        form = EdgeForm(self._edges, rows_i, rows_j, unused, unused)
        shape = (len(self._free), rows_i.shape[2], *residuals.shape[2:])
        if self._pattern.size == 0:
            return np.zeros(shape), 0.0
        gradients = self._pattern.rows_transposed_times(form, residuals.reshape(*residuals.shape[:2], -1))
        try:
            self._refactor(form)
        except RuntimeError:  # a zero pivot
            return np.zeros(shape), math.nan
        steps = np.stack([-np.asarray(self._factor.solve(gradient)) for gradient in gradients.T], axis=1)
        solution = np.zeros(shape)
        solution[self._free] = steps.reshape(-1, *shape[1:])
        return solution, -float(np.sum(gradients * steps))

    def _refactor(self, form: EdgeForm) -> None:
        upper = self._pattern.upper(form)
        if self._factor is None:
            self._factor = cast(Any, qdldl).Solver(upper, upper=True)
        else:
            self._factor.update(upper, upper=True)
