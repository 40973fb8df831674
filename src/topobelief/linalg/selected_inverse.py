"""Diagonal blocks of the inverse of a form that is factored along an elimination tree, without any solution.

With M = l l^T and W = l_Rj l_jj^-1 of a column j with rows R, the blocks of Z = M^-1 at the factor's own entries follow from
those of j's ancestors (Takahashi, Fagan and Chen 1973; Erisman and Tinney 1975),

    Z_Rj = -Z_RR W,        Z_jj = l_jj^-T l_jj^-1 - W^T Z_Rj,

so that all of them cost about as much as the factor did, and those of a few nodes what their ancestors cost. Z_jj is a sum of
positive semidefinite terms: nothing cancels.
"""

from __future__ import annotations

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.linalg.block_cholesky import Int32Array
from topobelief.linalg.compiled import compiled
from topobelief.linalg.elimination_paths import FormFactor
from topobelief.linalg.elimination_tree import with_ancestors
from topobelief.linalg.estimate import UNIT_ROUNDOFF, Estimate
from topobelief.linalg.inverse import Projection
from topobelief.linalg.solutions import inverse_trace

_CANCELLED = 1e-3  # relative error beyond which the columns of the projection are solved for, so that nothing cancels
_OPERATIONS = 32


def inverse_diagonal(factor: FormFactor, nodes: IntArray) -> FloatArray:
    """(M^-1)_ii at some nodes, shape (t, b, b); 0 where a node is held."""
    tree, b = factor.tree, factor.block_size
    places = tree.position[nodes]
    free = places >= 0
    diagonal, blocks = np.zeros_like(factor.diagonal), np.empty_like(factor.blocks)
    needed = with_ancestors(tree.parent, places[free])
    _select((0,) * b, tree.start, tree.rows, needed, factor.diagonal, factor.blocks, diagonal, blocks)
    result = np.zeros((len(nodes), b, b))
    result[free] = diagonal[places[free]]
    return result


def projected_trace(factor: FormFactor, projection: Projection) -> Estimate[float]:
    """tr(Pi M^-1 Pi) = sum of the variances less tr(U^T M^-1 U)."""
    k = projection.directions.shape[1]
    variances = np.diagonal(inverse_diagonal(factor, projection.nodes), axis1=1, axis2=2)[:, :k]
    along = np.zeros((len(variances), factor.block_size, projection.directions.shape[2]))
    along[:, :k] = projection.directions
    total, taken = float(variances.sum()), inverse_trace(factor, projection.nodes, along)
    error = (2 * factor.log_det.error + _OPERATIONS * UNIT_ROUNDOFF) * (total + taken.value)
    if error <= _CANCELLED * (total - taken.value):
        return Estimate(total - taken.value, error)
    return inverse_trace(factor, projection.nodes, projection.columns(factor.block_size))


@compiled
def _select(
    axes: tuple[int, ...],
    start: IntArray,
    rows: Int32Array,
    needed: BoolArray,
    diagonal: FloatArray,
    blocks: FloatArray,
    inverse_diagonal: FloatArray,
    inverse_blocks: FloatArray,
) -> None:
    """Blocks of the inverse in the columns that are needed: a set of places with all their ancestors."""
    b, longest = len(axes), 0
    for j in range(len(diagonal)):
        longest = max(longest, start[j + 1] - start[j])
    w, z = np.empty((longest, b, b)), np.empty((longest, b, b))
    root = np.zeros((b, b))  # l_jj^-1
    for j in range(len(diagonal) - 1, -1, -1):
        if not needed[j]:
            continue
        first, count = start[j], start[j + 1] - start[j]
        for c in range(b):
            root[c, c] = 1.0 / diagonal[j, c, c]
            for r in range(c + 1, b):
                total = 0.0
                for m in range(c, r):
                    total -= diagonal[j, r, m] * root[m, c]
                root[r, c] = total / diagonal[j, r, r]
        for p in range(count):
            for r in range(b):
                for c in range(b):
                    total = 0.0
                    for m in range(c, b):
                        total += blocks[first + p, r, m] * root[m, c]
                    w[p, r, c], z[p, r, c] = total, 0.0
        for p in range(count):
            k = rows[first + p]
            for r in range(b):
                for c in range(b):
                    for m in range(b):
                        z[p, r, c] -= inverse_diagonal[k, r, m] * w[p, m, c]
            at = start[k]
            for q in range(p + 1, count):  # the rows of j beyond k are among those of k
                while rows[at] != rows[first + q]:
                    at += 1
                for r in range(b):
                    for c in range(b):
                        below, above = 0.0, 0.0
                        for m in range(b):
                            below += inverse_blocks[at, r, m] * w[p, m, c]
                            above += inverse_blocks[at, m, r] * w[q, m, c]
                        z[q, r, c] -= below
                        z[p, r, c] -= above
        for r in range(b):
            for c in range(b):
                total = 0.0
                for m in range(max(r, c), b):
                    total += root[m, r] * root[m, c]
                for p in range(count):
                    for m in range(b):
                        total -= w[p, m, r] * z[p, m, c]
                inverse_diagonal[j, r, c] = total
        inverse_blocks[first : first + count] = z[:count]
