"""Parts of straight ways, as shares from 0 to 1, and what parts leave uncovered."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray

_TOUCHING = 1e-9  # share of a way; parts that are nearer to each other are one


class Parts(NamedTuple):
    """Parts of numbered ways.

    Attributes
    ----------
    which : shape (P,)
        Index of the way; one may have several parts, or none.
    lower, upper : shape (P,)
        Where the part begins and ends, shares of the way from 0 to 1.
    """

    which: IntArray
    lower: FloatArray
    upper: FloatArray


def uncovered(parts: Parts, count: int) -> Parts:
    """What some parts leave of each of `count` ways, in order; gaps of less than a billionth of a way count as covered.

    Examples
    --------
    >>> left = uncovered(Parts(np.array([0, 0]), np.array([0.5, 0.0]), np.array([0.75, 0.25])), 2)
    >>> left.which.tolist(), left.lower.round(6).tolist(), left.upper.round(6).tolist()
    ([0, 0, 1], [0.25, 0.75, 0.0], [0.5, 1.0, 1.0])
    """
    order = np.lexsort([parts.lower, parts.which])
    which, lower, upper = parts.which[order], parts.lower[order], parts.upper[order]
    # The furthest end of the parts so far on the same way: ways are moved apart, so that one running maximum serves all.
    reach = np.maximum.accumulate(upper + 2.0 * which) - 2.0 * which if len(which) else upper
    first = np.r_[True, which[1:] != which[:-1]] if len(which) else np.zeros(0, dtype=bool)
    before = np.where(first, 0.0, np.r_[0.0, reach[:-1]][: len(reach)])
    last = np.r_[first[1:], True] if len(which) else first
    clear = np.setdiff1d(np.arange(count), which)
    gaps = lower > before + _TOUCHING
    tail = last & (reach < 1 - _TOUCHING)
    index = np.concatenate([clear, which[gaps], which[tail]])
    start = np.concatenate([np.zeros(len(clear)), before[gaps], reach[tail]])
    end = np.concatenate([np.ones(len(clear)), lower[gaps], np.ones(np.count_nonzero(tail))])
    order = np.lexsort([start, index])
    return Parts(index[order], np.maximum(start[order] - _TOUCHING, 0.0), np.minimum(end[order] + _TOUCHING, 1.0))


def wholly_covered(parts: Parts, count: int) -> BoolArray:
    """Whether the parts of each of `count` ways leave nothing of it, shape (count,), bool."""
    result = np.ones(count, dtype=bool)
    result[uncovered(parts, count).which] = False
    return result


def pairs_of_lists(lists: Any) -> tuple[IntArray, IntArray]:
    """Pairs of an index and each entry of its list."""
    which = np.repeat(np.arange(len(lists)), [len(each) for each in lists])
    entries = np.concatenate([np.zeros(0, dtype=np.int64), *(np.array(each, dtype=np.int64) for each in lists)])
    return which, entries
