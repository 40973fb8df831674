"""Forms factored once and asked often: log-determinant, and entries of the inverse between a few nodes.

A form's matrix M = l l^T is factored in b x b blocks along an elimination tree; one tree (order by approximate minimum
degree, qdldl) serves all forms on the same edges with the same node held. (M^-1)_st = Y_s^T Y_t with Y_t = l^-1 E_t, which
lives on the way from t to the root of the tree. Stored root first, two paths have in common what lies above their nodes'
lowest common ancestor, so that an entry of the inverse is one contiguous dot product.

The error estimate of ln det M is that of `log_det`, taken node by node. What is computed from paths belongs to the same
perturbed matrix M + E as ln det M, and forming the columns of l^-1 perturbs l once more, by no more than the factorisation
did: whatever adds information to M is known with twice the error of ln det M, for it only shrinks the inverse.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import qdldl
from scipy import sparse

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
from topobelief.linalg.compiled import compiled, in_parallel, num_threads, unset
from topobelief.linalg.edge_form import EdgeForm
from topobelief.linalg.log_det import UNIT_ROUNDOFF, LogDet

_QDLDL: Any = qdldl  # ships no types
_EXACT_VARIANCE_SIZE = 200  # the constants of log_det's estimate
_NUM_PROBES = 8
_PROBE_SAFETY = 2.0
_CONFIDENCE = 4.0
_ASSEMBLY_OPERATIONS = 16


@dataclass(frozen=True, eq=False, slots=True)
class EliminationTree:
    """The order in which nodes are eliminated, and what the factor of any form on these edges looks like.

    Attributes
    ----------
    edges : shape (m, 2)
    position : shape (num_nodes,)
        Place of each node in the elimination, a postorder of the tree; -1 for the node that is held.
    order : shape (n,)
        The node at each place.
    start : shape (n + 1,), rows : shape (nnz,)
        Compressed columns of the factor below its diagonal, by place; rows ascending.
    parent, depth : shape (n,)
        Place of the parent, -1 at a root; number of ancestors.
    num_appended
        Nodes that came last, after the rest was ordered to keep the factor sparse: all paths may be longer by so many.
    """

    edges: IntArray
    position: IntArray
    order: IntArray
    start: IntArray
    rows: Int32Array
    parent: IntArray
    depth: IntArray
    num_appended: int = 0

    @staticmethod
    def build(edges: IntArray, num_nodes: int, held: int) -> EliminationTree:
        """Order all nodes but the one that is held.

        Parameters
        ----------
        edges : shape (m, 2)
        num_nodes, held
        """
        free = np.flatnonzero(np.arange(num_nodes) != held)
        if len(free) == 0:
            return EliminationTree.of_order(edges, num_nodes, free)
        _, _, order = _QDLDL.Solver(_any_upper(edges, num_nodes, free), upper=True).factors()
        return EliminationTree.of_order(edges, num_nodes, free[np.asarray(order, dtype=np.int64)])

    @staticmethod
    def of_order(edges: IntArray, num_nodes: int, order: IntArray, *, num_appended: int = 0) -> EliminationTree:
        """The tree of a given order, which becomes a postorder with the same factor.

        Parameters
        ----------
        edges : shape (m, 2)
        num_nodes
        order
            Free nodes.
        num_appended
        """
        edges, position = edges.copy(), np.full(num_nodes, -1)
        position[order] = np.arange(len(order))
        start, rows = _factor_pattern(edges, position, len(order))
        postorder = _postorder(_parents(start, rows))
        start, rows = _permuted(start, rows, postorder)
        order = order[postorder]
        position[order] = np.arange(len(order))
        parent = _parents(start, rows)
        return EliminationTree(edges, position, order, start, rows, parent, _depths(parent), num_appended)

    def adapted(self, edges: IntArray, num_nodes: int, held: int) -> EliminationTree:
        """The tree of a grown graph, in which old nodes keep their order.

        New nodes that see no old one come first: they leave the rest of the factor as it is. The others come last, behind the
        node that was held.

        Parameters
        ----------
        edges : shape (m, 2)
            Of the grown graph.
        num_nodes
            Its nodes, the old ones first.
        held
            Node that is held now.
        """
        is_new = np.arange(num_nodes) >= self.num_nodes
        seeing = np.zeros(num_nodes, np.bool_)
        seeing[edges[is_new[edges].sum(axis=1) == 1]] = True
        inner, outer = np.flatnonzero(is_new & ~seeing), np.flatnonzero(is_new & seeing)
        order = np.concatenate([inner, self.order, np.flatnonzero(self.position < 0), outer])
        num_appended = self.num_appended + 1 + len(outer)
        return EliminationTree.of_order(edges, num_nodes, order[order != held], num_appended=num_appended)

    @property
    def num_nodes(self) -> int:
        """All of them."""
        return len(self.position)

    @property
    def held(self) -> int:
        """The node that is not eliminated."""
        return int(np.argmin(self.position))

    @property
    def longest_path(self) -> int:
        """Nodes on the way from the deepest node to its root."""
        return int(self.depth.max(initial=-1)) + 1

    @property
    def num_free(self) -> int:
        """n, nodes that are not held."""
        return len(self.parent)

    def path_sizes(self, places: IntArray, block_size: int) -> IntArray:
        """Numbers that the path of each place takes."""
        return block_size**2 * (self.depth[places] + 1)


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
    log_det: LogDet

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
            return FormFactor(tree, diagonal, blocks, LogDet(math.nan, math.inf))
        log_pivots = 2 * np.log(np.diagonal(diagonal, axis1=1, axis2=2)).ravel()
        factor = FormFactor(tree, diagonal, blocks, LogDet(math.fsum(log_pivots), 0.0))
        error = factor._rounding(form, entries, shift) + float(np.abs(log_pivots).sum())
        error = UNIT_ROUNDOFF * error + form.root_error
        return FormFactor(tree, diagonal, blocks, LogDet(factor.log_det.value, error if math.isfinite(error) else math.inf))

    @property
    def block_size(self) -> int:
        """b."""
        return self.diagonal.shape[1]

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
            needed = _with_ancestors(tree.parent, part)
            arguments = (tree.start, tree.rows, tree.depth, self.diagonal, self.blocks, needed, part, values, start[first:last])
            inverse_columns((0,) * b, *arguments)

        in_parallel(compute, self._fair_bounds(places))
        shared = _shared_lengths(tree.parent, tree.depth, places)
        return Paths(b, places, start[:-1], tree.depth[places] + 1, shared, values)

    def _fair_bounds(self, places: IntArray) -> list[int]:
        """Where to cut a list of places so that every core has as much to do."""
        tree, parts = self.tree, num_threads()
        work = np.diff(tree.start) * (tree.depth + 1) * _with_ancestors(tree.parent, places)
        total = np.cumsum(work)
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
            paths = self.paths(np.arange(tree.num_free))
            return np.array([np.diagonal(paths.inverse_block(t, t)) for t in range(tree.num_free)]).reshape(-1, b)
        rng = np.random.default_rng(0)
        num_edges, num_rows, _ = form.rows_i.shape
        samples = np.zeros((tree.num_free, b, _NUM_PROBES))
        signs = _random_signs(rng, (num_edges, num_rows, _NUM_PROBES))
        pull(tree.position, tree.edges, np.ascontiguousarray(form.rows_i), np.ascontiguousarray(form.rows_j), signs, samples)
        if shift:
            samples += math.sqrt(shift) * _random_signs(rng, samples.shape)
        solve(tree.start, tree.rows, self.diagonal, self.blocks, samples)
        return _PROBE_SAFETY / _NUM_PROBES * np.sum(samples**2, axis=2)


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
        done = ~_with_ancestors(tree.parent, marked)
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


def _any_upper(edges: IntArray, num_nodes: int, free: IntArray) -> sparse.csc_array:
    """Upper triangle of a well-conditioned matrix with the graph's pattern on the free nodes: a Laplacian plus I."""
    position = np.full(num_nodes, -1)
    position[free] = np.arange(len(free))
    low, high = np.sort(position[edges], axis=1).T
    pairs = np.unique(high[low >= 0] * len(free) + low[low >= 0])
    column, row = np.divmod(pairs, len(free))
    degrees = np.bincount(row, minlength=len(free)) + np.bincount(column, minlength=len(free))
    rows = np.concatenate([row, np.arange(len(free))])
    columns = np.concatenate([column, np.arange(len(free))])
    values = np.concatenate([np.full(len(pairs), -1.0), degrees + 1.0])
    return sparse.csc_array((values, (rows, columns)), shape=(len(free), len(free)))


