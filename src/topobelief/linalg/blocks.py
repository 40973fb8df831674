"""The biconnected blocks of a graph, and the graph cut into them.

A block is a largest set of edges any two of which lie on a common cycle, or a single edge (a bridge), parallel edges counted
as one. Blocks share no more than one node with each other, their cut nodes. Of a form for which it does not matter which
node is held (`EdgeForm.gauge_free`), ln det is the sum over the blocks, one node of each held (docs, the mathematics,
section 4). Found by depth-first search (Hopcroft and Tarjan, Algorithm 447, Comm. ACM 16, 1973).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from topobelief.arrays import BoolArray, IntArray
from topobelief.linalg.edge_form import EdgeForm


@dataclass(frozen=True, slots=True)
class CutGraph:
    """A graph cut at its cut nodes: a node stands once in each of its blocks, so that blocks have no node in common.

    All held nodes count as one.

    Attributes
    ----------
    is_grounded
        Whether every free node is connected to a held one.
    kept : shape (m',)
        Edges that lie in a block, block by block; those between held nodes lie in none.
    edges : shape (m', 2)
        The same between the nodes of the cut graph.
    block_of_edge : shape (m',)
        Ascending.
    node, block_of_node : shape (n',)
        What each one is in the graph (num_nodes stands for all held nodes), and its block.
    is_bridge : shape (m',)
        Edges that are a block on their own.
    ground : shape (B,)
        The node of each block that has to be held; -1 where any one may be.
    """

    is_grounded: bool
    kept: IntArray
    edges: IntArray
    block_of_edge: IntArray
    node: IntArray
    block_of_node: IntArray
    is_bridge: BoolArray
    ground: IntArray

    @staticmethod
    def of(edges: IntArray, free: BoolArray) -> CutGraph:
        """Cut a graph whose nodes that are not `free` are held.

        Parameters
        ----------
        edges : shape (m, 2)
        free : shape (num_nodes,)
        """
        held = len(free)
        joined = np.where(free[edges], edges, held)
        kept = np.flatnonzero(joined[:, 0] != joined[:, 1])
        block_of_edge, num_blocks = blocks_of_edges(joined[kept], held + 1)
        order = np.argsort(block_of_edge, kind="stable")
        kept, block_of_edge = kept[order], block_of_edge[order]
        keys, cut = np.unique(block_of_edge[:, None] * (held + 1) + joined[kept], return_inverse=True)
        block_of_node, node = np.divmod(keys, held + 1)
        num_free = int(np.count_nonzero(free))
        ground = np.full(num_blocks, -1)
        if len(free) - num_free > 1:  # many nodes at once cannot be exchanged for another one
            at_held = np.flatnonzero(node == held)
            ground[block_of_node[at_held]] = at_held
        is_bridge = np.bincount(block_of_edge, minlength=num_blocks)[block_of_edge] == 1
        is_grounded = len(keys) - num_blocks == num_free  # what is not connected to a held node misses one
        return CutGraph(is_grounded, kept, cut.reshape(-1, 2), block_of_edge, node, block_of_node, is_bridge, ground)

    def held_nodes(self, form: EdgeForm) -> IntArray:
        """The node that each block holds, shape (B,): the one with the strongest rows where there is a choice.

        Parameters
        ----------
        form
            Rows of all edges of the graph, before it was cut.
        """
        weights = form.between(self.kept, self.edges).end_strengths()
        order = np.argsort(np.bincount(self.edges.T.ravel(), weights=weights, minlength=len(self.block_of_node)), kind="stable")
        strongest = np.empty(len(self.ground), np.int64)
        strongest[self.block_of_node[order]] = order  # the last one of each block stays
        return np.where(self.ground >= 0, self.ground, strongest)


def blocks_of_edges(edges: IntArray, num_nodes: int) -> tuple[IntArray, int]:
    """The block of each edge, numbered from 0, shape (m,), and how many there are.

    Parameters
    ----------
    edges : shape (m, 2)
        No self-loops.
    num_nodes
        Nodes may be isolated, and the graph disconnected.
    """
    if len(edges) == 0:
        return np.zeros(0, np.int64), 0
    place, block_of_node = _search(edges, num_nodes)
    ends = place[edges]
    lower = edges[np.arange(len(edges)), np.argmax(ends, axis=1)]  # an edge lies in the block in which its lower end was found
    found, block_of_edge = np.unique(block_of_node[lower], return_inverse=True)
    return block_of_edge, len(found)


def _search(edges: IntArray, num_nodes: int) -> tuple[IntArray, IntArray]:
    """Depth-first search: when each node is found, and the block of the tree edge that leads to it.

    Tree edges whose lower ends cannot climb above their upper ends begin a block; those below belong to it unless they begin
    one too. Python lists, for single entries of arrays take longer.
    """
    adjacency = sparse.csr_array(
        (np.ones(2 * len(edges), np.int8), (edges.T.ravel(), edges[:, ::-1].T.ravel())), shape=(num_nodes, num_nodes)
    )
    indices: list[int] = adjacency.indices.tolist()
    following: list[int] = adjacency.indptr[:-1].tolist()
    ends: list[int] = adjacency.indptr[1:].tolist()
    place, parent, order = [-1] * num_nodes, [-1] * num_nodes, list[int]()
    highest = [num_nodes] * num_nodes  # the earliest node that an edge from below a node leads to
    for root in range(num_nodes):
        if place[root] >= 0:
            continue
        place[root] = len(order)
        order.append(root)
        node = root
        while node >= 0:
            at = following[node]
            if at < ends[node]:
                following[node] = at + 1
                other = indices[at]
                if place[other] < 0:
                    place[other] = len(order)
                    order.append(other)
                    parent[other] = node
                    node = other
                elif place[other] < highest[node] and other != parent[node]:
                    highest[node] = place[other]
            else:
                above = parent[node]
                if above >= 0 and highest[node] < highest[above]:
                    highest[above] = highest[node]
                node = above
    block = [-1] * num_nodes
    for node in order:
        above = parent[node]
        if above >= 0:
            begins = highest[node] >= place[above]
            block[node] = node if begins else block[above]
    return np.array(place), np.array(block)
