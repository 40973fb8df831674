"""Forms that are factored once and used often: log-determinant, and entries of the inverse between a few nodes.

A form's matrix M = l l^T is factored in b x b blocks along an elimination tree. (M^-1)_st = Y_s^T Y_t with Y_t = l^-1 E_t,
which is nonzero only on the elimination path of t (its *path*, for short), from t to the root of the tree. Stored root first,
two paths have in common what lies above their nodes' lowest common ancestor, so that an entry of the inverse is one contiguous
dot product.

The error estimate of ln det M is that of `log_det`, taken node by node. What is computed from paths belongs to the same
perturbed matrix M + E as ln det M, and forming the columns of l^-1 perturbs l once more, by no more than the factorisation
did: whatever adds information to M is known with twice the error of ln det M, for it only shrinks the inverse.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.linalg.block_cholesky import (
    Int32Array,
    assemble,
    copy_columns,
    factorize,
    inverse_columns,
    pull,
    solve,
)
from topobelief.linalg.compiled import compiled, in_parallel, num_threads
from topobelief.linalg.edge_form import EdgeForm
from topobelief.linalg.elimination_tree import EliminationTree, with_ancestors
from topobelief.linalg.estimate import UNIT_ROUNDOFF, Estimate
from topobelief.linalg.orthogonal import triangle_of_more_rows
from topobelief.linalg.strong_rows import StrongRows

_EXACT_VARIANCE_SIZE = 200  # the constants of log_det's estimate
_NUM_PROBES = 8
_PROBE_SAFETY = 2.0
_CONFIDENCE = 4.0
_ASSEMBLY_OPERATIONS = 16
_STRONG_ROWS_ERROR = 1e-4  # nats; beyond it one more factorisation with strong rows last is worth its time
_LEAST_WORK = 100_000  # block products below which a thread costs more than it saves


class Paths(NamedTuple):
    """Y_t = l^-1 E_t for some places t, root first.

    Attributes
    ----------
    places : shape (w,)
        Ascending.
    start : shape (w,)
        Y_t^T begins here in `values`: b rows of b length numbers.
    lengths : shape (w,)
        Nodes on each path, its own among them.
    shared : shape (w,)
        Nodes that the paths of a place and of the next one have in common; 0 for the last.
    """

    block_size: int
    places: IntArray
    start: IntArray
    lengths: IntArray
    shared: IntArray
    values: FloatArray

    def inverse_block(self, s: int, t: int) -> FloatArray:
        """(M^-1)_st of the s-th and t-th of the places, shape (b, b)."""
        b = self.block_size
        low, high = min(s, t), max(s, t)
        common = int(self.lengths[s]) if s == t else int(self.shared[low:high].min())
        left, right = (
            self.values[self.start[k] : self.start[k] + b * b * self.lengths[k]].reshape(b, -1)[:, : b * common] for k in (s, t)
        )
        return left @ right.T


@dataclass(frozen=True, eq=False, slots=True)
class FormFactor:
    """M = l l^T of a form on an elimination tree.

    Attributes
    ----------
    diagonal : shape (n, b, b), blocks : shape (nnz, b, b)
        l, by place.
    log_det
        ln det M, its multiplicity left out, and its error; inf where the factorisation broke down.
    """

    tree: EliminationTree
    diagonal: FloatArray
    blocks: FloatArray
    log_det: Estimate[float]

    @staticmethod
    @np.errstate(over="ignore", divide="ignore", invalid="ignore")  # what is not finite has an infinite error
    def of(tree: EliminationTree, form: EdgeForm, *, shift: float = 0.0, known: KnownColumns | None = None) -> FormFactor:
        """Factor the form's matrix plus `shift` times I.

        Parameters
        ----------
        tree
            Of the form's edges.
        form, shift
        known
            Columns of an earlier factor, of a graph that has grown, which are copied.
        """
        b, n = form.block_size, tree.num_free
        diagonal = np.zeros((n, b, b)) + shift * np.eye(b)
        blocks = np.zeros((len(tree.rows), b, b))
        rows_i, rows_j = np.ascontiguousarray(form.rows_i), np.ascontiguousarray(form.rows_j)
        assemble(tree.position, tree.edges, rows_i, rows_j, tree.start, tree.rows, diagonal, blocks)
        entries = np.diagonal(diagonal, axis1=1, axis2=2).copy()
        done = np.zeros(n, np.bool_) if known is None else known.copy_to(tree, diagonal, blocks)
        if not factorize((0,) * b, tree.start, tree.rows, done, diagonal, blocks):
            return FormFactor(tree, diagonal, blocks, Estimate(math.nan, math.inf))
        log_pivots = 2 * np.log(np.diagonal(diagonal, axis1=1, axis2=2)).ravel()
        factor = FormFactor(tree, diagonal, blocks, Estimate(math.fsum(log_pivots), 0.0))
        error = factor._rounding(form, entries, shift) + float(np.abs(log_pivots).sum())
        error = UNIT_ROUNDOFF * error + form.root_error
        return FormFactor(tree, diagonal, blocks, Estimate(factor.log_det.value, error if math.isfinite(error) else math.inf))

    @staticmethod
    @np.errstate(over="ignore", divide="ignore", invalid="ignore")
    def with_strong_rows_last(
        edges: IntArray, num_nodes: int, held: int, form: EdgeForm, *, shift: float = 0.0
    ) -> FormFactor | None:
        """The factor where a few rows are so much stronger than the others that their rounding errors would exceed these.

        The nodes of the strong rows come last. M_0, in which these rows are scaled down, is factored; then the difference is
        added to the dense part of the factor by orthogonal triangles. None where no rows are that strong, or too many.

        Parameters
        ----------
        edges, num_nodes, held
            As for `EliminationTree.build`.
        form, shift
        """
        strong = StrongRows.of(form)
        if strong is None:
            return None
        tree = EliminationTree.build(edges, num_nodes, held, last=np.unique(edges[strong.edge]))
        others = FormFactor.of(tree, strong.weakened, shift=shift)
        if not math.isfinite(others.log_det.error):
            return None
        return others._with_more_rows(strong)

    def or_with_strong_rows_last(self, form: EdgeForm, *, shift: float = 0.0) -> FormFactor:
        """This factor or, where its error is worth one more factorisation, the one with strong rows last, if that is better."""
        if self.log_det.error <= _STRONG_ROWS_ERROR:
            return self
        tree = self.tree
        apart = FormFactor.with_strong_rows_last(tree.edges, tree.num_nodes, tree.held, form, shift=shift)
        return min(self, apart or self, key=lambda candidate: candidate.log_det.error)

    @property
    def block_size(self) -> int:
        """b."""
        return self.diagonal.shape[1]

    def _with_more_rows(self, strong: StrongRows) -> FormFactor:
        """This factor with the rest of the strong rows added to the last nodes, whose part is dense."""
        tree, b = self.tree, self.block_size
        num_last = int(np.count_nonzero(tree.position[np.unique(tree.edges[strong.edge])] >= 0))
        first = tree.num_free - num_last
        triangle, rows, sizes = np.zeros((num_last * b, num_last * b)), *_on_last_nodes(tree, strong, first)
        nodes = triangle.reshape(num_last, b, num_last, b)
        for j in range(first, tree.num_free):
            nodes[j - first, :, j - first] = self.diagonal[j]
            nodes[j - first + 1 :, :, j - first] = self.blocks[tree.start[j] : tree.start[j + 1]]
        triangle, error = triangle_of_more_rows(triangle, rows, sizes)
        nodes = triangle.reshape(num_last, b, num_last, b)
        diagonal, blocks = self.diagonal.copy(), self.blocks.copy()
        for j in range(first, tree.num_free):
            diagonal[j] = nodes[j - first, :, j - first]
            blocks[tree.start[j] : tree.start[j + 1]] = nodes[j - first + 1 :, :, j - first]
        log_pivots = 2 * np.log(np.diagonal(diagonal, axis1=1, axis2=2)).ravel()
        error = self.log_det.error + UNIT_ROUNDOFF * (error + float(np.abs(log_pivots).sum()))
        value = math.fsum(log_pivots) if math.isfinite(error) else math.nan
        return FormFactor(tree, diagonal, blocks, Estimate(value, error if math.isfinite(error) else math.inf))

    def paths(self, places: IntArray) -> Paths:
        """Paths of some places, given in ascending order and without repetition.

        Parameters
        ----------
        places : shape (w,)
        """
        tree, b = self.tree, self.block_size
        sizes = tree.path_sizes(places, b)
        start = np.concatenate([[0], np.cumsum(sizes)])
        values = np.empty(int(start[-1]))

        def compute(first: int, last: int) -> None:
            part = places[first:last]
            needed = with_ancestors(tree.parent, part)
            arguments = (tree.start, tree.rows, tree.depth, self.diagonal, self.blocks, needed, part, values, start[first:last])
            inverse_columns((0,) * b, *arguments)

        in_parallel(compute, self._fair_bounds(places))
        shared = _shared_lengths(tree.parent, tree.depth, places)
        return Paths(b, places, start[:-1], tree.depth[places] + 1, shared, values)

    def _fair_bounds(self, places: IntArray) -> list[int]:
        """Where to cut a list of places so that every core has as much to do."""
        tree, parts = self.tree, num_threads()
        work = np.diff(tree.start) * (tree.depth + 1) * with_ancestors(tree.parent, places)
        total = np.cumsum(work)
        if len(total) == 0 or total[-1] < _LEAST_WORK:
            return [0, len(places)]
        cuts = np.searchsorted(total, total[-1:] * np.arange(1, parts) / parts)
        return [0, *np.searchsorted(places, cuts).tolist(), len(places)]

    def _rounding(self, form: EdgeForm, entries: FloatArray, shift: float) -> float:
        """Error of ln det in units of roundoff, without that of the logarithms; see `log_det`."""
        tree, b = self.tree, self.block_size
        variances = self._variances(form, shift)
        ends = tree.position[tree.edges.T.ravel()] + 1
        squares = np.concatenate([form.magnitude_i, form.magnitude_j]) ** 2
        magnitude = np.stack(
            [np.bincount(ends, weights=column, minlength=tree.num_free + 1)[1:] for column in squares.T], axis=1
        )
        factored = np.sum(entries * variances, axis=1)  # M_ii v_i^2, by place
        assembled = np.sum(magnitude * variances, axis=1)  # B_i v_i^2
        columns, coupled_to = _row_sums(tree.start, tree.rows, factored)
        operations = b * (columns + 1) + 1
        squares_of_factor = float((operations * factored) @ (2 * coupled_to + factored))
        padded = np.concatenate([[0.0], assembled])
        coupled = float(padded[ends[: len(tree.edges)]] @ padded[ends[len(tree.edges) :]] + assembled @ assembled)
        total = squares_of_factor + _ASSEMBLY_OPERATIONS * b * 2 * coupled
        return 2 * float(factored.sum() + assembled.sum()) + _CONFIDENCE * math.sqrt(2 * total)

    def _variances(self, form: EdgeForm, shift: float) -> FloatArray:
        """diag M^-1, shape (n, b): exact for small matrices, else from samples of covariance M^-1, with a safety factor."""
        tree, b = self.tree, self.block_size
        if tree.num_free * b <= _EXACT_VARIANCE_SIZE:
            return _squared_norms(self.paths(np.arange(tree.num_free)))
        rng = np.random.default_rng(0)
        num_edges, num_rows, _ = form.rows_i.shape
        samples = np.zeros((tree.num_free, b, _NUM_PROBES))
        signs = _random_signs(rng, (num_edges, num_rows, _NUM_PROBES))
        pull(tree.position, tree.edges, np.ascontiguousarray(form.rows_i), np.ascontiguousarray(form.rows_j), signs, samples)
        if shift:
            samples += math.sqrt(shift) * _random_signs(rng, samples.shape)
        solve(tree.start, tree.rows, self.diagonal, self.blocks, samples)
        return _PROBE_SAFETY / _NUM_PROBES * np.sum(samples**2, axis=2)


def _on_last_nodes(tree: EliminationTree, strong: StrongRows, first: int) -> tuple[FloatArray, FloatArray]:
    """The rest of the strong rows, and the sizes of the terms behind that, on the variables of the places from `first` on."""
    places = tree.position[tree.edges[strong.edge]] - first
    b = strong.rows_i.shape[1]
    rows, sizes = np.zeros((2, len(places), tree.num_free - first, b))
    for at, part, size in zip(places.T, (strong.rows_i, strong.rows_j), (strong.sizes_i, strong.sizes_j), strict=True):
        free = np.flatnonzero(at >= 0)
        rows[free, at[free]], sizes[free, at[free]] = part[free], size[free]
    return rows.reshape(len(places), -1), sizes.reshape(len(places), -1)


class KnownColumns(NamedTuple):
    """Columns of a factor that a grown graph leaves as they are: no node below them in the tree has changed.

    Attributes
    ----------
    factor
        Of the graph as it was, with the same shift.
    changed : shape (num_nodes of the grown graph,)
        Nodes at which an edge was added, removed or changed, and those beside a node that is or was held.
    """

    factor: FormFactor
    changed: BoolArray

    def copy_to(self, tree: EliminationTree, diagonal: FloatArray, blocks: FloatArray) -> BoolArray:
        """Put them into the factor of the grown graph; which ones, by place, shape (n,)."""
        old = self.factor
        if not math.isfinite(old.log_det.error):
            return np.zeros(tree.num_free, np.bool_)
        marked = np.flatnonzero(self.changed[tree.order])
        done = ~with_ancestors(tree.parent, marked)
        places = np.flatnonzero(done)
        before = old.tree.position[tree.order[places]]
        diagonal[places] = old.diagonal[before]
        copy_columns(tree.start, places, old.tree.start, before, old.blocks, blocks)
        return done


def changed_nodes(old: EdgeForm, new: EdgeForm, num_nodes: int, held: tuple[int, int]) -> BoolArray:
    """Nodes whose columns of a form's matrix a grown graph changes, shape (num_nodes,).

    Parameters
    ----------
    old, new
        The form on the graph as it was and as it is; edges that both have stand first, in the same order.
    num_nodes
        Now.
    held
        The nodes that were and are held.
    """
    changed = np.zeros(num_nodes, np.bool_)
    common = min(len(old.edges), len(new.edges))
    same = (old.edges[:common] == new.edges[:common]).all(axis=1)
    for before, after in ((old.rows_i, new.rows_i), (old.rows_j, new.rows_j)):
        same &= (before[:common] == after[:common]).all(axis=(1, 2))
    for edges in (old.edges, new.edges):
        touched = np.ones(len(edges), np.bool_)
        touched[:common] = ~same
        touched |= np.isin(edges, held).any(axis=1)
        changed[edges[touched]] = True
    return changed


def _random_signs(rng: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
    return np.where(rng.integers(2, size=shape, dtype=np.int8), 1.0, -1.0)


@compiled
def _squared_norms(paths: Paths) -> FloatArray:
    """Diagonal of M^-1 at some places, shape (w, b)."""
    b = paths.block_size
    norms = np.zeros((len(paths.places), b))
    for k in range(len(norms)):
        length = b * int(paths.lengths[k])
        for c in range(b):
            row = paths.values[paths.start[k] + c * length :]
            for m in range(length):
                norms[k, c] += row[m] * row[m]
    return norms


@compiled
def _row_sums(start: IntArray, rows: Int32Array, weights: FloatArray) -> tuple[IntArray, FloatArray]:
    """How many columns have a block in each row, and the sum of their weights."""
    count, total = np.zeros(len(weights), np.int64), np.zeros(len(weights))
    for j in range(len(weights)):
        for p in range(start[j], start[j + 1]):
            count[rows[p]] += 1
            total[rows[p]] += weights[j]
    return count, total


@compiled
def _shared_lengths(parent: IntArray, depth: IntArray, places: IntArray) -> IntArray:
    """Common nodes of the paths of consecutive places (ascending); 0 behind the last."""
    shared = np.zeros(len(places), np.int64)
    for k in range(len(places) - 1):
        a, b = places[k], places[k + 1]
        while a != b and a >= 0 and b >= 0:
            if a < b:
                a = parent[a]
            else:
                b = parent[b]
        shared[k] = depth[a] + 1 if a == b and a >= 0 else 0
    return shared
