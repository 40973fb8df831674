"""Determinants of one part of a form's matrix after the other part has been moved along with it.

With the variables of each node in two parts, p and r, M = [[M_pp, M_pr], [M_rp, M_rr]], the change p -> p + N r has determinant
one, so that by Fischer's inequality

    ln det M  <=  ln det M_pp + ln det (M_rr + N^T M_pr + M_rp N + N^T M_pp N)        for any N.

Here N = -step D^-1 M_pr with D the block diagonal of M_pp, one step of block Jacobi towards the best N = -M_pp^-1 M_pr.
The matrix is the Gram matrix of R_r + R_p N, R the form's rows, and is formed so.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import qdldl
from scipy import sparse

from topobelief.arrays import FloatArray, IntArray
from topobelief.linalg.edge_form import EdgeForm
from topobelief.linalg.estimate import UNIT_ROUNDOFF, Estimate
from topobelief.linalg.log_det import factor_error, factor_parts, random_signs

_QDLDL: Any = qdldl  # ships no types
_NUM_PROBES = 8
_PROBE_SAFETY = 2.0
_OPERATIONS = 16
_UNKNOWN = Estimate(math.nan, math.inf)


@np.errstate(over="ignore", divide="ignore", invalid="ignore")  # what is not finite has an infinite error
def sheared_log_det(
    form: EdgeForm, first: int, num_nodes: int, held: int, step: float, *, hadamard: bool = False
) -> Estimate[float]:
    """ln det of the second part after one step of `step`.

    Parameters
    ----------
    form
    first
        Variables of a node that make the first part, p.
    num_nodes, held
        The node `held` is left out.
    step
        From 0 (Fischer's inequality itself) to 1; never looser than Fischer's, since M_pp <= 2 D.
    hadamard
        The sum of ln det of the diagonal blocks of M_rr - 2 step (1 - step) M_rp D^-1 M_pr in place of the determinant: larger,
        and O(number of edges).
    """
    if num_nodes == 1:
        return Estimate(0.0, 0.0)
    rows = _sparse_rows(form, num_nodes, held)
    b = form.block_size
    variable = np.arange(rows.shape[1]) % b
    rows_p, rows_r = rows[:, variable < first], rows[:, variable >= first]
    roots = _diagonal_roots(rows_p, first)
    if roots is None:
        return _UNKNOWN
    coupled = sparse.csr_array(roots @ (rows_p.T @ rows_r))  # C^-1 M_pr with D = C C^T
    if hadamard:
        return _blockwise(rows_r, coupled, 2 * step * (1 - step), b - first, form.root_error)
    moved = sparse.csc_array(rows_r - step * (rows_p @ (roots.T @ coupled)))
    size = sparse.csc_array(abs(rows_r) + step * (abs(rows_p) @ (abs(roots).T @ abs(coupled))))
    magnitude: FloatArray = np.asarray(size.power(2).sum(axis=0), dtype=np.float64)
    return _gram_log_det(moved, magnitude, b - first, form.root_error)


def moved_rotations(form: EdgeForm, first: int, positions: FloatArray) -> FloatArray:
    """M_rp X, shape (num_nodes, b - first, s), for displacements X of the first part, shape (num_nodes, first, s)."""
    num_nodes, _, count = positions.shape
    rows = _sparse_rows(form, num_nodes)
    variable = np.arange(rows.shape[1]) % form.block_size
    residuals = rows[:, variable < first] @ positions.reshape(num_nodes * first, count)
    return np.asarray(rows[:, variable >= first].T @ residuals, dtype=np.float64).reshape(num_nodes, -1, count)


def _sparse_rows(form: EdgeForm, num_nodes: int, held: int | None = None) -> sparse.csc_array:
    """All rows on the variables of the free nodes."""
    m, r, b = form.rows_i.shape
    variables: IntArray = b * form.edges.T[:, :, None, None] + np.arange(b, dtype=np.int64)  # ends, edges, 1, b
    column = np.broadcast_to(variables, (2, m, r, b))
    row = np.broadcast_to(np.arange(m * r, dtype=np.int64).reshape(m, r, 1), (2, m, r, b))
    values = np.stack([form.rows_i, form.rows_j])
    matrix = sparse.csc_array((values.ravel(), (row.ravel(), column.ravel())), shape=(m * r, num_nodes * b))
    return matrix[:, np.arange(num_nodes * b) // b != held]


def _diagonal_roots(rows: sparse.csc_array, size: int) -> sparse.csr_array | None:
    """C^-1, block diagonal, where C C^T are the diagonal blocks of the rows' Gram matrix; None where one is singular."""
    try:
        inverse = np.linalg.inv(np.linalg.cholesky(_diagonal_blocks(rows, size)))
    except np.linalg.LinAlgError:
        return None
    blocks = sparse.bsr_array((inverse, np.arange(len(inverse)), np.arange(len(inverse) + 1)))
    return sparse.csr_array(blocks)


def _diagonal_blocks(rows: sparse.csc_array | sparse.csr_array, size: int) -> FloatArray:
    """Diagonal blocks of rows^T rows, shape (number of blocks, size, size)."""
    columns = [sparse.csc_array(rows[:, np.arange(c, rows.shape[1], size)]) for c in range(size)]
    blocks = np.empty((rows.shape[1] // size, size, size))
    for c in range(size):
        for d in range(c + 1):
            blocks[:, c, d] = blocks[:, d, c] = columns[c].multiply(columns[d]).sum(axis=0)
    return blocks


def _blockwise(
    rows: sparse.csc_array, coupled: sparse.csr_array, factor: float, size: int, root_error: float
) -> Estimate[float]:
    """Sum of ln det of the diagonal blocks of rows^T rows - factor coupled^T coupled."""
    whole, taken = _diagonal_blocks(rows, size), factor * _diagonal_blocks(coupled, size)
    blocks = whole - taken
    scale = np.sqrt(np.diagonal(blocks, axis1=1, axis2=2))
    scaled = blocks / (scale[:, :, None] * scale[:, None, :])
    log_dets = np.linalg.slogdet(scaled)[1] + 2 * np.log(scale).sum(axis=1)
    if not np.isfinite(log_dets).all():
        return _UNKNOWN
    ratio = np.diagonal(whole + taken, axis1=1, axis2=2) / scale**2
    condition = np.linalg.cond(scaled, "fro") * ratio.max(axis=1)
    error = UNIT_ROUNDOFF * float(_OPERATIONS * size * condition.sum() + np.abs(log_dets).sum()) + root_error
    return Estimate(math.fsum(log_dets), error) if math.isfinite(error) else _UNKNOWN


def _gram_log_det(rows: sparse.csc_array, magnitude: FloatArray, size: int, root_error: float) -> Estimate[float]:
    """ln det (rows^T rows) by sparse L D L^T, with `log_det`'s estimate of its error."""
    upper = sparse.csc_array(sparse.triu(rows.T @ rows))
    try:
        factor = _QDLDL.Solver(upper, upper=True)
    except RuntimeError:  # a zero pivot
        return _UNKNOWN
    lower, pivots, order = factor_parts(factor)
    if not (pivots > 0).all():
        return _UNKNOWN
    signs = random_signs(np.random.default_rng(0), (rows.shape[0], _NUM_PROBES))
    samples: FloatArray = rows.T @ signs  # pyright: ignore[reportAssignmentType]  (dense: the stubs allow more)
    variances = _PROBE_SAFETY / _NUM_PROBES * np.sum([factor.solve(sample) ** 2 for sample in samples.T], axis=0)
    log_pivots = np.log(pivots)
    error = factor_error(upper, lower, order, magnitude, variances, size)
    error = UNIT_ROUNDOFF * (error + float(np.abs(log_pivots).sum())) + root_error
    return Estimate(math.fsum(log_pivots), error) if math.isfinite(error) else _UNKNOWN
