"""Log-determinants of quadratic forms on graphs, each with an estimate of its own rounding error.

Sparse L D L^T (qdldl) of the Gram matrix M serves almost every graph. It squares the condition number, so its error is
estimated to first order: the computed factor is that of M + E, and ln det moves by tr(M^-1 E). With u the unit roundoff,
E has two parts: from the factorisation, entries on the factor's pattern of u sqrt(n_ij M_ii M_jj), n_ij operations being
behind each (Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., theorem 10.3, with independent roundings as in
Higham and Mary, SIAM J. Sci. Comput. 41, 2019); from the assembly, entries on the matrix's pattern of
u sqrt(B_i B_j), B the magnitude of the terms added. |(M^-1)_ij| <= v_i v_j with v^2 = diag M^-1, exact on small matrices and
sampled on large ones (M^-1 R^T z has covariance M^-1 for random signs z). Where roundings repeat themselves, as on graphs
whose edges are all equal, they add up instead of averaging out; the sums of M_ii v_i^2 and B_i v_i^2 stand for that.

Where the estimate is too large, what can be had without a factor is taken apart first, and the smallest estimate wins: the
graph falls into its blocks, bridges among them, if the form allows it (`blocks`); rows that are far stronger than the others
are added afterwards (`strong_rows`); and Householder QR of the rows themselves, which does not square the condition number,
serves what is small enough for a dense matrix.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import qdldl
from scipy import sparse

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.linalg.block_pattern import BlockPattern
from topobelief.linalg.blocks import CutGraph
from topobelief.linalg.edge_form import EdgeForm
from topobelief.linalg.estimate import UNIT_ROUNDOFF, Estimate
from topobelief.linalg.orthogonal import ASSEMBLY_OPERATIONS, log_det_by_qr, log_dets_of_squares
from topobelief.linalg.strong_rows import StrongRows, log_det_of_covariance

_QDLDL: Any = qdldl  # ships no types
_EXACT_VARIANCE_SIZE = 200  # up to here the variances of the error estimate are exact
_NUM_PROBES = 8
_PROBE_SAFETY = 2.0  # eight probes underestimate one variance by more than this in few cases, a sum of them in fewer
_CONFIDENCE = 4.0  # standard deviations of the rounding error that the estimate covers
_SMALL_ERROR = 1e-6  # nats; below it one more factorisation would not be seen
_WHOLE_SHARE = 0.9  # of the edges: a block with more is as good as the graph
_LARGE_ERROR = 1e-4  # nats; beyond it solutions for strong rows are worth their time, and a QR that takes seconds
_SMALL_RELATIVE_ERROR = 1e-8  # beyond it a QR that takes milliseconds is worth its time
_SMALL_QR_SIZE = 200
_QR_SIZE = 1200
_SMALL_NODE_ERROR = 1e-8  # nats; beyond it the QR of a node's rows is worth its time
_OPERATIONS = 32  # roundings behind one term of the covariance of strong rows


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
        self._cut: CutGraph | None = None

    @property
    def num_free(self) -> int:
        """Nodes that are not held."""
        return int(self._free.sum())

    @_may_overflow
    def log_det(self, form: EdgeForm, *, shift: float = 0.0) -> Estimate[float]:
        """ln det of the form's matrix plus `shift` times I, on the free nodes.

        0 where there are no free nodes; error inf where the factorisation breaks down.
        """
        if self.pattern(form.block_size).size == 0:
            return Estimate(0.0, 0.0)
        result, blocks = self._by_sparse_factors(form, shift), None
        if result.error > _SMALL_ERROR and form.gauge_free and not shift:
            blocks = self._by_blocks(form)
        result = self._or_by_qr(result, form, shift) if blocks is None else _better(result, blocks)
        return form.multiplicity * result

    @_may_overflow
    def hadamard(self, form: EdgeForm, *, shift: float = 0.0) -> Estimate[float]:
        """Sum of ln det of the diagonal blocks, an upper bound of `log_det` (Hadamard and Fischer)."""
        pattern = self.pattern(form.block_size)
        if pattern.size == 0:
            return Estimate(0.0, 0.0)
        blocks = pattern.diagonal_blocks(form) + shift * np.eye(form.block_size)
        scale = np.sqrt(np.diagonal(blocks, axis1=1, axis2=2))
        scaled = blocks / (scale[:, :, None] * scale[:, None, :])
        values = np.linalg.slogdet(scaled)[1] + 2 * np.log(scale).sum(axis=1)
        ratio = pattern.magnitude(form).reshape(scale.shape) / scale**2
        condition = np.linalg.cond(scaled, "fro") * ratio.max(axis=1)
        errors = UNIT_ROUNDOFF * (ASSEMBLY_OPERATIONS * form.block_size * condition + np.abs(values))
        known = np.isfinite(values) & np.isfinite(errors)
        values, errors = np.where(known, values, np.nan), np.where(known, errors, np.inf)
        root_error = 0.0  # rows know nothing of it
        for node in np.flatnonzero(errors > _SMALL_NODE_ERROR).tolist():
            better = _by_qr(*pattern.rows_at(form, node), shift)
            if better.error < errors[node]:
                values[node], errors[node] = better.value, better.error
                root_error = 2 * form.root_error  # an edge is seen at both ends
        return form.multiplicity * _finite(Estimate(math.fsum(values), float(errors.sum()) + root_error))

    def pattern(self, block_size: int) -> BlockPattern:
        """Where the blocks of the free nodes go."""
        if block_size not in self._patterns:
            self._patterns[block_size] = BlockPattern.build(self._edges, self._free, block_size)
        return self._patterns[block_size]

    def _by_sparse_factors(self, form: EdgeForm, shift: float) -> Estimate[float]:
        """By one factor, and with strong rows apart where the error makes that worth its time."""
        factor = self.factor(form, shift)
        known = _UNKNOWN if factor is None else factor.log_det
        return known if known.error <= _LARGE_ERROR else _better(known, self._by_strong_rows(form, shift))

    def _by_blocks(self, form: EdgeForm) -> Estimate[float] | None:
        """The sum over the blocks of the graph, the strongest node of each held where there is a choice.

        None where the graph is hardly more than one block that holds the same node.
        """
        if self._cut is None:
            self._cut = CutGraph.of(self._edges, self._free)
        cut = self._cut
        if not cut.is_grounded:
            return _UNKNOWN
        held = cut.held_nodes(form)
        largest = np.argmax(np.bincount(cut.block_of_node))
        if cut.node[held[largest]] == len(self._free) and np.mean(cut.block_of_edge == largest) > _WHOLE_SHARE:
            return None
        rows = replace(form.between(cut.kept, cut.edges), root_errors=None)
        apart = cut.is_bridge & (form.rows_i.shape[1] == form.block_size)
        value, error = log_dets_of_squares(*_rows_at_free_ends(rows, held[cut.block_of_edge], apart))
        total = Estimate(value, UNIT_ROUNDOFF * error + form.root_error)
        rest = np.flatnonzero(~apart)
        if len(rest) == 0:
            return _finite(total)
        solver, part = _part(rows, rest, held)
        known = solver._by_sparse_factors(part, 0.0)
        if known.error > _SMALL_ERROR:
            known = Estimate(0.0, 0.0)
            for block in np.split(rest, _changes(cut.block_of_edge[rest])):
                solver, part = _part(rows, block, held)
                known += solver._or_by_qr(solver._by_sparse_factors(part, 0.0), part, 0.0)
        return _finite(total.plus(known.value) + Estimate(0.0, known.error))

    def _or_by_qr(self, known: Estimate[float], form: EdgeForm, shift: float) -> Estimate[float]:
        """`known`, or what is known better by QR, as far as the error makes that worth its time."""
        pattern = self.pattern(form.block_size)
        limit = _LARGE_ERROR
        if pattern.size <= _SMALL_QR_SIZE:
            limit = _SMALL_RELATIVE_ERROR * max(1.0, abs(known.value))
        if pattern.size <= _QR_SIZE and not known.error <= limit:
            by_qr = _by_qr(pattern.dense_rows(form), pattern.magnitude(form), shift)
            known = _better(known, Estimate(by_qr.value, by_qr.error + form.root_error))
        return known

    def _by_strong_rows(self, form: EdgeForm, shift: float) -> Estimate[float]:
        """The other rows factored, the strong ones added to that."""
        pattern, strong = self.pattern(form.block_size), StrongRows.of(form)
        others = None if strong is None else self.factor(strong.weakened, shift)
        if strong is None or others is None:
            return _UNKNOWN
        rows = pattern.scattered(strong.edge, strong.rows_i, strong.rows_j)
        sizes = pattern.scattered(strong.edge, strong.sizes_i, strong.sizes_j)
        solutions = np.stack([others.solve(row) for row in rows], axis=1)
        value, error = log_det_of_covariance(rows, sizes, solutions, np.sqrt(others.variances))
        error = UNIT_ROUNDOFF * (_OPERATIONS * error + abs(value))
        return _finite(Estimate(others.log_det.value + value, 2 * others.log_det.error + error))

    def factor(self, form: EdgeForm, shift: float = 0.0) -> Factor | None:
        """L D L^T of the form's matrix; None where a pivot is not positive, or nothing is known of the error."""
        pattern = self.pattern(form.block_size)
        upper = pattern.upper(form, shift=shift)
        try:
            if pattern.block_size in self._factors:
                self._factors[pattern.block_size].update(upper, upper=True)
            else:
                self._factors[pattern.block_size] = _QDLDL.Solver(upper, upper=True)
        except RuntimeError:  # a zero pivot
            self._factors.pop(pattern.block_size, None)
            return None
        factor = self._factors[pattern.block_size]
        lower, pivots, order = factor_parts(factor)
        if not (pivots > 0).all():
            return None
        log_pivots = np.log(pivots)
        variances = _variances(factor, form, pattern, shift)
        error = factor_error(upper, lower, order, pattern.magnitude(form), variances, form.block_size)
        error = UNIT_ROUNDOFF * (error + float(np.abs(log_pivots).sum())) + form.root_error
        return Factor(Estimate(math.fsum(log_pivots), error), variances, factor.solve) if math.isfinite(error) else None


