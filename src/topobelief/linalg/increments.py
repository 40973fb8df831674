"""What extensions of a graph add to the log-determinant of a form that is factored once.

With M the form's matrix on the existing nodes, one of them held, and M' the matrix of the extended graph,

    ln det M' = ln det M + ln det T + ln det (I + R),        R = V V^T + A M^-1 A^T.

T is the block of the new nodes with the forest's edges alone and the existing nodes held; [V A] are the closures as rows on the
independent unit noise of the forest's nodes, and on existing nodes, to which the forest leads them back. Both terms are
increments, never differences of two large numbers; entries of M^-1 come from paths in the elimination tree. With the existing
nodes held, ln det T + ln det (I + V V^T) is left, the block of the new nodes. Edges with more rows than variables are brought
to square rows; the rows left over touch one end alone, a new node where there is one.

A trace tr(C^T M^-1 C) falls by |L^-1 A Z|^2, where L L^T = I + R and Z = M^-1 C is known at the existing nodes.

Errors, beyond those of M (see `elimination_paths`), in units of roundoff times the roundings behind a number: R is off by E
with |E_pq| <= sqrt(S_p S_q), S the diagonal that R would have if no terms cancelled, and ln det (I + R) by tr((I + R)^-1 E),
about the sum of ((I + R)^-1)_pp S_p; ln det T by the condition numbers of the triangles whose product it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.linalg.chain_kernels import add_chained_increments
from topobelief.linalg.compiled import compiled, in_parallel, num_threads, unset
from topobelief.linalg.edge_form import EdgeForm
from topobelief.linalg.elimination_paths import FormFactor, Paths
from topobelief.linalg.estimate import UNIT_ROUNDOFF
from topobelief.linalg.extensions import Extensions
from topobelief.linalg.increment_kernels import add_diagonal_increments, add_increments

_PATH_NUMBERS = 8_000_000  # numbers a variable of a node that the paths of one group of extensions may take: 64 MB
_PARTS_PER_THREAD = 4
_LEAST_EDGES = 2000  # below so many edges of extensions a thread costs more than it saves
_OPERATIONS = 32  # roundings behind one term of R
_may_overflow = np.errstate(over="ignore", invalid="ignore")  # what is not finite is refused


@dataclass(frozen=True, eq=False, slots=True)
class Increments:
    """What each extension adds to ln det M, multiplicity left out; nan where rounding left no positive definite matrix.

    Attributes
    ----------
    forest : shape (K,)
        ln det T.
    closures : shape (K,)
        ln det (I + R).
    closures_held : shape (K,)
        ln det (I + V V^T): existing nodes held.
    first_rows, other_rows : shape (K,)
        ln det (I + R) of the first rows of each closure alone, and of the others.
    gains : shape (K,)
        By how much tr(C^T M^-1 C) falls, C the columns to which solutions Z = M^-1 C were given.
    chained : shape (K,)
        Sum over the closures, in the order of the path, of ln det of their conditional covariance given those of a window.
    error : shape (K,)
        Rounding of the sum, beyond twice the error of ln det M.

    What was not asked for is nan.
    """

    forest: FloatArray
    closures: FloatArray
    closures_held: FloatArray
    first_rows: FloatArray
    other_rows: FloatArray
    chained: FloatArray
    gains: FloatArray
    error: FloatArray


Wanted = Literal["closures", "parts"] | int
"""ln det (I + R); also of the first rows of each closure and of the others; or, for a window, `chained` and `other_rows`."""


@_may_overflow
def log_det_increments(
    factor: FormFactor | None,
    extensions: Extensions,
    form: EdgeForm,
    *,
    shift: float = 0.0,
    wanted: Wanted = "closures",
    first_rows: int = 0,
    solutions: FloatArray | None = None,
    wanted_of: BoolArray | None = None,
) -> Increments:
    """Increments of ln det M by each extension.

    Parameters
    ----------
    factor
        Of the form on the existing graph. None: all existing nodes are held.
    extensions
    form
        Rows of the extensions' edges.
    shift
        As in the factor: added to the diagonal of new nodes.
    wanted
        For parts and a window, rows are square and no row of a closure but the first ones touches variables of their number.
    first_rows
        How many of a closure's rows come first.
    solutions : shape (num_existing, b, s), optional
        Z, where gains are wanted; not for a window.
    wanted_of : shape (K,), optional
        Extensions whose increments are wanted; those of the others are nan. Default: all.
    """
    out = np.zeros((extensions.num_extensions, 8))
    if wanted_of is not None:
        out[~wanted_of] = np.nan
    columns = np.zeros((0, form.block_size, 0)) if solutions is None else solutions
    rows_i, rows_j = np.ascontiguousarray(form.rows_i), np.ascontiguousarray(form.rows_j)
    path_of = np.full(extensions.num_existing, -1)

    def add_group(which: IntArray) -> None:
        paths = _no_paths(form.block_size) if factor is None else _paths(factor, extensions, which, path_of)

        def add(first: int, last: int) -> None:
            part = which[first:last]
            if isinstance(wanted, int):
                add_chained_increments(extensions, rows_i, rows_j, path_of, paths, first_rows, wanted, part, out)
            else:
                split = first_rows if wanted == "parts" else 0
                add_increments(extensions, rows_i, rows_j, shift, path_of, paths, split, columns, part, out)

        parts = min(len(which), _PARTS_PER_THREAD * num_threads()) if len(extensions.edges) >= _LEAST_EDGES else 1
        in_parallel(add, np.linspace(0, len(which), parts + 1).astype(int).tolist())

    for which in [np.arange(extensions.num_extensions)] if factor is None else _groups(factor, extensions):
        add_group(which if wanted_of is None else which[wanted_of[which]])
    forest, closures, held, first, others, chained, size, gains = np.ascontiguousarray(out.T)
    error = UNIT_ROUNDOFF * (_OPERATIONS * size + np.abs(forest) + np.abs(closures) + np.abs(chained))
    error += _root_errors(form, extensions)
    unknown = np.full(extensions.num_extensions, np.nan)
    if isinstance(wanted, int):
        return Increments(forest, unknown, unknown, unknown, others, chained, unknown, error)
    if wanted == "closures":
        first = others = unknown
    return Increments(forest, closures, held, first, others, unknown, unknown if solutions is None else gains, error)


@_may_overflow
def diagonal_increments(
    existing: EdgeForm, held: int, extensions: Extensions, form: EdgeForm, shift: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """What each extension adds to the sum of ln det of the diagonal blocks, and its rounding error, each of shape (K,).

    Parameters
    ----------
    existing
        The form on the existing graph.
    held
        Node whose block is left out.
    extensions
    form
        Rows of the extensions' edges.
    shift : shape (K,)
        Added to the diagonal of all blocks, of existing and new nodes.
    """
    b = form.block_size
    diagonal = np.zeros((extensions.num_existing, b, b))
    for ends, rows in zip(existing.edges.T, (existing.rows_i, existing.rows_j), strict=True):
        np.add.at(diagonal, ends, rows.transpose(0, 2, 1) @ rows)
    out = np.zeros(extensions.num_extensions)
    rows_i, rows_j = np.ascontiguousarray(form.rows_i), np.ascontiguousarray(form.rows_j)
    add_diagonal_increments(extensions, rows_i, rows_j, shift, diagonal, held, out)
    terms = 2 * np.diff(extensions.edge_start) * b * b
    return out, UNIT_ROUNDOFF * (_OPERATIONS * terms + np.abs(out)) + _root_errors(form, extensions)


def _root_errors(form: EdgeForm, extensions: Extensions) -> FloatArray:
    """Sum of the form's root errors over the edges of each extension, shape (K,)."""
    if form.root_errors is None:
        return np.zeros(extensions.num_extensions)
    which = np.repeat(np.arange(extensions.num_extensions), np.diff(extensions.edge_start))
    return np.bincount(which, weights=form.root_errors, minlength=extensions.num_extensions).astype(np.float64)


