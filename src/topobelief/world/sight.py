"""Which parts of straight ways are seen from places: exact, by the shadows that walls throw on each way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.world.world import World

_TOUCHING = 1e-9  # share of a way; shadows that are nearer to each other are one
_FLAT = 1e-12  # relative area of a triangle below which a place counts as being on the line of the way


class SeenParts(NamedTuple):
    """Parts of ways, each seen from the place that belongs to the way.

    Attributes
    ----------
    which : shape (P,)
        Index of the place and its way, ascending; one may have several parts, or none.
    lower, upper : shape (P,)
        Where the part begins and ends, shares of the way from 0 to 1.
    """

    which: IntArray
    lower: FloatArray
    upper: FloatArray


def seen_parts(world: World, places: FloatArray, starts: FloatArray, ends: FloatArray) -> SeenParts:
    """What is seen of each way from a place of its own.

    Nothing that is visible by `World.visible` is left out; beyond that, parts may be larger by some 1e-9 of a way, and walls
    hide nothing where the place is on the line of the way.

    Parameters
    ----------
    world
    places, starts, ends : shape (N, 2)
        A place, and the ends of a way that lies in free space.
    """
    inside = np.flatnonzero(world.contains(places))
    place, start, end = places[inside], starts[inside], ends[inside]
    corners = np.stack([place, start, end])
    near, wall_starts, wall_ends = world.walls_in_boxes(corners.min(axis=0), corners.max(axis=0))
    from_, to = _shadows(start[near] - place[near], end[near] - place[near], wall_starts - place[near], wall_ends - place[near])
    dark = from_ <= to
    which, lower, upper = _lit(near[dark], from_[dark], to[dark], len(inside))
    return SeenParts(inside[which], lower, upper)


def _shadows(a: FloatArray, b: FloatArray, first: FloatArray, second: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Shadow of each wall on the way from a to b, seen from the origin: shares from and to; from > to where there is none.

    With q = alpha a + beta b a wall's point, the part with alpha, beta >= 0 and alpha + beta <= 1 stands before the way, and
    hides its share beta / (alpha + beta).
    """
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    flat = np.abs(area) <= _FLAT * (np.sum(a**2, axis=1) + np.sum(b**2, axis=1))
    scale = 1 / np.where(flat, 1.0, area)

    def coordinates(q: FloatArray) -> FloatArray:
        alpha = (q[:, 0] * b[:, 1] - q[:, 1] * b[:, 0]) * scale
        beta = (a[:, 0] * q[:, 1] - a[:, 1] * q[:, 0]) * scale
        return np.stack([alpha, beta, 1 - alpha - beta])

    at_first, at_second = coordinates(first), coordinates(second)
    low, high = np.zeros(len(a)), np.ones(len(a))
    for x, y in zip(at_first, at_second, strict=True):  # the part of the wall where this coordinate is not negative
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = x / (x - y)
        low = np.where((x < 0) & (y >= 0), np.maximum(low, crossing), low)
        high = np.where((x >= 0) & (y < 0), np.minimum(high, crossing), high)
        high = np.where((x < 0) & (y < 0), -1.0, high)
    hidden = (low <= high) & ~flat
    shares: list[FloatArray] = []
    for s in (low, high):
        alpha, beta, _ = at_first + s * (at_second - at_first)
        before = hidden & (alpha + beta > 0)
        shares.append(np.clip(beta / np.where(before, alpha + beta, 1.0), 0.0, 1.0))
    return np.where(hidden, np.minimum(*shares), 1.0), np.where(hidden, np.maximum(*shares), 0.0)


def _lit(which: IntArray, lower: FloatArray, upper: FloatArray, count: int) -> tuple[IntArray, FloatArray, FloatArray]:
    """What shadows leave of each of `count` ways: the way's index, and the shares from and to."""
    order = np.lexsort([lower, which])
    which, lower, upper = which[order], lower[order], upper[order]
    # The furthest end of the shadows so far on the same way: ways are moved apart, so that one running maximum serves all.
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
    return index[order], np.maximum(start[order] - _TOUCHING, 0.0), np.minimum(end[order] + _TOUCHING, 1.0)
