"""The order in which a sparse matrix is factored: an elimination tree, its postorder, and the factor's pattern.

One tree (order by approximate minimum degree, qdldl) serves all forms on the same edges with the same node held. A graph that
grows keeps its order: see `EliminationTree.adapted`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import qdldl
from scipy import sparse

from topobelief.arrays import BoolArray, IntArray
from topobelief.linalg.block_cholesky import Int32Array
from topobelief.linalg.compiled import compiled, unset

_QDLDL: Any = qdldl  # ships no types


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
        Nodes that came last, after the rest was ordered to keep the factor sparse: all elimination paths may be longer by so
        many.
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
    def build(edges: IntArray, num_nodes: int, held: int, *, last: IntArray | None = None) -> EliminationTree:
        """Order all nodes but the one that is held.

        Parameters
        ----------
        edges : shape (m, 2)
        num_nodes, held
        last
            Nodes that come last, and whose part of the factor is dense. Default: none.
        """
        is_free = np.arange(num_nodes) != held
        last = np.zeros(0, np.int64) if last is None else last[is_free[last]]
        is_free[last] = False
        free = np.flatnonzero(is_free)
        if len(free):
            _, _, order = _QDLDL.Solver(_any_upper(edges, num_nodes, free), upper=True).factors()
            free = free[np.asarray(order, dtype=np.int64)]
        return EliminationTree.of_order(edges, num_nodes, np.concatenate([free, last]), num_dense=len(last))

    @staticmethod
    def of_order(
        edges: IntArray, num_nodes: int, order: IntArray, *, num_appended: int = 0, num_dense: int = 0
    ) -> EliminationTree:
        """The tree of a given order, which becomes a postorder with the same factor.

        Parameters
        ----------
        edges : shape (m, 2)
        num_nodes
        order
            Free nodes.
        num_appended
        num_dense
            How many of the last nodes have a dense part of the factor; the postorder keeps their places.
        """
        edges, position = edges.copy(), np.full(num_nodes, -1)
        position[order] = np.arange(len(order))
        dense = order[len(order) - num_dense :]
        star = np.stack([np.full(num_dense, dense[0] if num_dense else -1), dense], axis=1)[1:]
        start, rows = _factor_pattern(np.concatenate([edges, star]), position, len(order))
        postorder = _postorder(_parents(start, rows))
        start, rows = _permuted(start, rows, postorder)
        order = order[postorder]
        position[order] = np.arange(len(order))
        parent = _parents(start, rows)
        return EliminationTree(edges, position, order, start, rows, parent, _depths(parent), num_appended)

    def adapted(self, edges: IntArray, num_nodes: int, held: int) -> EliminationTree:
        """The tree of a grown graph, in which old nodes keep their order.

        New nodes without an edge to an old one come first: they leave the rest of the factor as it is. The others come last,
        behind the node that was held.

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
        """Nodes on the longest elimination path."""
        return int(self.depth.max(initial=-1)) + 1

    @property
    def num_free(self) -> int:
        """n, nodes that are not held."""
        return len(self.parent)

    def path_sizes(self, places: IntArray, block_size: int) -> IntArray:
        """Numbers that the path of each place takes."""
        return block_size**2 * (self.depth[places] + 1)


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
def _postorder(parent: IntArray) -> IntArray:
    """An order in which every subtree is contiguous and children stand before their parents; the identity if that is one."""
    n = len(parent)
    child, sibling = unset(n + 1), unset(n + 1)
    for j in range(n - 1, -1, -1):  # children in ascending order; roots are children of node n
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
def with_ancestors(parent: IntArray, places: IntArray) -> BoolArray:
    """The places and all their ancestors, marked."""
    marked = np.zeros(len(parent), np.bool_)
    for place in places:
        node = place
        while node >= 0 and not marked[node]:
            marked[node] = True
            node = parent[node]
    return marked