def _no_paths(block_size: int) -> Paths:
    none = np.zeros(0, np.int64)
    return Paths(block_size, none, none, none, none, np.zeros(0))


def _paths(factor: FormFactor, extensions: Extensions, which: IntArray, path_of: IntArray) -> Paths:
    """Paths of the existing nodes that some extensions touch; `path_of` is updated."""
    places = _touched(extensions.edges, extensions.edge_start, factor.tree.position, which)
    path_of[:] = -1
    path_of[factor.tree.order[places]] = np.arange(len(places))
    return factor.paths(places)


def _groups(factor: FormFactor, extensions: Extensions) -> list[IntArray]:
    """Extensions in groups whose paths fit into memory; neighbours in the tree stand together, so that they share paths."""
    tree = factor.tree
    ends = extensions.edges.ravel()
    place = np.where(ends < extensions.num_existing, tree.position[np.minimum(ends, extensions.num_existing - 1)], -1)
    sums = np.concatenate([[0], np.cumsum(np.maximum(place, 0))])
    counts = np.concatenate([[0], np.cumsum(place >= 0)])
    first, last = 2 * extensions.edge_start[:-1], 2 * extensions.edge_start[1:]
    which = np.argsort((sums[last] - sums[first]) / np.maximum(counts[last] - counts[first], 1), kind="stable")
    b, sizes = factor.block_size, tree.path_sizes(np.arange(tree.num_free), factor.block_size)
    return np.split(which, _cuts(extensions.edges, extensions.edge_start, tree.position, which, sizes, b * _PATH_NUMBERS))


@compiled
def _touched(edges: IntArray, edge_start: IntArray, position: IntArray, which: IntArray) -> IntArray:
    """Places of the existing nodes that some extensions touch, ascending."""
    marked = np.zeros(len(position), np.bool_)
    for k in which:
        for e in range(edge_start[k], edge_start[k + 1]):
            for side in range(2):
                if edges[e, side] < len(position) and position[edges[e, side]] >= 0:
                    marked[position[edges[e, side]]] = True
    places, count = np.empty(len(position), np.int64), 0
    for place in range(len(position)):
        if marked[place]:
            places[count] = place
            count += 1
    return places[:count].copy()


@compiled
def _cuts(edges: IntArray, edge_start: IntArray, position: IntArray, which: IntArray, sizes: IntArray, limit: int) -> IntArray:
    """Where to cut a list of extensions so that the paths of each piece take no more than `limit` numbers."""
    cuts, piece, total = np.empty(len(which), np.int64), 0, 0
    seen = unset(len(position))  # the last piece that touches a node
    for n in range(len(which)):
        added = 0
        for _ in range(2):
            added = 0
            for e in range(edge_start[which[n]], edge_start[which[n] + 1]):
                for side in range(2):
                    node = edges[e, side]
                    if node < len(position) and position[node] >= 0 and seen[node] != piece:
                        seen[node] = piece
                        added += sizes[position[node]]
            if total == 0 or total + added <= limit:
                break
            cuts[piece] = n
            piece, total = piece + 1, 0
        total += added
    return cuts[:piece]
