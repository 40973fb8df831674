"""Log-determinants of quadratic forms on graphs, each with an estimate of its own rounding error.

Sparse L D L^T (qdldl) of the Gram matrix M serves almost every graph. It squares the condition number, so its error is
estimated to first order: the computed factor is that of M + E, and ln det moves by tr(M^-1 E). With u the unit roundoff,
E has two parts: from the factorisation, entries on the factor's pattern of u sqrt(n_ij M_ii M_jj), n_ij operations being
behind each (Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., theorem 10.3, with independent roundings as in
Higham and Mary, SIAM J. Sci. Comput. 41, 2019); from the assembly, entries on the matrix's pattern of
u sqrt(B_i B_j), B the magnitude of the terms added. |(M^-1)_ij| <= v_i v_j with v^2 = diag M^-1, exact on small matrices and
sampled on large ones (M^-1 R^T z has covariance M^-1 for random signs z). Where roundings repeat themselves, as on graphs
whose edges are all equal, they add up instead of averaging out; the sums of M_ii v_i^2 and B_i v_i^2 stand for that.

Where the estimate is too large, Householder QR of the rows themselves takes over on graphs that are small enough for a
dense matrix: it does not square the condition number.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import qdldl
from scipy import linalg, sparse

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.linalg.block_pattern import BlockPattern
from topobelief.linalg.edge_form import EdgeForm
from topobelief.linalg.estimate import UNIT_ROUNDOFF, Estimate

_QDLDL: Any = qdldl  # ships no types
_EXACT_VARIANCE_SIZE = 200  # up to here the variances of the error estimate are exact
_NUM_PROBES = 8
_PROBE_SAFETY = 2.0  # eight probes underestimate one variance by more than this in few cases, a sum of them in fewer
_CONFIDENCE = 4.0  # standard deviations of the rounding error that the estimate covers
_QR_SIZE = 1200  # up to here a dense QR takes a fraction of a second
_QR_RELATIVE_ERROR = 1e-8  # beyond it the QR is worth its time
_HOLD_STRONGEST_ERROR = 1e-6  # nats; below it one more factorisation would not be seen
_ASSEMBLY_OPERATIONS = 16  # roundings behind one term of a block


_UNKNOWN = Estimate(math.nan, math.inf)
_may_overflow = np.errstate(over="ignore", divide="ignore", invalid="ignore")  # what is not finite has an infinite error


class LogDetSolver:
    """Log-determinants of forms on one graph with one set of held nodes; ordering and symbolic factor are reused.

    Parameters
    ----------
    edges : shape (m, 2)
    num_nodes
    held
        Nodes whose rows and columns are left out (the anchor; or all poses that exist already).
    """

    def __init__(self, edges: IntArray, num_nodes: int, held: int | IntArray) -> None:
        self._edges = edges
        self._free: BoolArray = np.ones(num_nodes, dtype=np.bool_)
        self._free[held] = False
        self._patterns: dict[int, BlockPattern] = {}
        self._factors: dict[int, Any] = {}

    @property
    def num_free(self) -> int:
        """Nodes that are not held."""
        return int(self._free.sum())

    @_may_overflow
    def log_det(self, form: EdgeForm, *, shift: float = 0.0) -> Estimate[float]:
        """ln det of the form's matrix plus `shift` times I, on the free nodes.

        0 where there are no free nodes; error inf where the factorisation breaks down.
        """
        pattern = self._pattern(form.block_size)
        if pattern.size == 0:
            return Estimate(0.0, 0.0)
        result = self._by_factor(form, pattern, shift)
        if result.error > _QR_RELATIVE_ERROR * max(1.0, abs(result.value)) and pattern.size <= _QR_SIZE:
            result = min(result, _by_qr(form, pattern, shift), key=lambda candidate: candidate.error)
        return form.multiplicity * result

    def gauge_free_log_det(self, form: EdgeForm) -> Estimate[float]:
        """ln det of a form for which it does not matter which one node is held (docs, the mathematics, section 4).

        Where rounding matters, the node with the strongest rows is held instead of the solver's.
        """
        here = self.log_det(form)
        if here.error <= _HOLD_STRONGEST_ERROR:
            return here
        elsewhere = LogDetSolver(self._edges, len(self._free), form.strongest_node()).log_det(form)
        return min(here, elsewhere, key=lambda candidate: candidate.error)

    @_may_overflow
    def hadamard(self, form: EdgeForm, *, shift: float = 0.0) -> Estimate[float]:
        """Sum of ln det of the diagonal blocks, an upper bound of `log_det` (Hadamard and Fischer)."""
        pattern = self._pattern(form.block_size)
        if pattern.size == 0:
            return Estimate(0.0, 0.0)
        blocks = pattern.diagonal_blocks(form) + shift * np.eye(form.block_size)
        scale = np.sqrt(np.diagonal(blocks, axis1=1, axis2=2))
        scaled = blocks / (scale[:, :, None] * scale[:, None, :])
        log_dets = np.linalg.slogdet(scaled)[1] + 2 * np.log(scale).sum(axis=1)
        if not np.isfinite(log_dets).all():  # a block is singular in double precision
            return _UNKNOWN
        value = math.fsum(log_dets)
        ratio = pattern.magnitude(form).reshape(scale.shape) / scale**2
        condition = np.linalg.cond(scaled, "fro") * ratio.max(axis=1)
        error = UNIT_ROUNDOFF * float(_ASSEMBLY_OPERATIONS * form.block_size * condition.sum() + np.abs(log_dets).sum())
        return form.multiplicity * (Estimate(value, error) if math.isfinite(error) else _UNKNOWN)

    def _pattern(self, block_size: int) -> BlockPattern:
        if block_size not in self._patterns:
            self._patterns[block_size] = BlockPattern.build(self._edges, self._free, block_size)
        return self._patterns[block_size]

    def _by_factor(self, form: EdgeForm, pattern: BlockPattern, shift: float) -> Estimate[float]:
        upper = pattern.upper(form, shift=shift)
        try:
            if pattern.block_size in self._factors:
                self._factors[pattern.block_size].update(upper, upper=True)
            else:
                self._factors[pattern.block_size] = _QDLDL.Solver(upper, upper=True)
        except RuntimeError:  # a zero pivot
            self._factors.pop(pattern.block_size, None)
            return _UNKNOWN
        factor = self._factors[pattern.block_size]
        lower, pivots, order = factor_parts(factor)
        if not (pivots > 0).all():
            return _UNKNOWN
        log_pivots = np.log(pivots)
        variances = _variances(factor, form, pattern, shift)
        error = factor_error(upper, lower, order, pattern.magnitude(form), variances, form.block_size)
        error = UNIT_ROUNDOFF * (error + float(np.abs(log_pivots).sum())) + form.root_error
        return Estimate(math.fsum(log_pivots), error) if math.isfinite(error) else _UNKNOWN


def factor_parts(factor: Any) -> tuple[sparse.csc_array, FloatArray, IntArray]:
    """Strict lower triangle, pivots, and the order in which variables were eliminated."""
    lower, pivots, order = factor.factors()
    return sparse.csc_array(lower), np.asarray(pivots), np.asarray(order, dtype=np.int64)


def _variances(factor: Any, form: EdgeForm, pattern: BlockPattern, shift: float) -> FloatArray:
    """diag M^-1: exact for small matrices, else from samples of covariance M^-1, with a safety factor."""
    if pattern.size <= _EXACT_VARIANCE_SIZE:
        return np.array([factor.solve(unit)[i] for i, unit in enumerate(np.eye(pattern.size))])
    rng = np.random.default_rng(0)
    num_edges, num_rows, _ = form.rows_i.shape
    samples = pattern.rows_transposed_times(form, random_signs(rng, (num_edges, num_rows, _NUM_PROBES)))
    if shift:
        samples += math.sqrt(shift) * random_signs(rng, samples.shape)
    squares = np.zeros(pattern.size)
    for sample in samples.T:
        squares += factor.solve(sample) ** 2
    return _PROBE_SAFETY / _NUM_PROBES * squares


def random_signs(rng: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
    return np.where(rng.integers(2, size=shape, dtype=np.int8), 1.0, -1.0)


def factor_error(
    upper: sparse.csc_array,
    lower: sparse.csc_array,
    order: IntArray,
    magnitude: FloatArray,
    variances: FloatArray,
    block_size: int,
) -> float:
    """Error of ln det in units of roundoff: the module's estimate, sums for the repeating part, squares for the rest."""
    factored = upper.diagonal() * variances  # M_ii v_i^2
    assembled = magnitude * variances  # B_i v_i^2
    ordered = factored[order]
    structure = sparse.csc_array((np.ones(lower.nnz), lower.indices, lower.indptr), shape=lower.shape)
    operations = np.bincount(lower.indices, minlength=len(ordered)) + 2
    squares = float((operations * ordered) @ (2 * (structure @ ordered) + ordered))
    pattern = sparse.csc_array((np.ones(upper.nnz), upper.indices, upper.indptr), shape=upper.shape)
    coupled: FloatArray = pattern @ assembled  # pyright: ignore[reportAssignmentType]  (a vector: the stubs allow more)
    squares += _ASSEMBLY_OPERATIONS * block_size * 2 * float(assembled @ coupled)
    return 2 * float(factored.sum() + assembled.sum()) + _CONFIDENCE * math.sqrt(2 * squares)


