"""Kernels of `increments`: what extensions of a graph add to a log-determinant, one extension after the other."""

from __future__ import annotations

import math

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.linalg.compiled import compiled, unset
from topobelief.linalg.dense_kernels import cholesky_log_det, gram_block, inverse_diagonal, periodic_part
from topobelief.linalg.elimination_paths import Paths
from topobelief.linalg.extensions import Extensions
from topobelief.linalg.forest_kernels import (
    Blocks,
    compress_forest,
    eliminate_forest,
    expand_blocks,
    new_blocks,
    new_forest,
    reduce_closures,
)


@compiled
def add_increments(
    extensions: Extensions,
    rows_i: FloatArray,
    rows_j: FloatArray,
    shift: float,
    path_of: IntArray,
    paths: Paths,
    split: int,
    solutions: FloatArray,
    which: IntArray,
    out: FloatArray,
) -> None:
    """Increments of the extensions `which`.

    Parameters
    ----------
    extensions
    rows_i, rows_j : shape (number of edges, r, b), r >= b
    shift
        Added to the diagonal of new nodes.
    path_of : shape (num_existing,)
        Path of each existing node that is touched; -1 for one that is held.
    paths
    split
        Rows of a block that come first; 0 if the parts are not wanted.
    solutions : shape (num_existing, b, s), or without columns
        Z = M^-1 C for some columns C, whose trace tr(C^T M^-1 C) falls.
    which : shape (any,)
    out : shape (K, 8)
        ln det T of the forest; ln det (I + R) of the closures; the same with the existing nodes held; with the first rows of
        each block alone; with the others alone; by the chain rule (`chain_kernels`); what their error is proportional to; what
        the trace loses. Zero on entry.
    """
    r, b = rows_i.shape[1], rows_i.shape[2]
    for k in which:
        num_edges = int(extensions.edge_start[k + 1] - extensions.edge_start[k])
        num_new = int(extensions.node_start[k + 1] - extensions.node_start[k])
        forest = new_forest(num_new, b, shift)
        blocks = new_blocks(2 * num_edges if r > b or shift > 0 else num_edges - num_new, b)
        count = reduce_closures(extensions, k, rows_i, rows_j, forest, blocks)
        out[k, 0], out[k, 6], count = eliminate_forest(extensions, k, rows_i, rows_j, forest, blocks, count)
        if count == 0:
            continue
        columns = compress_forest(extensions, k, forest, blocks, count)
        rows, widths = np.zeros((count * b, columns * b)), np.zeros(count, np.int64)
        expand_blocks(extensions, k, forest, blocks, count, rows, widths)
        matrix = np.empty((count * b, count * b))  # I + V V^T
        for p in range(count * b):
            row = rows[p]
            for q in range(p + 1):
                other, total = rows[q], 0.0
                for m in range(min(widths[p // b], widths[q // b])):
                    total += row[m] * other[m]
                matrix[p, q] = total
            matrix[p, p] += 1.0
            out[k, 6] += matrix[p, p]
        out[k, 2] = cholesky_log_det(matrix.copy())
        seen = seen_solutions(blocks, count, solutions)
        sizes = add_existing(blocks, count, path_of, paths, matrix)
        if split:
            out[k, 3] = cholesky_log_det(periodic_part(matrix, b, 0, split))
            out[k, 4] = cholesky_log_det(periodic_part(matrix, b, split, b - split))
        out[k, 1] = cholesky_log_det(matrix)
        variances = inverse_diagonal(matrix)
        for p in range(count * b):
            out[k, 6] += variances[p] * sizes[p]
        out[k, 7] = squared_norm_of_solution(matrix, seen)


@compiled
def seen_solutions(blocks: Blocks, count: int, solutions: FloatArray) -> FloatArray:
    """W = A Z, A the blocks' rows on existing nodes, shape (count b, s)."""
    _, b, num_columns = solutions.shape
    seen = np.zeros((count * b, num_columns))
    if num_columns == 0:
        return seen
    for q in range(count):
        for side in range(2):
            node = blocks.ends[q, side]
            for c in range(b if node >= 0 else 0):
                row = seen[q * b + c]
                for d in range(b):
                    factor, solution = blocks.rows[q, side, c, d], solutions[node, d]
                    for m in range(num_columns):
                        row[m] += factor * solution[m]
    return seen


@compiled
def squared_norm_of_solution(factor: FloatArray, seen: FloatArray) -> float:
    """|C^-1 W|^2 with C the lower triangle; W is overwritten, some columns at a time that fit into fast memory."""
    size, num_columns, total = len(seen), seen.shape[1], 0.0
    for start in range(0, num_columns, 256):
        stop = min(start + 256, num_columns)
        for p in range(size):
            row, q = seen[p, start:stop], 0
            while q + 3 < p:
                u, v, w, x = factor[p, q], factor[p, q + 1], factor[p, q + 2], factor[p, q + 3]
                a, b = seen[q, start:stop], seen[q + 1, start:stop]
                c, d = seen[q + 2, start:stop], seen[q + 3, start:stop]
                for m in range(stop - start):
                    row[m] -= u * a[m] + v * b[m] + w * c[m] + x * d[m]
                q += 4
            while q < p:
                u, a = factor[p, q], seen[q, start:stop]
                for m in range(stop - start):
                    row[m] -= u * a[m]
                q += 1
            scale, squares = 1.0 / factor[p, p], 0.0
            for m in range(stop - start):
                row[m] *= scale
                squares += row[m] * row[m]
            total += squares
    return total


@compiled
def add_existing(blocks: Blocks, count: int, path_of: IntArray, paths: Paths, matrix: FloatArray) -> FloatArray:
    """Add A M^-1 A^T to the lower triangle of the matrix, A the blocks' rows on existing nodes.

    Returns the diagonal that it would have if no terms cancelled.
    """
    b = blocks.rows.shape[2]
    sizes = np.zeros(count * b)
    sites = touched_sites(blocks, count, path_of)
    num_sites = len(sites)
    if num_sites == 0:
        return sizes
    inverse = inverse_at(sites, paths)
    product = np.zeros((count * b, b * num_sites))  # A M^-1
    for q in range(count):
        for side in range(2):
            blocks.ends[q, side] = b * blocks.ends[q, side]
        for c in range(b):
            row, spread = product[q * b + c], 0.0
            for side in range(2):
                at = blocks.ends[q, side]
                for d in range(b if at >= 0 else 0):
                    factor, other = blocks.rows[q, side, c, d], inverse[at + d]
                    spread += abs(factor) * math.sqrt(other[at + d])
                    for m in range(b * num_sites):
                        row[m] += factor * other[m]
            sizes[q * b + c] = spread * spread
    for p in range(count * b):
        row, target = product[p], matrix[p]
        for q in range(p // b + 1):
            for side in range(2):
                at = blocks.ends[q, side]
                for c in range(b if at >= 0 else 0):
                    for d in range(b):
                        target[q * b + c] += row[at + d] * blocks.rows[q, side, c, d]
    return sizes


@compiled
def touched_sites(blocks: Blocks, count: int, path_of: IntArray) -> IntArray:
    """Paths of the existing nodes that blocks touch, ascending; the blocks' ends become places in that list (-1: none)."""
    sites, num_sites = np.empty(2 * count, np.int64), 0
    for q in range(count):
        for side in range(2):
            path = path_of[blocks.ends[q, side]] if blocks.ends[q, side] >= 0 else -1
            blocks.ends[q, side] = path
            at = num_sites
            while at > 0 and sites[at - 1] > path:
                at -= 1
            if path < 0 or (at > 0 and sites[at - 1] == path):
                continue
            for site in range(num_sites, at, -1):
                sites[site] = sites[site - 1]
            sites[at] = path
            num_sites += 1
    for q in range(count):
        for side in range(2):
            site = 0
            while blocks.ends[q, side] >= 0 and sites[site] != blocks.ends[q, side]:
                site += 1
            if blocks.ends[q, side] >= 0:
                blocks.ends[q, side] = site
    return sites[:num_sites].copy()


@compiled
def site_gaps(sites: IntArray, paths: Paths) -> IntArray:
    """How many nodes the paths of each site and of the next one have in common."""
    gap = np.empty(len(sites), np.int64)
    for t in range(1, len(sites)):
        gap[t - 1] = paths.shared[sites[t - 1]]
        for path in range(sites[t - 1] + 1, sites[t]):
            gap[t - 1] = min(gap[t - 1], paths.shared[path])
    return gap


@compiled
def inverse_at(sites: IntArray, paths: Paths) -> FloatArray:
    """M^-1 at some nodes, given by their paths in ascending order; shape (len(sites) b, len(sites) b)."""
    b, count = paths.block_size, len(sites)
    inverse, block = np.empty((b * count, b * count)), np.empty((b, b))
    gap = site_gaps(sites, paths)
    for t in range(count):
        right, common = sites[t], paths.lengths[sites[t]]
        for s in range(t, -1, -1):
            left = sites[s]
            if s < t:
                common = min(common, gap[s])
            x, y = paths.values[paths.start[left] :], paths.values[paths.start[right] :]
            gram_block(x, b * int(paths.lengths[left]), y, b * int(paths.lengths[right]), b * int(common), block)
            for c in range(b):
                for d in range(b):
                    inverse[s * b + c, t * b + d] = block[c, d]
                    inverse[t * b + d, s * b + c] = block[c, d]
    return inverse


@compiled
def add_diagonal_increments(
    extensions: Extensions,
    rows_i: FloatArray,
    rows_j: FloatArray,
    shift: FloatArray,
    diagonal: FloatArray,
    held: int,
    out: FloatArray,
) -> None:
    """What extensions add to the sum of ln det of the diagonal blocks.

    Parameters
    ----------
    extensions, rows_i, rows_j
        As for `add_increments`.
    shift : shape (K,)
        Added to the diagonal of all blocks.
    diagonal : shape (num_existing, b, b)
        Blocks of the existing nodes, without shift.
    held
        Node without a block.
    out : shape (K,)
    """
    r, b = rows_i.shape[1], rows_i.shape[2]
    n = extensions.num_existing
    slot_of = unset(n)
    before, after = np.empty((b, b)), np.empty((b, b))
    for k in range(len(out)):
        first_new, num_new = extensions.node_start[k], extensions.node_start[k + 1] - extensions.node_start[k]
        touched, count = np.empty(2 * (extensions.edge_start[k + 1] - extensions.edge_start[k]), np.int64), 0
        gains = np.zeros((num_new + len(touched), b, b))
        for e in range(extensions.edge_start[k], extensions.edge_start[k + 1]):
            for side in range(2):
                node = extensions.edges[e, side]
                if node == held:
                    continue
                slot = node - n - first_new
                if node < n:
                    if slot_of[node] < 0:
                        slot_of[node] = num_new + count
                        touched[count] = node
                        count += 1
                    slot = slot_of[node]
                for m in range(r):
                    for c in range(b):
                        for d in range(c + 1):
                            gains[slot, c, d] += (
                                rows_i[e, m, c] * rows_i[e, m, d] if side == 0 else rows_j[e, m, c] * rows_j[e, m, d]
                            )
        out[k] = 0.0
        for slot in range(num_new + count):
            for c in range(b):
                for d in range(c + 1):
                    old = diagonal[touched[slot - num_new], c, d] if slot >= num_new else 0.0
                    if c == d:
                        old += shift[k]
                    before[c, d], after[c, d] = old, old + gains[slot, c, d]
            out[k] += cholesky_log_det(after)
            if slot >= num_new:
                out[k] -= cholesky_log_det(before)
        for slot in range(count):
            slot_of[touched[slot]] = -1
