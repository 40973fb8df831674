"""Kernels of `increments`: the chain rule along the closures of an extension, each conditioned on those of a window.

Blocks of I + R are needed between closures of one window, and those of the other rows (not the first ones of each closure)
between all. The other rows of a form's closures touch the other variables of a node alone: in the joint information matrix,
rotation rows touch rotations only.
"""

from __future__ import annotations

import math

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.linalg.compiled import compiled
from topobelief.linalg.dense_kernels import cholesky_log_det, gram_block, inverse_diagonal
from topobelief.linalg.elimination_paths import Paths
from topobelief.linalg.extensions import Extensions
from topobelief.linalg.forest_kernels import Blocks, reduce_extension
from topobelief.linalg.increment_kernels import site_gaps, touched_sites


@compiled
def add_chained_increments(
    extensions: Extensions,
    rows_i: FloatArray,
    rows_j: FloatArray,
    path_of: IntArray,
    paths: Paths,
    split: int,
    window: int,
    which: IntArray,
    out: FloatArray,
) -> None:
    """Increments of the extensions `which` by the chain rule.

    Parameters
    ----------
    extensions, rows_i, rows_j, path_of, paths, split, which, out
        As for `increment_kernels.add_increments`; rows are square, and columns 1 to 3 of `out` stay as they are.
    window
        Closures before each one on which it is conditioned.
    """
    for k in which:
        out[k, 0], out[k, 6], blocks, rows, widths = reduce_extension(extensions, k, rows_i, rows_j, 0.0)
        count = len(widths)
        if count == 0:
            continue
        sites = touched_sites(blocks, count, path_of)
        gap = site_gaps(sites, paths)
        out[k, 4] = cholesky_log_det(_covariance_of_other_rows(blocks, count, rows, widths, split, sites, gap, paths))
        order = _ascending(widths)
        sizes = _sizes(blocks, count, sites, paths)
        _add_chain(blocks, order, rows, widths, sites, gap, paths, window, sizes, out[k])


@compiled
def _add_chain(
    blocks: Blocks,
    order: IntArray,
    rows: FloatArray,
    widths: IntArray,
    sites: IntArray,
    gap: IntArray,
    paths: Paths,
    window: int,
    sizes: FloatArray,
    out: FloatArray,
) -> None:
    """Add ln det of the conditional covariances to out[5], and what their error is proportional to to out[6]."""
    b, count = blocks.rows.shape[2], len(order)
    band = np.zeros((count, window + 1, b, b))  # blocks of I + R between each closure and those before it
    gram = np.empty((b, b))
    for last in range(count):
        for back in range(min(last, window) + 1):
            _add_pair(blocks, order[last], order[last - back], rows, widths, sites, gap, paths, gram, band[last, back])
        for c in range(b):
            band[last, 0, c, c] += 1.0
    for last in range(count):
        first = max(0, last - window)
        size = (last - first + 1) * b
        matrix = np.empty((size, size))
        for p in range(first, last + 1):
            for q in range(first, p + 1):
                for c in range(b):
                    for d in range(b):
                        matrix[(p - first) * b + c, (q - first) * b + d] = band[p, p - q, c, d]
        if math.isnan(cholesky_log_det(matrix)):
            out[5] = math.nan
            return
        for c in range(size - b, size):
            out[5] += 2.0 * math.log(matrix[c, c])
        variances = inverse_diagonal(matrix)
        for p in range(first, last + 1):
            for c in range(b):
                out[6] += variances[(p - first) * b + c] * (sizes[order[p] * b + c] + band[p, 0, c, c])


@compiled
def _add_pair(
    blocks: Blocks,
    p: int,
    q: int,
    rows: FloatArray,
    widths: IntArray,
    sites: IntArray,
    gap: IntArray,
    paths: Paths,
    gram: FloatArray,
    out: FloatArray,
) -> None:
    """Add R_pq of two closures, shape (b, b): over the noise of new nodes, and over existing ones."""
    b = blocks.rows.shape[2]
    for c in range(b):
        row = rows[p * b + c]
        for d in range(b):
            other = rows[q * b + d]
            for m in range(min(widths[p], widths[q])):
                out[c, d] += row[m] * other[m]
    for side in range(2):
        s = blocks.ends[p, side]
        for other_side in range(2):
            t = blocks.ends[q, other_side]
            if s < 0 or t < 0:
                continue
            left, right = sites[s], sites[t]
            x, y = paths.values[paths.start[left] :], paths.values[paths.start[right] :]
            length = b * _common(s, t, sites, gap, paths)
            gram_block(x, b * int(paths.lengths[left]), y, b * int(paths.lengths[right]), length, gram)
            for c in range(b):
                for d in range(b):
                    for m in range(b):
                        factor = 0.0
                        for n in range(b):
                            factor += gram[m, n] * blocks.rows[q, other_side, d, n]
                        out[c, d] += blocks.rows[p, side, c, m] * factor


