"""ln det of Gram matrices from their rows, small and dense, without forming them: the condition number is not squared.

Errors are in units of roundoff, to first order: where rows are off by E, ln det (R^T R) moves by 2 tr(R^+ E), and the norm of
the c-th row of R^+ is the standard deviation of variable c.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import linalg

from topobelief.arrays import FloatArray, IntArray
from topobelief.linalg.estimate import UNIT_ROUNDOFF

ASSEMBLY_OPERATIONS = 16  # roundings behind one term of a row


@dataclass(frozen=True, slots=True)
class ScaledTriangle:
    """R^T R of rows whose columns are scaled to unit norm and permuted.

    Attributes
    ----------
    triangle : shape (n, n)
        Upper.
    norms : shape (n,)
        Of the columns, in their own order.
    permutation : shape (n,)
        The column at each place of the triangle.
    error
        Of ln det, in units of roundoff, without that of the logarithms; also the relative error of v^T (R^T R)^-1 v for any v.
    """

    triangle: FloatArray
    norms: FloatArray
    permutation: IntArray
    error: float

    @staticmethod
    def of(rows: FloatArray, magnitudes: FloatArray) -> ScaledTriangle | None:
        """Largest rows first, columns pivoted; None where the rows do not have full rank in double precision.

        Parameters
        ----------
        rows : shape (m, n)
        magnitudes : shape (n,)
            Size of the terms from which each column was computed.
        """
        size = rows.shape[1]
        if len(rows) < size or not np.isfinite(rows).all():
            return None
        norms = np.linalg.norm(rows, axis=0)
        if not (norms > 0).all():
            return None
        scaled = rows / norms
        scaled = scaled[np.argsort(-np.abs(scaled).max(axis=1), kind="stable")]
        triangle, permutation = _pivoted_qr(scaled)
        if size and np.abs(np.diagonal(triangle)).min() <= UNIT_ROUNDOFF:
            return None
        inverse = linalg.solve_triangular(triangle, np.eye(size))
        deviations = np.empty(size)
        deviations[permutation] = np.linalg.norm(inverse, axis=1)
        relative = math.sqrt(size) + ASSEMBLY_OPERATIONS * magnitudes / norms
        return ScaledTriangle(triangle, norms, permutation, 2 * float(relative @ deviations))

    @property
    def log_det(self) -> tuple[float, float]:
        """ln det (R^T R) and its error in units of roundoff."""
        logarithms = np.concatenate([np.log(np.abs(np.diagonal(self.triangle))), np.log(self.norms)])
        return 2 * math.fsum(logarithms), self.error + 2 * float(np.abs(logarithms).sum())

    def half_solutions(self, columns: FloatArray) -> FloatArray:
        """R^-T A, shape (n, s), whose squared norm is tr(A^T (R^T R)^-1 A)."""
        ordered = (columns / self.norms[:, None])[self.permutation]
        return np.asarray(linalg.solve_triangular(self.triangle, ordered, trans="T"), dtype=np.float64)

    def solutions(self, halves: FloatArray) -> FloatArray:
        """(R^T R)^-1 A from R^-T A."""
        solved = np.empty_like(halves)
        solved[self.permutation] = linalg.solve_triangular(self.triangle, halves)
        return solved / self.norms[:, None]


def log_det_by_qr(rows: FloatArray, magnitudes: FloatArray) -> tuple[float, float]:
    """ln det (R^T R), with its error in units of roundoff; parameters as for `ScaledTriangle.of`.

    Returns
    -------
    nan and inf where the rows do not have full rank in double precision.
    """
    triangle = ScaledTriangle.of(rows, magnitudes)
    return (math.nan, math.inf) if triangle is None else triangle.log_det


def log_dets_of_squares(rows: FloatArray, magnitudes: FloatArray) -> tuple[float, float]:
    """Sum of 2 ln |det R_e| over square R_e, rows and columns scaled to unit norm; with its error in units of roundoff.

    Parameters
    ----------
    rows : shape (m, b, b)
    magnitudes : shape (m, b)

    Returns
    -------
    nan and inf where some R_e is singular in double precision.
    """
    if len(rows) == 0:
        return 0.0, 0.0
    b = rows.shape[1]
    heights = np.linalg.norm(rows, axis=2)
    scaled = rows / heights[:, :, None]
    norms = np.linalg.norm(scaled, axis=1)
    scaled = scaled / norms[:, None, :]
    if not np.isfinite(scaled).all():
        return math.nan, math.inf
    log_dets = np.linalg.slogdet(scaled)[1]
    if not np.isfinite(log_dets).all():
        return math.nan, math.inf
    inverse: FloatArray = np.asarray(np.linalg.inv(scaled), dtype=np.float64)  # of R without its scales: R^-1 = N^-1 S^-1 H^-1
    deviations = np.linalg.norm(inverse / heights[:, None, :], axis=2) / norms
    logarithms = np.concatenate([log_dets, np.log(heights).ravel(), np.log(norms).ravel()])
    error = ASSEMBLY_OPERATIONS * np.sum(deviations * magnitudes) + b * np.sum(np.abs(inverse)) + np.abs(logarithms).sum()
    return 2 * math.fsum(logarithms), 2 * float(error)


def triangle_of_more_rows(triangle: FloatArray, rows: FloatArray, sizes: FloatArray) -> tuple[FloatArray, float]:
    """L' with L' L'^T = L L^T + A^T A, and the error of ln det (L' L'^T) in units of roundoff.

    Parameters
    ----------
    triangle : shape (n, n)
        L, lower.
    rows, sizes : shape (s, n)
        A and the sizes of the terms behind its entries.

    Returns
    -------
    nan and inf where rounding left no positive diagonal.
    """
    stacked = np.concatenate([triangle.T, rows])
    stacked = stacked[np.argsort(-np.abs(stacked).max(axis=1), kind="stable")]
    parts: Any = linalg.qr(stacked, mode="r")
    more: FloatArray = parts[0][: stacked.shape[1]]
    diagonal = np.diagonal(more)
    if not (np.isfinite(more).all() and (diagonal != 0).all()):
        return np.full_like(triangle, np.nan), math.inf
    more = more * np.sign(diagonal)[:, None]
    deviations = np.linalg.norm(linalg.solve_triangular(more, np.eye(len(more))), axis=1)
    norms = np.linalg.norm(stacked, axis=0)
    relative = math.sqrt(len(more)) * norms + ASSEMBLY_OPERATIONS * np.linalg.norm(sizes, axis=0)
    return more.T, 2 * float(relative @ deviations)


def _pivoted_qr(matrix: FloatArray) -> tuple[FloatArray, IntArray]:
    parts: Any = linalg.qr(matrix, mode="r", pivoting=True)
    triangle, permutation = parts
    return triangle[: matrix.shape[1]], permutation