@compiled
def _factor_pattern(edges: IntArray, position: IntArray, num_free: int) -> tuple[IntArray, Int32Array]:
    """Compressed columns of the factor in a given order, below its diagonal; rows in any order.

    The rows of a column are those of the matrix and those of its children in the tree.
    """
    later_start = np.zeros(num_free + 1, np.int64)
    for e in range(len(edges)):
        i, j = position[edges[e, 0]], position[edges[e, 1]]
        if i >= 0 and j >= 0:
            later_start[min(i, j) + 1] += 1
    for j in range(num_free):
        later_start[j + 1] += later_start[j]
    later, cursor = np.empty(later_start[num_free], np.int32), later_start[:-1].copy()
    for e in range(len(edges)):
        i, j = position[edges[e, 0]], position[edges[e, 1]]
        if i >= 0 and j >= 0:
            later[cursor[min(i, j)]] = max(i, j)
            cursor[min(i, j)] += 1
    child, sibling, seen = unset(num_free), unset(num_free), unset(num_free)
    start, rows, count = np.zeros(num_free + 1, np.int64), np.empty(4 * num_free + 1, np.int32), 0
    for j in range(num_free):
        most, c = later_start[j + 1] - later_start[j], child[j]
        while c >= 0:
            most += start[c + 1] - start[c]
            c = sibling[c]
        if count + most > len(rows):
            longer = np.empty(2 * (count + most), np.int32)
            longer[:count] = rows[:count]
            rows = longer
        seen[j], parent = j, num_free
        for p in range(later_start[j], later_start[j + 1]):
            row = later[p]
            if seen[row] != j:
                seen[row], rows[count], parent = j, row, min(parent, row)
                count += 1
        c = child[j]
        while c >= 0:
            for p in range(start[c], start[c + 1]):
                row = rows[p]
                if seen[row] != j:
                    seen[row], rows[count], parent = j, row, min(parent, row)
                    count += 1
            c = sibling[c]
        start[j + 1] = count
        if parent < num_free:
            sibling[j], child[parent] = child[parent], j
    return start, rows[:count].copy()


