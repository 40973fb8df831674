"""Solutions with a form that is factored in blocks along an elimination tree, many columns at once (see `elimination_paths`).

M = l l^T, so tr(A^T M^-1 A) is the squared norm of l^-1 A, a sum without cancellation; its relative error is that of `inverse`.
Columns are taken some at a time, so that what stands on one node fits into the fastest memory.
"""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.linalg.block_cholesky import solve_lower, solve_upper
from topobelief.linalg.compiled import in_parallel
from topobelief.linalg.elimination_paths import FormFactor
from topobelief.linalg.estimate import UNIT_ROUNDOFF, Estimate
from topobelief.linalg.inverse import Solutions

_COLUMNS = 64  # at a time
_OPERATIONS = 32


def inverse_trace(factor: FormFactor, nodes: IntArray, columns: FloatArray) -> Estimate[float]:
    """tr(A^T M^-1 A).

    Parameters
    ----------
    factor
    nodes : shape (t,)
        Different ones; A is zero at all others.
    columns : shape (t, b, s)
        A at these nodes.
    """
    squares = np.zeros(columns.shape[2])

    def add(first: int, last: int) -> None:
        for start in range(first, last, _COLUMNS):
            part = slice(start, min(start + _COLUMNS, last))
            half = _halves(factor, nodes, columns[:, :, part])
            squares[part] = np.einsum("nbs,nbs->s", half, half)

    in_parallel(add, _bounds(columns.shape[2]))
    return _trace(factor, float(squares.sum()))


def solutions(factor: FormFactor, nodes: IntArray, columns: FloatArray) -> Solutions:
    """M^-1 A at all nodes; parameters as for `inverse_trace`."""
    squares = np.zeros(columns.shape[2])
    values = np.zeros((factor.tree.num_nodes, *columns.shape[1:]))

    def fill(first: int, last: int) -> None:
        tree = factor.tree
        for start in range(first, last, _COLUMNS):
            part = slice(start, min(start + _COLUMNS, last))
            work = _halves(factor, nodes, columns[:, :, part])
            squares[part] = np.einsum("nbs,nbs->s", work, work)
            solve_upper(tree.start, tree.rows, factor.diagonal, factor.blocks, work)
            values[tree.order, :, part] = work

    in_parallel(fill, _bounds(columns.shape[2]))
    return Solutions(values, _trace(factor, float(squares.sum())), factor.log_det.error)


def _halves(factor: FormFactor, nodes: IntArray, columns: FloatArray) -> FloatArray:
    """l^-1 A, in order of elimination."""
    tree = factor.tree
    work = np.zeros((tree.num_free, *columns.shape[1:]))
    places = tree.position[nodes]
    work[places[places >= 0]] = columns[places >= 0]
    solve_lower(tree.start, tree.rows, factor.diagonal, factor.blocks, work)
    return work


def _trace(factor: FormFactor, value: float) -> Estimate[float]:
    error = (factor.log_det.error + _OPERATIONS * UNIT_ROUNDOFF) * value
    return Estimate(value, error) if np.isfinite(error) else Estimate(np.nan, np.inf)


def _bounds(count: int) -> list[int]:
    """Columns in whole parts, which threads share."""
    return [*range(0, count, 2 * _COLUMNS), count]