@dataclass(frozen=True, slots=True)
class Factor:
    """What is known of a factored matrix M."""

    log_det: Estimate[float]
    variances: FloatArray  # diag M^-1, estimated
    solve: Callable[[FloatArray], FloatArray]  # until the solver factors another matrix


def _better(first: Estimate[float], second: Estimate[float]) -> Estimate[float]:
    return min(first, second, key=lambda candidate: candidate.error)


def _finite(estimate: Estimate[float]) -> Estimate[float]:
    return estimate if math.isfinite(estimate.value) and math.isfinite(estimate.error) else _UNKNOWN


def _by_qr(rows: FloatArray, magnitudes: FloatArray, shift: float) -> Estimate[float]:
    """ln det (R^T R + shift I), `magnitudes` the squared sizes of the terms behind each column."""
    if shift:
        rows = np.concatenate([rows, math.sqrt(shift) * np.eye(rows.shape[1])])
    value, error = log_det_by_qr(rows, np.sqrt(magnitudes))
    return _finite(Estimate(value, UNIT_ROUNDOFF * error))


def _rows_at_free_ends(form: EdgeForm, held: IntArray, which: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Rows and magnitudes of some edges at their ends that are not held; `held`, shape (m,), has the node that is."""
    at_i = (form.edges[:, 1] == held)[which]
    rows = np.where(at_i[:, None, None], form.rows_i[which], form.rows_j[which])
    return rows, np.where(at_i[:, None], form.magnitude_i[which], form.magnitude_j[which])


def _part(form: EdgeForm, which: IntArray, held: IntArray) -> tuple[LogDetSolver, EdgeForm]:
    """A form of some edges alone, its nodes numbered anew, and its solver."""
    nodes, edges = np.unique(form.edges[which], return_inverse=True)
    edges = edges.reshape(-1, 2)
    return LogDetSolver(edges, len(nodes), np.flatnonzero(np.isin(nodes, held))), form.between(which, edges)


def _changes(values: IntArray) -> IntArray:
    """Places at which a sorted array takes another value."""
    return np.flatnonzero(np.diff(values)) + 1


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
    squares += ASSEMBLY_OPERATIONS * block_size * 2 * float(assembled @ coupled)
    return 2 * float(factored.sum() + assembled.sum()) + _CONFIDENCE * math.sqrt(2 * squares)
