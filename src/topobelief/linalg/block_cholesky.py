"""Kernels: Cholesky factor of a sparse matrix of b x b blocks, solutions with it, and columns of its inverse.

M = l l^T on an elimination tree: column t of l has blocks at the rows struct(t), all of them ancestors of t. Columns of l^-1
live on the way from t to the root, and they follow from those of the ancestors,

    Y_t l_tt + sum over i in struct(t) of Y_i l_it = E_t,        Y_t = l^-1 E_t,

so all of them cost |struct(t)| vector operations each, root first, and what is needed at t stands on the stack of a
depth-first walk. Y_t is stored as b rows, each from the root down: the path of i is where the path of t begins.

Notation: `start`, `rows` compressed columns of l below its diagonal, rows ascending; `axes` a tuple of length b.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.linalg.compiled import compiled, unset

Int32Array = NDArray[np.int32]  # a large factor has many rows


@compiled
def assemble(
    position: IntArray,
    edges: IntArray,
    rows_i: FloatArray,
    rows_j: FloatArray,
    start: IntArray,
    rows: Int32Array,
    diagonal: FloatArray,
    blocks: FloatArray,
) -> None:
    """Add the Gram matrix of edge rows to the blocks of M, lower triangle; held nodes have position -1.

    Parameters
    ----------
    position : shape (num_nodes,)
        Place of each node in the elimination.
    edges : shape (m, 2)
    rows_i, rows_j : shape (m, r, b)
    start, rows
        Where the blocks go.
    diagonal : shape (n, b, b)
    blocks : shape (nnz, b, b)
    """
    num_rows, b = rows_i.shape[1], rows_i.shape[2]
    for e in range(len(edges)):
        i, j = position[edges[e, 0]], position[edges[e, 1]]
        for r in range(num_rows):
            for c in range(b):
                for d in range(c + 1):
                    if i >= 0:
                        diagonal[i, c, d] += rows_i[e, r, c] * rows_i[e, r, d]
                    if j >= 0:
                        diagonal[j, c, d] += rows_j[e, r, c] * rows_j[e, r, d]
        if i < 0 or j < 0:
            continue
        low, high = min(i, j), max(i, j)
        p, end = start[low], start[low + 1]
        while end - p > 1:
            middle = (p + end) // 2
            if rows[middle] <= high:
                p = middle
            else:
                end = middle
        for r in range(num_rows):
            for c in range(b):
                for d in range(b):
                    if i > j:
                        blocks[p, c, d] += rows_i[e, r, c] * rows_j[e, r, d]
                    else:
                        blocks[p, c, d] += rows_j[e, r, c] * rows_i[e, r, d]


@compiled
def pull(
    position: IntArray, edges: IntArray, rows_i: FloatArray, rows_j: FloatArray, values: FloatArray, out: FloatArray
) -> None:
    """Add R_e^T values_e over edges e; values (m, r, s), out (n, b, s) by position."""
    _, num_rows, b = rows_i.shape
    for e in range(len(edges)):
        i, j = position[edges[e, 0]], position[edges[e, 1]]
        for r in range(num_rows):
            for c in range(b):
                for s in range(values.shape[2]):
                    if i >= 0:
                        out[i, c, s] += rows_i[e, r, c] * values[e, r, s]
                    if j >= 0:
                        out[j, c, s] += rows_j[e, r, c] * values[e, r, s]


@compiled
def subtract_columns(
    axes: tuple[int, ...],
    rows: Int32Array,
    blocks: FloatArray,
    column: int,
    last: int,
    start: IntArray,
    count: int,
    out: FloatArray,
) -> None:
    """out[i] -= l_ic l_jc^T for the last `count` rows i of some columns c with the same such rows, j the first of them."""
    b = len(axes)
    c = column
    if b == 1:
        while c + 3 <= last:  # four columns at a time: a quarter of the scattering
            o, p, q, r = start[c + 1] - count, start[c + 2] - count, start[c + 3] - count, start[c + 4] - count
            w, x, y, z = blocks[o, 0, 0], blocks[p, 0, 0], blocks[q, 0, 0], blocks[r, 0, 0]
            of, pf, qf, rf, where = blocks[o:], blocks[p:], blocks[q:], blocks[r:], rows[o:]
            for m in range(count):
                out[where[m], 0, 0] -= w * of[m, 0, 0] + x * pf[m, 0, 0] + y * qf[m, 0, 0] + z * rf[m, 0, 0]
            c += 4
    size = 3 if b % 3 == 0 else 1
    while c <= last:
        first = start[c + 1] - count
        for e in range(0, b, size):
            for m in range(0, b, size):
                if size == 3:
                    x, y, z = blocks[first, e, m], blocks[first, e, m + 1], blocks[first, e, m + 2]
                    x1, y1, z1 = blocks[first, e + 1, m], blocks[first, e + 1, m + 1], blocks[first, e + 1, m + 2]
                    x2, y2, z2 = blocks[first, e + 2, m], blocks[first, e + 2, m + 1], blocks[first, e + 2, m + 2]
                    for p in range(first, start[c + 1]):
                        i = rows[p]
                        for d in range(b):
                            u, v, w = blocks[p, d, m], blocks[p, d, m + 1], blocks[p, d, m + 2]
                            out[i, d, e] -= u * x + v * y + w * z
                            out[i, d, e + 1] -= u * x1 + v * y1 + w * z1
                            out[i, d, e + 2] -= u * x2 + v * y2 + w * z2
                else:
                    x = blocks[first, e, m]
                    for p in range(first, start[c + 1]):
                        i = rows[p]
                        for d in range(b):
                            out[i, d, e] -= blocks[p, d, m] * x
        c += 1


@compiled
def copy_columns(
    start: IntArray, columns: IntArray, old_start: IntArray, old_columns: IntArray, old_blocks: FloatArray, blocks: FloatArray
) -> None:
    """Copy columns of one factor to their places in another, in which they have as many rows."""
    b = blocks.shape[1]
    for k in range(len(columns)):
        p, q = start[columns[k]], old_start[old_columns[k]]
        for m in range(start[columns[k] + 1] - p):
            for c in range(b):
                for d in range(b):
                    blocks[p + m, c, d] = old_blocks[q + m, c, d]


@compiled
def factorize(
    axes: tuple[int, ...], start: IntArray, rows: Int32Array, done: BoolArray, diagonal: FloatArray, blocks: FloatArray
) -> bool:
    """Replace the blocks of M by those of l, column by column, left-looking; False where a pivot is not positive.

    Columns that follow each other with the same rows (a supernode) wait together for the row at which they are needed next.
    Columns that are done hold l already.
    """
    b, n = len(axes), len(diagonal)
    last = np.empty(n, np.int64)  # last column of each one's supernode
    for j in range(n - 1, -1, -1):
        count, behind = start[j + 1] - start[j], start[j + 2] - start[j + 1] if j + 1 < n else -1
        last[j] = last[j + 1] if 0 < count == behind + 1 and rows[start[j]] == j + 1 else j
    head, link = unset(n), unset(n)  # supernodes that wait for a row, by their first columns
    left = np.zeros(n, np.int64)  # how many rows of a supernode are still to come
    work = np.zeros((n, b, b))
    first = 0
    for j in range(n):
        if j > 0 and last[j - 1] != last[j]:
            first = j
        waiting = int(head[j])
        while waiting >= 0:
            following, count = int(link[waiting]), int(left[waiting])
            if not done[j]:
                subtract_columns(axes, rows, blocks, waiting, int(last[waiting]), start, count, work)
            left[waiting] -= 1
            if count > 1:
                row = rows[start[last[waiting] + 1] - count + 1]
                link[waiting], head[row] = head[row], waiting
            waiting = following
        if not done[j]:
            if first < j:
                subtract_columns(axes, rows, blocks, first, j - 1, start, start[j + 1] - start[j] + 1, work)
            if not finish_column(axes, rows, j, start[j], start[j + 1], work, diagonal, blocks):
                return False
        if last[first] == j and start[j] < start[j + 1]:
            left[first] = start[j + 1] - start[j]
            link[first], head[rows[start[j]]] = head[rows[start[j]]], first
    return True


@compiled
def finish_column(
    axes: tuple[int, ...],
    rows: Int32Array,
    column: int,
    begin: int,
    end: int,
    work: FloatArray,
    diagonal: FloatArray,
    blocks: FloatArray,
) -> bool:
    """Add to a column of M what earlier columns take away, by row in `work`, and divide by the root of its pivot."""
    b = len(axes)
    for c in range(b):
        for d in range(b):
            diagonal[column, c, d] += work[column, c, d]
            work[column, c, d] = 0.0
    for p in range(begin, end):
        for c in range(b):
            for d in range(b):
                blocks[p, c, d] += work[rows[p], c, d]
                work[rows[p], c, d] = 0.0
    for c in range(b):
        for d in range(c + 1):
            total = diagonal[column, c, d]
            for m in range(d):
                total -= diagonal[column, c, m] * diagonal[column, d, m]
            if c > d:
                diagonal[column, c, d] = total / diagonal[column, d, d]
            elif total > 0:
                diagonal[column, c, c] = math.sqrt(total)
            else:
                return False
        for d in range(c + 1, b):
            diagonal[column, c, d] = 0.0
    for p in range(begin, end):
        for c in range(b):
            for d in range(b):
                total = blocks[p, c, d]
                for m in range(d):
                    total -= blocks[p, c, m] * diagonal[column, d, m]
                blocks[p, c, d] = total / diagonal[column, d, d]
    return True


@compiled
def solve(start: IntArray, rows: Int32Array, diagonal: FloatArray, blocks: FloatArray, values: FloatArray) -> None:
    """Replace `values`, shape (n, b, s) in order of elimination, by M^-1 values."""
    solve_lower(start, rows, diagonal, blocks, values)
    solve_upper(start, rows, diagonal, blocks, values)


@compiled
def solve_lower(start: IntArray, rows: Int32Array, diagonal: FloatArray, blocks: FloatArray, values: FloatArray) -> None:
    """Replace `values`, shape (n, b, s) in order of elimination, by l^-1 values."""
    n, b, s = values.shape
    for j in range(n):
        for c in range(b):
            for d in range(c):
                for m in range(s):
                    values[j, c, m] -= diagonal[j, c, d] * values[j, d, m]
            for m in range(s):
                values[j, c, m] /= diagonal[j, c, c]
        for p in range(start[j], start[j + 1]):
            i = rows[p]
            for c in range(b):
                for d in range(b):
                    for m in range(s):
                        values[i, c, m] -= blocks[p, c, d] * values[j, d, m]


@compiled
def solve_upper(start: IntArray, rows: Int32Array, diagonal: FloatArray, blocks: FloatArray, values: FloatArray) -> None:
    """Replace `values`, shape (n, b, s) in order of elimination, by l^-T values."""
    n, b, s = values.shape
    for j in range(n - 1, -1, -1):
        for p in range(start[j], start[j + 1]):
            i = rows[p]
            for c in range(b):
                for d in range(b):
                    for m in range(s):
                        values[j, d, m] -= blocks[p, c, d] * values[i, c, m]
        for c in range(b - 1, -1, -1):
            for d in range(c + 1, b):
                for m in range(s):
                    values[j, c, m] -= diagonal[j, d, c] * values[j, d, m]
            for m in range(s):
                values[j, c, m] /= diagonal[j, c, c]


@compiled
def subtract_paths(
    axes: tuple[int, ...], blocks: FloatArray, lengths: IntArray, begins: IntArray, stack: FloatArray, out: FloatArray
) -> None:
    """out -= blocks[p]^T path_p over p: b rows of `lengths[p]` numbers from `begins[p]` on, and the start of out's b rows."""
    b, count = len(axes), len(lengths)
    stride, p = len(out) // b, 0
    if b == 1:
        while p + 3 < count:  # four paths at a time for as far as they all go; lengths descend
            w, x, y, z = blocks[p, 0, 0], blocks[p + 1, 0, 0], blocks[p + 2, 0, 0], blocks[p + 3, 0, 0]
            s, t, u, v = stack[begins[p] :], stack[begins[p + 1] :], stack[begins[p + 2] :], stack[begins[p + 3] :]
            for m in range(lengths[p + 3]):
                out[m] -= w * s[m] + x * t[m] + y * u[m] + z * v[m]
            for q in range(p, p + 3):
                x, t = blocks[q, 0, 0], stack[begins[q] :]
                for m in range(lengths[p + 3], lengths[q]):
                    out[m] -= x * t[m]
            p += 4
    while p < count:
        length = lengths[p]
        for r in range(b):
            row = out[r * stride :]
            if b % 3 == 0:
                for c in range(0, b, 3):
                    x, y, z = blocks[p, c, r], blocks[p, c + 1, r], blocks[p, c + 2, r]
                    begin = begins[p] + c * length
                    u, v, w = stack[begin:], stack[begin + length :], stack[begin + 2 * length :]
                    for m in range(length):
                        row[m] -= x * u[m] + y * v[m] + z * w[m]
            else:
                for c in range(b):
                    x, u = blocks[p, c, r], stack[begins[p] + c * length :]
                    for m in range(length):
                        row[m] -= x * u[m]
        p += 1