@compiled
def _parents(start: IntArray, rows: Int32Array) -> IntArray:
    """First row below the diagonal of each column; -1 where there is none."""
    parent = unset(len(start) - 1)
    for j in range(len(parent)):
        for p in range(start[j], start[j + 1]):
            if parent[j] < 0 or rows[p] < parent[j]:
                parent[j] = rows[p]
    return parent


@compiled
def _permuted(start: IntArray, rows: Int32Array, order: IntArray) -> tuple[IntArray, Int32Array]:
    """Columns in another order, one in which rows still stand below the diagonal; rows ascending."""
    n = len(order)
    place, new_start, new_rows = np.empty(n, np.int64), np.zeros(n + 1, np.int64), np.empty(len(rows), np.int32)
    for j in range(n):
        place[order[j]] = j
        new_start[j + 1] = new_start[j] + start[order[j] + 1] - start[order[j]]
    row_start = np.zeros(n + 1, np.int64)
    for row in rows:
        row_start[place[row] + 1] += 1
    for j in range(n):
        row_start[j + 1] += row_start[j]
    columns, cursor = np.empty(len(rows), np.int32), row_start[:-1].copy()
    for j in range(n):  # the columns of each row, ascending
        for p in range(start[order[j]], start[order[j] + 1]):
            row = place[rows[p]]
            columns[cursor[row]] = j
            cursor[row] += 1
    cursor = new_start[:-1].copy()
    for row in range(n):  # the rows of each column, ascending
        for p in range(row_start[row], row_start[row + 1]):
            new_rows[cursor[columns[p]]] = row
            cursor[columns[p]] += 1
    return new_start, new_rows


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
def _postorder(parent: IntArray) -> IntArray:
    """An order in which every subtree is contiguous and children stand before their parents; the identity if that is one."""
    n = len(parent)
    child, sibling = unset(n + 1), unset(n + 1)
    for j in range(n - 1, -1, -1):  # children in ascending order; roots hang on node n
        above = parent[j] if parent[j] >= 0 else n
        sibling[j], child[above] = child[above], j
    order, stack = np.empty(n, np.int64), np.empty(n + 1, np.int64)
    stack[0], height, placed = n, 1, 0
    while height:
        node = stack[height - 1]
        if child[node] >= 0:
            stack[height] = child[node]
            child[node] = sibling[child[node]]
            height += 1
        else:
            height -= 1
            if node < n:
                order[placed] = node
                placed += 1
    return order


@compiled
def _depths(parent: IntArray) -> IntArray:
    depth = np.zeros(len(parent), np.int64)
    for j in range(len(parent) - 1, -1, -1):
        if parent[j] >= 0:
            depth[j] = depth[parent[j]] + 1
    return depth


@compiled
def _with_ancestors(parent: IntArray, places: IntArray) -> BoolArray:
    """The places and all their ancestors, marked."""
    marked = np.zeros(len(parent), np.bool_)
    for place in places:
        node = place
        while node >= 0 and not marked[node]:
            marked[node] = True
            node = parent[node]
    return marked


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
