"""The walks of a roadmap as paths through layers of length delta.

A walk that has come s metres (from the pose that the robot was at) when it reaches vertex v is at the state (v, k) with k
delta <= s < (k + 1) delta. A way of length l leads from there to the layer of s + l, one of two: which one depends on where
in its layer s lies, of which a state knows an interval. So every walk is a path through the layers, and some paths through
them are no walks: they take the lower layer too often, which saves up to delta a way. What a path is told of the length
that it truly has (`Arcs.way`) lets whoever weighs arcs charge for it.

Each piece of each way has a label, the cell of the plane in which it is. A state also knows the label of the pose that was
dropped last, so that an arc knows from which cell to which the odometry of the poses that it drops leads.

spacing = m delta. A way from layer k to layer k' drops the new poses t with k < t m <= k', the t-th on the piece t m - k of the
way (`ways`), whatever s is. The last pose stands at the walk's end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.linalg.block_cholesky import Int32Array
from topobelief.linalg.compiled import compiled
from topobelief.search.bound import Check, unchecked
from topobelief.search.ways import Ways, first_pieces

_TIE = 1e-9  # of a layer: lengths that differ by less are equal


@dataclass(frozen=True, slots=True)
class Records:
    """New poses that arcs drop: number t = 1, 2, …, the way and its piece (counted from 0) on which the pose stands, and the
    label of the pose before it (0 for the one where the robot is)."""

    number: Int32Array
    way: Int32Array
    piece: Int32Array
    before: Int32Array


@dataclass(frozen=True, slots=True)
class Arcs:
    """Arcs between states k S + s at spot s of S, a vertex and a last label, and layer k; those of lower layers first.

    Attributes
    ----------
    source, target : shape (A,)
        States; the target of an arc that ends a walk is -1.
    way : shape (A,)
        Which way is driven; -1 for the walk that stays where it is.
    record, count : shape (A,)
        The poses dropped are count records from `record` on.
    end : shape (A,)
        Record of a pose at the end of the walk, -1 for none.
    last : shape (A,)
        Number of the walk's last pose where the arc ends it, else -1.
    """

    source: Int32Array
    target: Int32Array
    way: Int32Array
    record: Int32Array
    count: Int32Array
    end: Int32Array
    last: Int32Array


@dataclass(frozen=True, slots=True)
class Layers:
    """All arcs that some walk within the length may take.

    Attributes
    ----------
    num_spots, num_layers
        S: pairs of a vertex and a label that some walk has there.
    num_labels
        C.
    pieces_per_pose
        m.
    first_vertex
    first_state
        Where walks begin.
    whole_layers : shape (E,)
        How many whole layers each way is long.
    """

    num_spots: int
    num_layers: int
    num_labels: int
    pieces_per_pose: int
    first_vertex: int
    first_state: int
    whole_layers: Int32Array
    arcs: Arcs
    records: Records


def build_layers(
    ways: Ways,
    first_vertex: int,
    to_go: FloatArray,
    is_end: BoolArray,
    max_length: float,
    delta: float,
    pieces_per_pose: int,
    labels: Int32Array,
    check: Check = unchecked,
) -> Layers:
    """The layers of the walks from a vertex.

    Parameters
    ----------
    ways
        Between vertices 0 … V - 1.
    first_vertex
    to_go : shape (V,)
        Length of the shortest way to an end from each vertex, metres; inf where there is none.
    is_end : shape (V,)
        Where walks may end.
    max_length
        Metres, counted from the first vertex.
    delta, pieces_per_pose
    labels : shape (P,)
        Of the pieces of all ways (`ways.first_pieces`), from 0 on.
    check
    """
    num_vertices, num_labels = len(to_go), int(labels.max()) + 1
    first = first_pieces(ways.lengths, delta)
    vertex, label = np.nonzero(_is_spot(ways, first_vertex, num_vertices, labels, delta, pieces_per_pose))
    spot = np.full((num_vertices, num_labels), -1, dtype=np.int64)
    spot[vertex, label] = np.arange(len(vertex))
    num_layers = int(np.floor(max_length / delta + 1e-6)) + 1
    order = np.argsort(ways.source, kind="stable")
    out = np.searchsorted(ways.source[order], np.arange(num_vertices + 1))
    reach = (out, order, ways.target, ways.lengths, to_go, labels, first, vertex, label, spot, pieces_per_pose)
    begin = int(spot[first_vertex, 0])
    nearest, furthest = _reached(*reach, begin, num_layers, delta, max_length)
    check()
    sizes = _arcs(*reach, is_end, nearest, furthest, delta, max_length, begin, False, *_room(0, 0))
    check()
    arcs, records = _room(sizes[0], sizes[1])
    _arcs(*reach, is_end, nearest, furthest, delta, max_length, begin, True, arcs, records)
    whole = np.maximum(np.floor(ways.lengths / delta - _TIE), 0).astype(np.int32)
    return Layers(
        len(vertex), num_layers, num_labels, pieces_per_pose, first_vertex, begin, whole, Arcs(*arcs), Records(*records)
    )


def num_spots(ways: Ways, first_vertex: int, labels: Int32Array, delta: float, pieces_per_pose: int) -> int:
    """How many pairs of a vertex and a label layers would have."""
    num_vertices = int(max(ways.source.max(), ways.target.max(), first_vertex)) + 1
    return int(np.count_nonzero(_is_spot(ways, first_vertex, num_vertices, labels, delta, pieces_per_pose)))


def _is_spot(
    ways: Ways, first_vertex: int, num_vertices: int, labels: Int32Array, delta: float, pieces_per_pose: int
) -> BoolArray:
    """Which label some walk's last pose may have at each vertex, shape (V, C)."""
    first, num_labels = first_pieces(ways.lengths, delta), int(labels.max()) + 1
    since = _since_label(ways.source, ways.target, ways.lengths, labels, first, delta, num_vertices, num_labels, first_vertex)
    return since <= delta * pieces_per_pose * (1 + 1e-6) + 1e-6


