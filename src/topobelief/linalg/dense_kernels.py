"""Kernels for small dense matrices: Householder reflections, Gram matrices of long rows, Cholesky.

Written out because calls of LAPACK from parallel loops cost more than the work itself. Arrays are filled entry by entry: numba
compiles that many times faster than assignments to slices, and runs it as fast.
"""

from __future__ import annotations

import math

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.linalg.compiled import compiled


@compiled
def triangularise(work: FloatArray, num_rows: int, num_columns: int, num_pivots: int) -> None:
    """Householder reflections of the first rows and columns of a work area that clear its first columns below the diagonal."""
    for p in range(min(num_pivots, num_rows - 1)):
        below = 0.0
        for r in range(p + 1, num_rows):
            below += work[r, p] * work[r, p]
        if below == 0.0:
            continue
        first = work[p, p]
        alpha = -math.copysign(math.sqrt(below + first * first), first)
        lead = first - alpha
        scale = 1.0 / (alpha * lead)
        for c in range(p + 1, num_columns):
            total = lead * work[p, c]
            for r in range(p + 1, num_rows):
                total += work[r, p] * work[r, c]
            total *= scale
            work[p, c] += total * lead
            for r in range(p + 1, num_rows):
                work[r, c] += total * work[r, p]
        work[p, p] = alpha
        for r in range(p + 1, num_rows):
            work[r, p] = 0.0


@compiled
def copy_block(source: FloatArray, target: FloatArray, first_row: int, first_column: int) -> None:
    """target[first_row :, first_column :] = source, for as far as the source goes."""
    for r in range(source.shape[0]):
        for c in range(source.shape[1]):
            target[first_row + r, first_column + c] = source[r, c]


@compiled
def gram_block(left: FloatArray, left_stride: int, right: FloatArray, right_stride: int, length: int, out: FloatArray) -> None:
    """out = X Y^T, shape (b, b), of the beginnings of b rows that stand one behind the other, `stride` apart."""
    b = len(out)
    if b % 3 == 0:
        for i in range(0, b, 3):
            x, y, z = left[i * left_stride :], left[(i + 1) * left_stride :], left[(i + 2) * left_stride :]
            for j in range(0, b, 3):
                u, v, w = right[j * right_stride :], right[(j + 1) * right_stride :], right[(j + 2) * right_stride :]
                xu = xv = xw = yu = yv = yw = zu = zv = zw = 0.0
                for m in range(length):
                    xu += x[m] * u[m]
                    xv += x[m] * v[m]
                    xw += x[m] * w[m]
                    yu += y[m] * u[m]
                    yv += y[m] * v[m]
                    yw += y[m] * w[m]
                    zu += z[m] * u[m]
                    zv += z[m] * v[m]
                    zw += z[m] * w[m]
                out[i, j], out[i, j + 1], out[i, j + 2] = xu, xv, xw
                out[i + 1, j], out[i + 1, j + 1], out[i + 1, j + 2] = yu, yv, yw
                out[i + 2, j], out[i + 2, j + 1], out[i + 2, j + 2] = zu, zv, zw
        return
    for i in range(b):
        x = left[i * left_stride :]
        for j in range(b):
            u = right[j * right_stride :]
            total = 0.0
            for m in range(length):
                total += x[m] * u[m]
            out[i, j] = total


@compiled
def cholesky_log_det(matrix: FloatArray) -> float:
    """ln det of a positive definite matrix, whose lower triangle is overwritten by its factor; nan where it is not one."""
    total = 0.0
    for i in range(len(matrix)):
        row = matrix[i]
        for j in range(i + 1):
            other, value = matrix[j], 0.0
            for m in range(j):
                value += row[m] * other[m]
            value = row[j] - value
            if j < i:
                row[j] = value / other[j]
            elif value > 0.0:
                row[j] = math.sqrt(value)
                total += math.log(value)
            else:
                return math.nan
    return total


@compiled
def inverse_diagonal(factor: FloatArray) -> FloatArray:
    """Diagonal of (C C^T)^-1, C the lower triangle."""
    inverse, diagonal = np.zeros(factor.shape), np.zeros(len(factor))
    for i in range(len(factor)):
        row, scale = inverse[i], 1.0 / factor[i, i]
        for j in range(i):
            value, other = factor[i, j], inverse[j]
            for m in range(j + 1):
                row[m] -= value * other[m]
        row[i] = 1.0
        for m in range(i + 1):
            row[m] *= scale
            diagonal[m] += row[m] * row[m]
    return diagonal


@compiled
def periodic_part(matrix: FloatArray, period: int, offset: int, count: int) -> FloatArray:
    """Lower triangle of the rows and columns offset, …, offset + count - 1 of each period."""
    size = len(matrix) // period * count
    part = np.empty((size, size))
    for p in range(size):
        for q in range(p + 1):
            part[p, q] = matrix[p // count * period + offset + p % count, q // count * period + offset + q % count]
    return part