@compiled
def inverse_columns(
    axes: tuple[int, ...],
    start: IntArray,
    rows: Int32Array,
    depth: IntArray,
    diagonal: FloatArray,
    blocks: FloatArray,
    needed: BoolArray,
    wanted: IntArray,
    values: FloatArray,
    value_start: IntArray,
) -> None:
    """Columns of l^-1 at the wanted nodes, root first.

    Parameters
    ----------
    axes, start, rows, diagonal, blocks
        The factor; the order of elimination is a postorder of the tree.
    depth : shape (n,)
    needed : shape (n,)
        The wanted nodes and all their ancestors.
    wanted : shape (w,)
        Ascending.
    values : flat
        Column block t goes to b rows of b (depth + 1) numbers from `value_start[t]` on.
    """
    b, remaining, deepest = len(axes), len(wanted) - 1, 0
    for t in wanted:
        deepest = max(deepest, depth[t])
    first = np.empty(deepest + 2, np.int64)  # where the path of a node of each depth begins on the stack
    for d in range(deepest + 2):
        first[d] = b * b * d * (d + 1) // 2
    stack = np.empty(first[deepest + 1])
    lengths, begins = np.empty(deepest + 1, np.int64), np.empty(deepest + 1, np.int64)
    for j in range(len(depth) - 1, -1, -1):
        if not needed[j]:
            continue
        length = b * (depth[j] + 1)
        out = stack[first[depth[j]] : first[depth[j] + 1]]
        for m in range(b * length):
            out[m] = 0.0
        count = start[j + 1] - start[j]
        for p in range(count):
            ancestor = depth[rows[start[j] + p]]
            lengths[p], begins[p] = b * (ancestor + 1), first[ancestor]
        subtract_paths(axes, blocks[start[j] : start[j + 1]], lengths[:count], begins[:count], stack, out)
        for r in range(b - 1, -1, -1):
            row, scale = out[r * length :], 1.0 / diagonal[j, r, r]
            row[length - b + r] = 1.0
            for c in range(r + 1, b):
                factor, other = diagonal[j, c, r], out[c * length :]
                for m in range(length):
                    row[m] -= factor * other[m]
            for m in range(length):
                row[m] *= scale
        if remaining >= 0 and wanted[remaining] == j:
            target = values[value_start[remaining] :]
            for m in range(b * length):
                target[m] = out[m]
            remaining -= 1
