"""Longest paths through layers, and the arcs that lie on long ones: dynamic programming over states, layer by layer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.linalg.block_cholesky import Int32Array
from topobelief.linalg.compiled import compiled
from topobelief.search.layers import Layers


@dataclass(frozen=True, slots=True)
class Longest:
    """The longest path through some arcs.

    Attributes
    ----------
    value
        Its length; -inf where no path ends.
    arcs : shape (L,)
        Which arcs it takes, in order.
    ahead : shape (states,)
        Length of the longest path to each state.
    by_layer : shape (layers,)
        Length of the longest path that ends in each layer or in the next one; -inf where none does.
    """

    value: float
    arcs: IntArray
    ahead: FloatArray
    by_layer: FloatArray


def longest_path(layers: Layers, which: Int32Array, weights: FloatArray, charge: FloatArray) -> Longest:
    """Dynamic programming forwards.

    Parameters
    ----------
    layers
    which : shape (A,)
        Arcs that may be used, ascending.
    weights : shape (A,)
        Of arcs within one layer at most 0.
    charge : shape (E,)
        To be taken off the weight of arcs along each way, at least 0.
    """
    arcs, num_spots, num_layers = layers.arcs, layers.num_spots, layers.num_layers
    tables = (which, arcs.source, arcs.target, arcs.way, weights, charge)
    ahead, before, by_layer, value, last = _forward(*tables, layers.whole_layers, num_spots, num_layers, layers.first_state)
    path: list[int] = []
    while last >= 0:
        path.append(int(last))
        last = int(before[arcs.source[last]])
    return Longest(float(value), np.array(path[::-1], dtype=np.int64), ahead, by_layer)


def arcs_above(
    layers: Layers, which: Int32Array, weights: FloatArray, charge: FloatArray, ahead: FloatArray, threshold: float
) -> Int32Array:
    """Those arcs that lie on a path longer than a threshold, or shorter by no more than rounding.

    Parameters
    ----------
    layers, which, weights, charge
        As for `longest_path`.
    ahead : shape (states,)
        What that found.
    threshold
    """
    arcs, num_spots, num_layers = layers.arcs, layers.num_spots, layers.num_layers
    tables = (which, arcs.source, arcs.target, arcs.way, weights, charge)
    return which[_on_long_paths(*tables, num_spots, num_layers, ahead, threshold)]


def arcs_to_ends(layers: Layers, which: Int32Array) -> Int32Array:
    """Those of some arcs from which an end is reached by others of them."""
    none, any_length = np.zeros(len(which)), np.zeros(layers.num_spots * layers.num_layers)
    return arcs_above(layers, which, none, np.zeros(len(layers.whole_layers)), any_length, -1.0)


@compiled
def _forward(
    which: Int32Array,
    source: Int32Array,
    target: Int32Array,
    way: Int32Array,
    weights: FloatArray,
    charge: FloatArray,
    whole_layers: Int32Array,
    num_spots: int,
    num_layers: int,
    first_state: int,
) -> tuple[FloatArray, Int32Array, FloatArray, float, int]:
    num_states = num_spots * num_layers
    by_layer = np.empty(num_layers)
    for k in range(num_layers):
        by_layer[k] = -np.inf
    best, before = np.empty(num_states), np.empty(num_states, np.int32)
    for s in range(num_states):
        best[s], before[s] = -np.inf, -1
    best[first_state] = 0.0
    value, last, begin = -np.inf, -1, 0
    for k in range(num_layers):
        top = (k + 1) * num_spots
        end, inner = begin, False
        while end < len(which) and source[which[end]] < top:
            inner = inner or 0 <= target[which[end]] < top
            end += 1
        while inner:  # arcs within the layer
            inner = False
            for i in range(begin, end):
                a = which[i]
                to = target[a]
                if 0 <= to < top:
                    length = best[source[a]] + (weights[i] - charge[way[a]])
                    if length > best[to]:
                        best[to], before[to] = length, a
                        inner = True
        for i in range(begin, end):
            a = which[i]
            to, length = target[a], best[source[a]] + weights[i]
            if way[a] >= 0:
                length -= charge[way[a]]
            if to < 0:
                end_layer = k + whole_layers[way[a]] if way[a] >= 0 else k
                by_layer[end_layer] = max(by_layer[end_layer], length)
                if length > value:
                    value, last = length, a
            elif to >= top and length > best[to]:
                best[to], before[to] = length, a
        begin = end
    return best, before, by_layer, value, last


@compiled
def _on_long_paths(
    which: Int32Array,
    source: Int32Array,
    target: Int32Array,
    way: Int32Array,
    weights: FloatArray,
    charge: FloatArray,
    num_spots: int,
    num_layers: int,
    ahead: FloatArray,
    threshold: float,
) -> BoolArray:
    """Dynamic programming backwards, and which arcs lie on paths that are long enough."""
    best, kept = np.empty(num_spots * num_layers), np.zeros(len(which), np.bool_)
    for s in range(len(best)):
        best[s] = -np.inf
    end = len(which)
    for k in range(num_layers - 1, -1, -1):
        floor, top = k * num_spots, (k + 1) * num_spots
        begin, inner = end, False
        while begin > 0 and source[which[begin - 1]] >= floor:
            begin -= 1
            inner = inner or 0 <= target[which[begin]] < top
        for i in range(begin, end):
            a = which[i]
            to = target[a]
            if to < 0 or to >= top:
                length = weights[i] + (0.0 if to < 0 else best[to])
                if way[a] >= 0:
                    length -= charge[way[a]]
                best[source[a]] = max(best[source[a]], length)
        while inner:
            inner = False
            for i in range(begin, end):
                a = which[i]
                to = target[a]
                if 0 <= to < top:
                    length = best[to] + (weights[i] - charge[way[a]])
                    if length > best[source[a]]:
                        best[source[a]] = length
                        inner = True
        for i in range(begin, end):
            a = which[i]
            to, length = target[a], ahead[source[a]] + weights[i]
            if to >= 0:
                length += best[to]
            if way[a] >= 0:
                length -= charge[way[a]]
            kept[i] = length > threshold - 1e-9 * (abs(threshold) + abs(weights[i]))
        end = begin
    return kept
