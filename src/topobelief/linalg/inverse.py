"""Solutions Z = M^-1 A of several columns A with a form's matrix M, and tr(A^T M^-1 A), from scratch.

Errors: let M + E be the matrix whose factor rounding gave. Then tr(A^T (M + E)^-1 A) is off, relatively, by no more than the
spectral norm of M^-1/2 E M^-1/2. Its Frobenius norm is larger, and its square has the mean

    sum over i, j of var(E_ij) ((M^-1)_ii (M^-1)_jj + (M^-1)_ij^2),

which is what `log_det` sums to estimate the error of ln det M, since it takes sqrt((M^-1)_ii (M^-1)_jj) for |(M^-1)_ij|. So the
estimate of the error of ln det M, in nats, bounds the relative error of every trace.

Where it is too large, strong rows are taken apart and added by Woodbury's formula, and small matrices are factored by QR.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from topobelief.arrays import FloatArray, IntArray
from topobelief.linalg.edge_form import EdgeForm
from topobelief.linalg.estimate import UNIT_ROUNDOFF, Estimate
from topobelief.linalg.log_det import LogDetSolver
from topobelief.linalg.orthogonal import ScaledTriangle
from topobelief.linalg.strong_rows import StrongRows, log_det_of_covariance

_STRONG_ROWS_ERROR = 1e-4  # relative; beyond it strong rows are taken apart
_QR_ERROR = 1e-10  # relative; beyond it a QR of a small matrix is worth its time
_SMALL_QR_SIZE = 200
_LARGE_QR_ERROR = 1e-4  # beyond it one that takes seconds
_QR_SIZE = 1200
_OPERATIONS = 32  # roundings behind one term of a sum of products


def error_worth_a_qr(size: int) -> float:
    """Relative error of a trace beyond which a matrix of so many rows is factored by QR; inf where none is.

    A QR is more precise than a factor of the matrix, and slower, the more so the larger the matrix.
    """
    if size > _QR_SIZE:
        return math.inf
    return _QR_ERROR if size <= _SMALL_QR_SIZE else _LARGE_QR_ERROR


@dataclass(frozen=True, eq=False, slots=True)
class Projection:
    """Pi = I - U U^T on the first k variables of some nodes.

    Attributes
    ----------
    nodes : shape (t,)
        Different ones.
    directions : shape (t, k, u)
        U, orthonormal.
    """

    nodes: IntArray
    directions: FloatArray

    def columns(self, block_size: int) -> FloatArray:
        """Pi as columns on these nodes, shape (t, block_size, t k)."""
        count, k, num_directions = self.directions.shape
        along = self.directions.reshape(count * k, num_directions)
        columns = np.zeros((count, block_size, count * k))
        columns[:, :k] = (np.eye(count * k) - along @ along.T).reshape(count, k, count * k)
        return columns


@dataclass(frozen=True, eq=False, slots=True)
class Solutions:
    """Z = M^-1 A, and what is known of it.

    Attributes
    ----------
    values : shape (num_nodes, b, s)
        Z; zero at nodes that are held. nan where M is singular in double precision.
    trace
        tr(A^T Z).
    relative_error
        Of the trace, as far as it stems from M.
    """

    values: FloatArray
    trace: Estimate[float]
    relative_error: float


class InverseSolver:
    """Solutions for forms on one graph with one set of held nodes; ordering and symbolic factor are reused.

    Parameters
    ----------
    edges : shape (m, 2)
    num_nodes
    held
        Nodes whose rows and columns are left out.
    """

    def __init__(self, edges: IntArray, num_nodes: int, held: int | IntArray) -> None:
        self._solver = LogDetSolver(edges, num_nodes, held)
        self._free = np.ones(num_nodes, dtype=np.bool_)
        self._free[held] = False

    @np.errstate(over="ignore", divide="ignore", invalid="ignore")  # what is not finite has an infinite error
    def solve(self, form: EdgeForm, columns: FloatArray) -> Solutions:
        """M^-1 A for the matrix M of a form, its multiplicity left out.

        Parameters
        ----------
        form
        columns : shape (num_nodes, b, s)
            A; what it has at held nodes is ignored.
        """
        size = self._solver.pattern(form.block_size).size
        right = columns[self._free].reshape(size, columns.shape[2])
        if size == 0:
            return Solutions(np.zeros(columns.shape), Estimate(0.0, 0.0), 0.0)
        found = self._by_sparse_factor(form, right)
        if not found.relative_error <= _STRONG_ROWS_ERROR:
            found = min(found, self._by_strong_rows(form, right), key=_error)
        if not found.relative_error <= error_worth_a_qr(size):
            found = min(found, self._by_qr(form, right), key=_error)
        values = np.zeros(columns.shape)
        values[self._free] = found.values.reshape(-1, *columns.shape[1:])
        return Solutions(values, found.trace, found.relative_error)

    def _by_sparse_factor(self, form: EdgeForm, right: FloatArray) -> Solutions:
        factor = self._solver.factor(form)
        if factor is None:
            return _unknown(right)
        values = np.stack([np.asarray(factor.solve(column)) for column in right.T], axis=1) if right.size else right
        return _solutions(values, right, factor.log_det.error)

    def _by_strong_rows(self, form: EdgeForm, right: FloatArray) -> Solutions:
        """Z = Z_0 - M_0^-1 R^T (I + R M_0^-1 R^T)^-1 R Z_0, R what the strong rows lack in M_0."""
        pattern, strong = self._solver.pattern(form.block_size), StrongRows.of(form)
        others = None if strong is None else self._solver.factor(strong.weakened)
        if strong is None or others is None:
            return _unknown(right)
        rows = pattern.scattered(strong.edge, strong.rows_i, strong.rows_j)
        sizes = pattern.scattered(strong.edge, strong.sizes_i, strong.sizes_j)
        both = np.concatenate([rows.T, right], axis=1)
        solved = np.stack([np.asarray(others.solve(column)) for column in both.T], axis=1)
        at_rows, values = solved[:, : len(rows)], solved[:, len(rows) :]
        _, error = log_det_of_covariance(rows, sizes, at_rows, np.sqrt(others.variances))
        try:
            root = np.linalg.cholesky(np.eye(len(rows)) + rows @ at_rows)
        except np.linalg.LinAlgError:
            return _unknown(right)
        half = linalg.solve_triangular(root, rows @ values, lower=True)
        before = _solutions(values, right, 2 * others.log_det.error + _OPERATIONS * UNIT_ROUNDOFF * error)
        taken = float(np.sum(half**2))
        trace = before.trace.value - taken
        after = values - at_rows @ linalg.solve_triangular(root, half, lower=True, trans="T")
        relative = before.relative_error * (before.trace.value + taken) / trace if trace > 0 else np.inf
        return _finite(Solutions(after, Estimate(trace, before.trace.error + relative * abs(trace)), relative))

    def _by_qr(self, form: EdgeForm, right: FloatArray) -> Solutions:
        pattern = self._solver.pattern(form.block_size)
        triangle = ScaledTriangle.of(pattern.dense_rows(form), np.sqrt(pattern.magnitude(form)))
        if triangle is None:
            return _unknown(right)
        halves = triangle.half_solutions(right)
        relative = UNIT_ROUNDOFF * triangle.error + form.root_error
        trace = float(np.sum(halves**2))
        return _finite(Solutions(triangle.solutions(halves), Estimate(trace, relative * trace), relative))


def _solutions(values: FloatArray, right: FloatArray, relative_error: float) -> Solutions:
    """With the trace, whose terms may cancel."""
    products = values * right
    trace = float(np.sum(products))
    rounding = _OPERATIONS * UNIT_ROUNDOFF * float(np.sum(np.abs(products)))
    return _finite(Solutions(values, Estimate(trace, relative_error * abs(trace) + rounding), relative_error))


def _finite(found: Solutions) -> Solutions:
    return found if np.isfinite(found.trace.value) and np.isfinite(found.trace.error) else _unknown(found.values)


def _unknown(like: FloatArray) -> Solutions:
    return Solutions(np.full(like.shape, np.nan), Estimate(np.nan, np.inf), np.inf)


def _error(found: Solutions) -> float:
    return found.trace.error
