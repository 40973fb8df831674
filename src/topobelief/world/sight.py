"""Which parts of straight ways are seen from places: in the plane exact, by the shadows that walls throw on each way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.world.parts import Parts, uncovered
from topobelief.world.space import FreeSpace
from topobelief.world.world import World
from topobelief.world.world_3d import World3D

_AT_ONCE = 4000  # ways between two checks
_LINES = 6  # across the lines of sight in space
_FLAT = 1e-12  # relative area of a triangle below which a place counts as being on the line of the way


def seen_parts(
    world: FreeSpace, places: FloatArray, starts: FloatArray, ends: FloatArray, check: Callable[[], None] = lambda: None
) -> Parts:
    """What is seen of each way from a place of its own; the parts are in the order of the ways.

    Nothing that is visible by `visible` is left out. Beyond that, parts may be larger: in the plane by some 1e-9 of a way, and
    walls hide nothing where the place is on the line of the way; in space by what hides the way only from between the lines
    that are tried (see `_seen_in_space`).

    Parameters
    ----------
    world
    places, starts, ends : shape (N, dim)
        A place, and the ends of a way that lies in free space.
    check
        Called now and then; what it raises ends the work.
    """
    if not isinstance(world, World | World3D):
        raise TypeError(f"expected a World or a World3D, got {type(world).__name__}")
    inside = np.flatnonzero(world.contains(places))
    found = [Parts(inside[:0], np.zeros(0), np.zeros(0))]
    for first in range(0, len(inside), _AT_ONCE):
        check()
        some = inside[first : first + _AT_ONCE]
        each = places[some], starts[some], ends[some]
        seen = _seen_in_plane(world, *each) if isinstance(world, World) else _seen_in_space(world, *each)
        found.append(Parts(some[seen.which], seen.lower, seen.upper))
    return Parts(*(np.concatenate(columns) for columns in zip(*found, strict=True)))


def _seen_in_space(world: World3D, place: FloatArray, start: FloatArray, end: FloatArray) -> Parts:
    """Parts of which the line of sight is free at each of some shares of its length.

    At share h of its length, the lines of sight from a place to all of a way pass one straight line, parallel to the way. What
    of that is not free hides the same shares of the way.
    """
    hidden: list[Parts] = []
    for share in (np.arange(_LINES) + 0.5) / _LINES:
        free = world.free_parts(place + share * (start - place), place + share * (end - place))
        hidden.append(uncovered(free, len(place)))
    return uncovered(Parts(*(np.concatenate(columns) for columns in zip(*hidden, strict=True))), len(place))


def _seen_in_plane(world: World, place: FloatArray, start: FloatArray, end: FloatArray) -> Parts:
    """Parts on which no wall throws a shadow."""
    corners = np.stack([place, start, end])
    near, wall_starts, wall_ends = world.walls_in_boxes(corners.min(axis=0), corners.max(axis=0))
    from_, to = _shadows(start[near] - place[near], end[near] - place[near], wall_starts - place[near], wall_ends - place[near])
    dark = from_ <= to
    return uncovered(Parts(near[dark], from_[dark], to[dark]), len(place))


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
