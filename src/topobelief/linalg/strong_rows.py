"""Strong rows apart: what a few rows that are far stronger than the others do to a matrix, and how to avoid it.

Where one row has the square 1e12 and the others 1, the Gram matrix M keeps four digits of the others. So strong rows are scaled
down to the strength of the others before M is formed, and the rest is added afterwards (docs, the mathematics, section 10):

    M = M_0 + A^T A,        M_0 with f r in place of each strong row r,        A the rows sqrt(1 - f^2) r,

either by the matrix determinant lemma, ln det M = ln det M_0 + ln det (I + A M_0^-1 A^T), where the second matrix is well
conditioned once it is scaled to a unit diagonal, or by orthogonal triangles on the last nodes of a factor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from topobelief.arrays import FloatArray, IntArray
from topobelief.linalg.edge_form import EdgeForm

_STRONG = 1e6  # times the median; weaker ones cost no more digits than other roundings
_MAX_STRONG_ROWS = 200  # each costs a solution with the factor


@dataclass(frozen=True, slots=True)
class StrongRows:
    """A form whose strong rows are scaled down, and the rest of these rows.

    Attributes
    ----------
    weakened
        The form of M_0.
    edge : shape (s,)
        The edge of each strong row.
    rows_i, rows_j : shape (s, b)
        A, on the variables of the edge's two nodes.
    sizes_i, sizes_j : shape (s, b)
        Sizes of the terms behind A's entries.
    """

    weakened: EdgeForm
    edge: IntArray
    rows_i: FloatArray
    rows_j: FloatArray
    sizes_i: FloatArray
    sizes_j: FloatArray

    @staticmethod
    def of(form: EdgeForm) -> StrongRows | None:
        """Find the strong rows; None where there are none, or so many that the others are the exception."""
        squares = np.maximum(form.rows_i**2, form.rows_j**2)  # (m, r, b)
        typical = np.median(squares.max(axis=1), axis=0)
        if not (typical > 0).all():
            return None
        strengths = (squares / typical).max(axis=2)  # (m, r)
        edge, row = np.nonzero(strengths > _STRONG)
        if not (0 < len(edge) <= _MAX_STRONG_ROWS and np.isfinite(strengths).all()):
            return None
        factors = np.ones(strengths.shape)
        factors[edge, row] = 1 / np.sqrt(strengths[edge, row])
        norms = np.sqrt(np.sum(form.rows_i**2 + form.rows_j**2, axis=2))
        whole = np.linalg.norm(norms, axis=1)
        kept = (np.linalg.norm(factors * norms, axis=1) / np.where(whole > 0, whole, 1.0))[:, None]
        weakened = replace(
            form,
            rows_i=factors[..., None] * form.rows_i,
            rows_j=factors[..., None] * form.rows_j,
            magnitude_i=kept * form.magnitude_i,
            magnitude_j=kept * form.magnitude_j,
        )
        rest = np.sqrt(1 - factors[edge, row] ** 2)[:, None]
        rows_i, rows_j = rest * form.rows_i[edge, row], rest * form.rows_j[edge, row]
        share = (norms[edge, row] / np.linalg.norm(norms[edge], axis=1))[:, None]
        sizes_i, sizes_j = share * form.magnitude_i[edge], share * form.magnitude_j[edge]
        return StrongRows(weakened, edge, rows_i, rows_j, np.abs(rows_i) + sizes_i, np.abs(rows_j) + sizes_j)


def log_det_of_covariance(
    rows: FloatArray, sizes: FloatArray, solutions: FloatArray, deviations: FloatArray
) -> tuple[float, float]:
    """ln det (I + A M_0^-1 A^T), and its error by rounding in A in units of roundoff times the roundings behind a term.

    Parameters
    ----------
    rows, sizes : shape (s, n)
        A and the sizes of the terms behind its entries, on all free variables.
    solutions : shape (n, s)
        M_0^-1 A^T.
    deviations : shape (n,)
        Square root of the diagonal of M_0^-1.

    Returns
    -------
    nan and inf where the matrix is not positive definite in double precision.
    """
    covariance = rows @ solutions
    covariance = np.eye(len(covariance)) + (covariance + covariance.T) / 2
    if not np.isfinite(covariance).all() or not (np.diagonal(covariance) > 0).all():
        return math.nan, math.inf
    scale = np.sqrt(np.diagonal(covariance))
    try:
        triangle = np.linalg.cholesky(covariance / scale[:, None] / scale)
    except np.linalg.LinAlgError:
        return math.nan, math.inf
    inverse = linalg.solve_triangular(triangle, np.eye(len(scale)), lower=True)
    uncancelled = (sizes @ deviations / scale) ** 2
    log_det = 2 * float(np.sum(np.log(np.diagonal(triangle))) + np.sum(np.log(scale)))
    return log_det, float(np.sum(inverse**2, axis=0) @ (uncancelled + 1))