def _by_qr(form: EdgeForm, pattern: BlockPattern, shift: float) -> Estimate[float]:
    """2 ln |det R| of the rows, columns scaled to unit norm, largest rows first, columns pivoted."""
    rows = pattern.dense_rows(form)
    if shift:
        rows = np.concatenate([rows, math.sqrt(shift) * np.eye(pattern.size)])
    if len(rows) < pattern.size or not np.isfinite(rows).all():
        return _UNKNOWN
    norms = np.linalg.norm(rows, axis=0)
    if not (norms > 0).all():
        return _UNKNOWN
    scaled = rows / norms
    scaled = scaled[np.argsort(-np.abs(scaled).max(axis=1), kind="stable")]
    triangle, permutation = _pivoted_qr(scaled)
    diagonal = np.abs(np.diagonal(triangle))
    if diagonal.min() <= UNIT_ROUNDOFF:
        return _UNKNOWN
    inverse = linalg.solve_triangular(triangle, np.eye(pattern.size))
    standard_deviations = np.empty(pattern.size)
    standard_deviations[permutation] = np.linalg.norm(inverse, axis=1)
    ratio = np.sqrt(pattern.magnitude(form)) / norms
    relative = math.sqrt(pattern.size) + _ASSEMBLY_OPERATIONS * ratio
    log_diagonal = np.log(diagonal)
    value = 2 * (math.fsum(log_diagonal) + math.fsum(np.log(norms)))
    error = 2 * UNIT_ROUNDOFF * float(relative @ standard_deviations + np.abs(log_diagonal).sum() + np.abs(np.log(norms)).sum())
    return Estimate(value, error + form.root_error)


def _pivoted_qr(matrix: FloatArray) -> tuple[FloatArray, IntArray]:
    parts: Any = linalg.qr(matrix, mode="r", pivoting=True)
    triangle, permutation = parts
    return triangle[: matrix.shape[1]], permutation
