"""Kernels that reduce one extension of a graph to what couples it to the graph: rows on unit noise and on existing nodes.

Everything works on rows, by Householder reflections, so that no digits are lost to differences: closures become square; the
forest of new nodes is eliminated from its leaves to the nodes that it is attached to; its nodes without closures are skipped;
each closure is written as rows on the independent unit noise of the nodes that are left and on existing nodes.

Notation: b variables a node, r >= b rows an edge; an eliminated node is x = F x_parent + N noise. `new` counts an extension's
new nodes from 0. A block is b rows on one or two nodes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.linalg.compiled import compiled, unset
from topobelief.linalg.dense_kernels import copy_block, triangularise
from topobelief.linalg.extensions import Extensions


class Blocks(NamedTuple):
    """Closures, and what else is left on existing nodes.

    Attributes
    ----------
    ends : shape (capacity, 2)
        Nodes; -1 where there is no second one.
    rows : shape (capacity, 2, b, b)
        On the variables of either.
    """

    ends: IntArray
    rows: FloatArray


class Forest(NamedTuple):
    """New nodes of one extension.

    Attributes
    ----------
    parent : shape (num_new,)
    transfer, noise : shape (num_new, b, b)
        F and N.
    unary : shape (num_new, b, b)
        Triangle of the rows on a node alone, where `has_unary`.
    column : shape (num_new,)
        Place of a node's noise among those that are kept.
    """

    parent: IntArray
    transfer: FloatArray
    noise: FloatArray
    unary: FloatArray
    has_unary: BoolArray
    column: IntArray


@compiled
def new_blocks(capacity: int, b: int) -> Blocks:
    """Room for blocks."""
    ends = np.empty((capacity, 2), np.int64)
    for q in range(capacity):
        ends[q, 0] = ends[q, 1] = -1
    return Blocks(ends, np.zeros((capacity, 2, b, b)))


@compiled
def new_forest(num_new: int, b: int, shift: float) -> Forest:
    """Nodes without rows but for `shift` on the diagonal."""
    unary, has_unary = np.zeros((num_new, b, b)), np.zeros(num_new, np.bool_)
    if shift > 0:
        for new in range(num_new):
            has_unary[new] = True
            for c in range(b):
                unary[new, c, c] = math.sqrt(shift)
    shape = (num_new, b, b)
    return Forest(np.empty(num_new, np.int64), np.empty(shape), np.empty(shape), unary, has_unary, unset(num_new))


@compiled
def leave_rest(
    work: FloatArray, first: int, last: int, node: int, num_existing: int, new: int, forest: Forest, blocks: Blocks, count: int
) -> int:
    """Rows first … last - 1 of the work area are on one node alone: add them to it, or to the blocks if it exists already.

    Returns the number of blocks.
    """
    b = work.shape[1] // 2
    if node < num_existing:
        blocks.ends[count, 0] = node
        for r in range(first, last):
            for c in range(b):
                blocks.rows[count, 0, r - first, c] = work[r, b + c]
        return count + 1
    for r in range(first, last):
        for c in range(b):  # Givens rotations of the row into the triangle
            size = math.hypot(forest.unary[new, c, c], work[r, b + c])
            if size > 0.0:
                cosine, sine = forest.unary[new, c, c] / size, work[r, b + c] / size
                for d in range(c, b):
                    old, added = forest.unary[new, c, d], work[r, b + d]
                    forest.unary[new, c, d], work[r, b + d] = cosine * old + sine * added, cosine * added - sine * old
    forest.has_unary[new] = True
    return count


@compiled
def reduce_closures(
    extensions: Extensions, k: int, rows_i: FloatArray, rows_j: FloatArray, forest: Forest, blocks: Blocks
) -> int:
    """Closures as blocks; rows beyond b touch one end alone, a new one if there is one. Returns their number."""
    r, b = rows_i.shape[1], rows_i.shape[2]
    n, first_new = extensions.num_existing, extensions.node_start[k]
    work, count = np.empty((r, 2 * b)), 0
    for e in range(extensions.edge_start[k], extensions.edge_start[k + 1]):
        if extensions.planted[e]:
            continue
        i, j = extensions.edges[e, 0], extensions.edges[e, 1]
        flip = j < n and r > b
        copy_block(rows_j[e] if flip else rows_i[e], work, 0, 0)
        copy_block(rows_i[e] if flip else rows_j[e], work, 0, b)
        if flip:
            i, j = j, i
        if r > b:
            triangularise(work, r, 2 * b, 2 * b)
        blocks.ends[count, 0], blocks.ends[count, 1] = i, j
        for c in range(b):
            for d in range(b):
                blocks.rows[count, 0, c, d], blocks.rows[count, 1, c, d] = work[c, d], work[c, b + d]
        count += 1
        if r > b:
            count = leave_rest(work, b, min(r, 2 * b), j, n, j - n - first_new, forest, blocks, count)
    return count


@compiled
def eliminate_forest(
    extensions: Extensions, k: int, rows_i: FloatArray, rows_j: FloatArray, forest: Forest, blocks: Blocks, count: int
) -> tuple[float, float, int]:
    """Eliminate new nodes, leaves first.

    Returns ln det of their block with the existing nodes held, the sum of the condition numbers of what was inverted (of T with
    its columns scaled), and the number of blocks then.
    """
    r, b = rows_i.shape[1], rows_i.shape[2]
    n, first_new = extensions.num_existing, extensions.node_start[k]
    work, log_det, condition = np.empty((r + b, 2 * b)), 0.0, 0.0
    for v in range(extensions.node_start[k + 1] - 1, first_new - 1, -1):
        new = extensions.order[v] - first_new
        e = extensions.stem[extensions.order[v]]
        outward = extensions.edges[e, 1] == n + extensions.order[v]
        parent = int(extensions.edges[e, 0 if outward else 1])
        copy_block(rows_j[e] if outward else rows_i[e], work, 0, 0)
        copy_block(rows_i[e] if outward else rows_j[e], work, 0, b)
        num_rows = r
        if forest.has_unary[new]:
            copy_block(forest.unary[new], work, r, 0)
            num_rows += b
            for c in range(b):
                for d in range(b):
                    work[r + c, b + d] = 0.0
        triangularise(work, num_rows, 2 * b, 2 * b if num_rows > b else b)
        forest.parent[new] = parent
        for c in range(b):
            log_det += 2 * math.log(abs(work[c, c]))
        for m in range(b):  # back substitution: N = T^-1, F = -T^-1 B
            for c in range(b - 1, -1, -1):
                noise, transfer = 1.0 if c == m else 0.0, -work[c, b + m]
                for d in range(c + 1, b):
                    noise -= work[c, d] * forest.noise[new, d, m]
                    transfer -= work[c, d] * forest.transfer[new, d, m]
                forest.noise[new, c, m] = noise / work[c, c]
                forest.transfer[new, c, m] = transfer / work[c, c]
        for c in range(b):
            column, row = 0.0, 0.0
            for d in range(b):
                column += work[d, c] ** 2
                row += forest.noise[new, c, d] ** 2
            condition += math.sqrt(column * row)
        if num_rows > b:
            count = leave_rest(work, b, min(num_rows, 2 * b), parent, n, parent - n - first_new, forest, blocks, count)
    return log_det, condition, count


@compiled
def compress_forest(extensions: Extensions, k: int, forest: Forest, blocks: Blocks, count: int) -> int:
    """Keep the nodes with closures and those where branches with closures meet; parent, F and N lead from one to the next.

    Returns how many are kept.
    """
    n, first_new = extensions.num_existing, extensions.node_start[k]
    b, num_new = forest.noise.shape[1], len(forest.parent)
    kept, branches = np.zeros(num_new, np.bool_), np.zeros(num_new, np.int64)
    for q in range(count):
        for side in range(2):
            if blocks.ends[q, side] >= n:
                kept[blocks.ends[q, side] - n - first_new] = True
    for v in range(num_new - 1, -1, -1):
        new = extensions.order[first_new + v] - first_new
        kept[new] |= branches[new] > 1
        above = forest.parent[new] - n - first_new
        if above >= 0 and (kept[new] or branches[new]):
            branches[above] += 1
    work, moved, columns = np.empty((2 * b, b)), np.empty((b, b)), 0
    for v in range(num_new):
        new = extensions.order[first_new + v] - first_new
        if kept[new]:
            forest.column[new] = columns
            columns += 1
        above = forest.parent[new] - n - first_new
        if above < 0 or kept[above] or not (kept[new] or branches[new]):
            continue
        for c in range(b):
            for d in range(b):
                moved[c, d], work[d, c], work[b + d, c] = 0.0, 0.0, forest.noise[new, c, d]
                for m in range(b):
                    moved[c, d] += forest.transfer[new, c, m] * forest.transfer[above, m, d]
                    work[d, c] += forest.transfer[new, c, m] * forest.noise[above, m, d]
        triangularise(work, 2 * b, b, b)
        for c in range(b):
            for d in range(b):
                forest.transfer[new, c, d] = moved[c, d]
                forest.noise[new, c, d] = work[d, c]
        forest.parent[new] = forest.parent[above]
    return columns


@compiled
def expand_blocks(
    extensions: Extensions, k: int, forest: Forest, blocks: Blocks, count: int, rows: FloatArray, widths: IntArray
) -> None:
    """Write blocks as rows on the kept noise and on existing nodes, which replace the blocks' ends and rows.

    Parameters
    ----------
    rows : shape (count b, columns b), out
        Zero on entry.
    widths : shape (count,), out
        Columns of each block's rows that may not be zero; zero on entry.
    """
    n, first_new = extensions.num_existing, extensions.node_start[k]
    b = forest.noise.shape[1]
    moved = np.empty((b, b))
    for q in range(count):
        for side in range(2):
            node = blocks.ends[q, side]
            while node >= n:
                new = node - n - first_new
                at = b * forest.column[new]
                widths[q] = max(widths[q], at + b)
                for c in range(b):
                    for d in range(b):
                        moved[c, d] = 0.0
                        for m in range(b):
                            rows[q * b + c, at + d] += blocks.rows[q, side, c, m] * forest.noise[new, m, d]
                            moved[c, d] += blocks.rows[q, side, c, m] * forest.transfer[new, m, d]
                for c in range(b):
                    for d in range(b):
                        blocks.rows[q, side, c, d] = moved[c, d]
                node = forest.parent[new]
            blocks.ends[q, side] = node
        if blocks.ends[q, 0] == blocks.ends[q, 1]:
            for c in range(b):
                for d in range(b):
                    blocks.rows[q, 0, c, d] += blocks.rows[q, 1, c, d]
            blocks.ends[q, 1] = -1


@compiled
def reduce_extension(
    extensions: Extensions, k: int, rows_i: FloatArray, rows_j: FloatArray, shift: float
) -> tuple[float, float, Blocks, FloatArray, IntArray]:
    """The steps above for one extension, in their order.

    Returns
    -------
    log_det, condition
        As `eliminate_forest` returns them.
    blocks
        On existing nodes alone. There is room for more than are used: their number is the length of `widths`.
    rows, widths
        As `expand_blocks` writes them.
    """
    r, b = rows_i.shape[1], rows_i.shape[2]
    num_edges = int(extensions.edge_start[k + 1] - extensions.edge_start[k])
    num_new = int(extensions.node_start[k + 1] - extensions.node_start[k])
    forest = new_forest(num_new, b, shift)
    blocks = new_blocks(2 * num_edges if r > b or shift > 0 else num_edges - num_new, b)
    count = reduce_closures(extensions, k, rows_i, rows_j, forest, blocks)
    log_det, condition, count = eliminate_forest(extensions, k, rows_i, rows_j, forest, blocks, count)
    columns = compress_forest(extensions, k, forest, blocks, count) if count > 0 else 0
    rows, widths = np.zeros((count * b, columns * b)), np.zeros(count, np.int64)
    expand_blocks(extensions, k, forest, blocks, count, rows, widths)
    return log_det, condition, blocks, rows, widths