def _room(num_arcs: int, num_records: int) -> tuple[Int32Array, Int32Array]:
    return np.empty((7, num_arcs), np.int32), np.empty((4, num_records), np.int32)


@compiled
def _since_label(
    source: IntArray,
    target: IntArray,
    lengths: FloatArray,
    labels: Int32Array,
    first: IntArray,
    delta: float,
    num_vertices: int,
    num_labels: int,
    first_vertex: int,
) -> FloatArray:
    """Least metres driven since a piece with a label, shape (V, C); the first vertex has label 0."""
    since = np.full((num_vertices, num_labels), np.inf)
    since[first_vertex, 0] = 0.0
    for e in range(len(lengths)):
        for p in range(first[e], first[e + 1]):
            left = max(lengths[e] - (p - first[e] + 1) * delta, 0.0)
            since[target[e], labels[p]] = min(since[target[e], labels[p]], left)
    again = True
    while again:
        again = False
        for e in range(len(lengths)):
            for c in range(num_labels):
                if since[source[e], c] + lengths[e] < since[target[e], c]:
                    since[target[e], c] = since[source[e], c] + lengths[e]
                    again = True
    return since


@compiled
def _reached(
    out: IntArray,
    order: IntArray,
    target: IntArray,
    lengths: FloatArray,
    to_go: FloatArray,
    labels: Int32Array,
    first: IntArray,
    vertex: IntArray,
    label: IntArray,
    spots: IntArray,
    m: int,
    begin: int,
    num_layers: int,
    delta: float,
    max_length: float,
) -> tuple[FloatArray, FloatArray]:
    """Least and largest length at which walks reach each state, shape (layers, S); inf and -inf for none."""
    num_spots = len(vertex)
    nearest, furthest = np.full((num_layers, num_spots), np.inf), np.full((num_layers, num_spots), -np.inf)
    nearest[0, begin] = furthest[0, begin] = 0.0
    for k in range(num_layers):
        again = True
        while again:
            again = False
            for spot in range(num_spots):
                if nearest[k, spot] == np.inf:
                    continue
                v, c = vertex[spot], label[spot]
                for r in range(out[v], out[v + 1]):
                    e = order[r]
                    w, low, high = target[e], nearest[k, spot] + lengths[e], furthest[k, spot] + lengths[e]
                    for q in range(int(low / delta + 1e-9), int(high / delta + 1e-9) + 1):
                        at = max(low, q * delta)
                        if q >= num_layers or not at + to_go[w] <= max_length * (1.0 + 1e-12) + 1e-9:
                            break
                        to = spots[w, labels[first[e] + q // m * m - k - 1] if q // m > k // m else c]
                        if to < 0:
                            continue
                        if at < nearest[q, to]:
                            again = again or (q == k and at < nearest[q, to] - 1e-12)
                            nearest[q, to] = at
                        upto = (q + 1 - 1e-8) * delta
                        upto = upto if q == k else min(high, upto)
                        if upto > furthest[q, to]:
                            again = again or q == k
                            furthest[q, to] = upto
    return nearest, furthest


@compiled
def _arcs(
    out: IntArray,
    order: IntArray,
    target: IntArray,
    lengths: FloatArray,
    to_go: FloatArray,
    labels: Int32Array,
    first: IntArray,
    vertex: IntArray,
    label: IntArray,
    spots: IntArray,
    m: int,
    is_end: BoolArray,
    nearest: FloatArray,
    furthest: FloatArray,
    delta: float,
    max_length: float,
    begin: int,
    fill: bool,
    arcs: Int32Array,
    records: Int32Array,
) -> tuple[int, int]:
    """Count the arcs and records, and put them into the tables if asked to."""
    num_layers, num_spots = nearest.shape
    a = r = 0
    if is_end[vertex[begin]]:
        if fill:
            arcs[0, a], arcs[1, a], arcs[2, a], arcs[3, a], arcs[4, a], arcs[5, a], arcs[6, a] = (
                begin,
                -1,
                -1,
                0,
                0,
                -1,
                0,
            )
        a += 1
    for k in range(num_layers):
        for spot in range(num_spots):
            if nearest[k, spot] == np.inf:
                continue
            v, c = vertex[spot], label[spot]
            for o in range(out[v], out[v + 1]):
                e = order[o]
                w, low, high = target[e], nearest[k, spot] + lengths[e], furthest[k, spot] + lengths[e]
                record, lowest = r, int(low / delta + 1e-9)
                highest = min(int(high / delta + 1e-9), num_layers - 1)
                while highest >= lowest and not max(low, highest * delta) + to_go[w] <= max_length * (1.0 + 1e-12) + 1e-9:
                    highest -= 1
                if highest < lowest:
                    continue
                before = c
                for t in range(k // m + 1, highest // m + 1):
                    if fill:
                        records[0, r], records[1, r], records[2, r], records[3, r] = t, e, t * m - k - 1, before
                    before = labels[first[e] + t * m - k - 1]
                    r += 1
                for q in range(lowest, highest + 1):
                    count = q // m - k // m
                    before = labels[first[e] + q // m * m - k - 1] if count else c
                    to = spots[w, before]
                    if to < 0:
                        continue
                    if fill:
                        arcs[0, a], arcs[1, a], arcs[2, a] = k * num_spots + spot, q * num_spots + to, e
                        arcs[3, a], arcs[4, a], arcs[5, a], arcs[6, a] = record, count, -1, -1
                    a += 1
                    if not is_end[w] or not max(low, q * delta) <= max_length * (1.0 + 1e-12) + 1e-9:
                        continue
                    tie = q * delta + 1e-9 * m * delta
                    if q % m == 0 and low <= tie:  # the walk ends where its last pose was dropped
                        if fill:
                            arcs[0, a], arcs[1, a], arcs[2, a] = k * num_spots + spot, -1, e
                            arcs[3, a], arcs[4, a], arcs[5, a], arcs[6, a] = record, count, -1, q // m
                        a += 1
                    if q % m == 0 and high <= tie:
                        continue
                    if fill:
                        records[0, r], records[1, r], records[3, r] = q // m + 1, e, before
                        records[2, r] = int(np.ceil(lengths[e] / delta - 1e-9))
                        arcs[0, a], arcs[1, a], arcs[2, a] = k * num_spots + spot, -1, e
                        arcs[3, a], arcs[4, a], arcs[5, a], arcs[6, a] = record, count, r, q // m + 1
                    r += 1
                    a += 1
    return a, r
