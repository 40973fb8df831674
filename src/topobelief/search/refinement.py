"""A way off the vertices of a roadmap: its waypoints are moved, left out and put in wherever the value is better for it.

New poses stand every metre, so a few decimetres decide which loops they close. A roadmap whose vertices are half a metre apart
has the way that closes them or has it not, by chance. From the best of its walks the search goes on in the plane, as an
evolution strategy with one parent (I. Rechenberg, 1973): of a few random changes the best is kept, and changes become larger
after a success and smaller after a failure. Moves of different waypoints that each were better are tried together next.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.polyline import path_length
from topobelief.candidates.roadmap_graph import Roadmap, with_way
from topobelief.search.evaluations import SAME_VALUE, Evaluations

_BATCH = 16  # changes of which the best is kept
_MOST_DRAWS = 20  # for each of them; most of the others leave free space or are too long
_FIRST_STEP, _LEAST_STEP, _LARGEST_STEP = 0.6, 0.1, 1.0  # metres, about what waypoints are moved by
_LARGER, _SMALLER = 1.2, 0.85  # factors after a success, after a failure
_SPREAD = (-0.7, 0.3)  # decades around the step from which one move's is drawn
_SHARES = (0.7, 0.85)  # up to which a draw moves waypoints, leaves one out; beyond it puts one in
_STRETCH = 0.4  # of the moves take up to two waypoints more along
_PATIENCE = 10  # batches without a better way after which the search rests
_MOST_EVALUATIONS = 800


@dataclass(frozen=True, eq=False, slots=True)
class _Change:
    path: FloatArray
    offsets: FloatArray | None  # by which waypoints were moved; None where their number differs


class Refinement:
    """Betters a path, a batch of evaluations at a time.

    Parameters
    ----------
    path : shape (waypoints, dim)
        Metres; its ends stay.
    value
        Of the path.
    roadmap
        Whose robot must fit along the path.
    limit
        Of its length, metres.
    rng
    """

    def __init__(self, path: FloatArray, value: float, roadmap: Roadmap, limit: float, *, rng: np.random.Generator) -> None:
        self.path, self.value = path, value
        self._roadmap, self._limit, self._rng = roadmap, limit, rng
        self._step, self._failures = _FIRST_STEP, 0
        self._together: FloatArray | None = None  # several changes that each were better

    def step(self, values_of: Callable[[list[FloatArray]], FloatArray]) -> bool:
        """Try some changes, whose values the function gives; whether it is worth going on."""
        if self._failures >= _PATIENCE or len(self.path) < 2:
            return False
        changes = self._changes()
        if not changes:
            return False
        values = values_of([change.path for change in changes])
        best = int(np.argmin(values))
        better = np.flatnonzero(values < self.value - SAME_VALUE * abs(self.value))
        self._together = self._joined([changes[place] for place in better[np.argsort(values[better])].tolist()])
        if len(better):
            self.path, self.value, self._failures = changes[best].path, float(values[best]), 0
            self._step = min(_LARGER * self._step, _LARGEST_STEP)
        else:
            self._failures += 1
            self._step = max(_SMALLER * self._step, _LEAST_STEP)
        return True

    def _changes(self) -> list[_Change]:
        changes = [] if self._together is None or not self._fits(self._together) else [_Change(self._together, None)]
        for change in self._drawn():
            if self._fits(change.path):
                changes.append(change)
                if len(changes) == _BATCH:
                    break
        return changes

    def _drawn(self) -> Iterator[_Change]:
        last, rng = len(self.path) - 1, self._rng
        for _ in range(_MOST_DRAWS * _BATCH):
            kind, scale = rng.random(), self._step * 10 ** rng.uniform(*_SPREAD)
            by: FloatArray = scale * rng.normal(size=len(self.path[0]))
            if kind > _SHARES[1] or last == 1:
                before = int(rng.integers(last))
                place = self.path[before] + rng.random() * (self.path[before + 1] - self.path[before]) + by
                yield _Change(np.insert(self.path, before + 1, place, axis=0), None)
            elif kind > _SHARES[0]:
                yield _Change(np.delete(self.path, rng.integers(1, last), axis=0), None)
            else:
                first = int(rng.integers(1, last))
                count = int(rng.integers(1, 4)) if rng.random() < _STRETCH else 1
                offsets = np.zeros_like(self.path)
                offsets[first : min(first + count, last)] = by
                yield _Change(self.path + offsets, offsets)

    def _fits(self, path: FloatArray) -> bool:
        radius = self._roadmap.robot_radius
        return path_length(path) <= self._limit and bool(self._roadmap.world.segments_free(path[:-1], path[1:], radius).all())

    def _joined(self, better: list[_Change]) -> FloatArray | None:
        """Moves of different waypoints together, the best of them first; None where there are not two."""
        total, count = np.zeros_like(self.path), 0
        for change in better:
            if change.offsets is not None and not (change.offsets * total).any():
                total, count = total + change.offsets, count + 1
        return self.path + total if count > 1 else None


def refine_best(
    evaluations: Evaluations,
    roadmap: Roadmap,
    limit: float,
    *,
    rng: np.random.Generator,
    most: float,
    end: float,
    clock: Callable[[], float] = time.monotonic,
) -> bool:
    """Better the best walk so far off the roadmap; the way found is evaluated as a walk on more vertices.

    Parameters
    ----------
    evaluations
        At least one walk on the roadmap.
    roadmap
    limit
        Of the length, metres.
    rng
    most
        Exact evaluations that it may make; it rests after 800 at the latest.
    end
        When to stop, on the clock.
    clock

    Returns
    -------
    bool
        Whether Ctrl-C has ended it.
    """
    best, interrupted = evaluations.best(), False
    refinement = Refinement(evaluations.path(best), evaluations.value(best), roadmap, limit, rng=rng)
    last = len(evaluations) + min(most, _MOST_EVALUATIONS)
    try:
        while len(evaluations) < last and clock() < end and refinement.step(evaluations.values_of_paths):
            pass
    except KeyboardInterrupt:
        interrupted = True
    more, way = with_way(roadmap, refinement.path)
    evaluations.vertices = more.vertices
    evaluations.evaluate([way])
    return interrupted