@compiled
def _covariance_of_other_rows(
    blocks: Blocks, count: int, rows: FloatArray, widths: IntArray, split: int, sites: IntArray, gap: IntArray, paths: Paths
) -> FloatArray:
    """Lower triangle of I + R of the rows from `split` on of all closures."""
    b = blocks.rows.shape[2]
    num_other, num_sites = b - split, len(sites)
    inverse = np.empty((num_sites * num_other, num_sites * num_other))  # of the other variables at the sites
    for t in range(num_sites):
        for s in range(t + 1):
            length = b * _common(s, t, sites, gap, paths)
            for c in range(num_other):
                x = paths.values[paths.start[sites[s]] + (split + c) * b * paths.lengths[sites[s]] :]
                for d in range(num_other):
                    y = paths.values[paths.start[sites[t]] + (split + d) * b * paths.lengths[sites[t]] :]
                    total = 0.0
                    for m in range(length):
                        total += x[m] * y[m]
                    inverse[s * num_other + c, t * num_other + d] = total
                    inverse[t * num_other + d, s * num_other + c] = total
    matrix = np.zeros((count * num_other, count * num_other))
    for p in range(count):
        for q in range(p + 1):
            for c in range(num_other):
                row = rows[p * b + split + c]
                for d in range(num_other):
                    other, total = rows[q * b + split + d], 0.0
                    for m in range(min(widths[p], widths[q])):
                        total += row[m] * other[m]
                    for side in range(2):
                        s = blocks.ends[p, side]
                        for other_side in range(2):
                            t = blocks.ends[q, other_side]
                            for m in range(num_other if s >= 0 and t >= 0 else 0):
                                for n in range(num_other):
                                    total += (
                                        blocks.rows[p, side, split + c, split + m]
                                        * inverse[s * num_other + m, t * num_other + n]
                                        * blocks.rows[q, other_side, split + d, split + n]
                                    )
                    matrix[p * num_other + c, q * num_other + d] = total
        for c in range(num_other):
            matrix[p * num_other + c, p * num_other + c] += 1.0
    return matrix


@compiled
def _common(s: int, t: int, sites: IntArray, gap: IntArray, paths: Paths) -> int:
    """Nodes that the paths of two sites have in common."""
    low, high = min(s, t), max(s, t)
    common = int(paths.lengths[sites[low]])
    for site in range(low, high):
        common = min(common, int(gap[site]))
    return common


@compiled
def _sizes(blocks: Blocks, count: int, sites: IntArray, paths: Paths) -> FloatArray:
    """Diagonal that A M^-1 A^T would have if no terms cancelled, A the blocks' rows on existing nodes; shape (count b,)."""
    b = blocks.rows.shape[2]
    deviations = np.empty((len(sites), b))
    for s in range(len(sites)):
        length = b * int(paths.lengths[sites[s]])
        for d in range(b):
            x, total = paths.values[paths.start[sites[s]] + d * length :], 0.0
            for m in range(length):
                total += x[m] * x[m]
            deviations[s, d] = math.sqrt(total)
    sizes = np.zeros(count * b)
    for q in range(count):
        for c in range(b):
            spread = 0.0
            for side in range(2):
                for d in range(b if blocks.ends[q, side] >= 0 else 0):
                    spread += abs(blocks.rows[q, side, c, d]) * deviations[blocks.ends[q, side], d]
            sizes[q * b + c] = spread * spread
    return sizes


@compiled
def _ascending(values: IntArray) -> IntArray:
    """Places in ascending order of their values, equal ones as they stand."""
    order = np.empty(len(values), np.int64)
    for n in range(len(values)):
        at = n
        while at > 0 and values[order[at - 1]] > values[n]:
            order[at] = order[at - 1]
            at -= 1
        order[at] = n
    return order
