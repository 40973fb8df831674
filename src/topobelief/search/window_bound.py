"""The bound over all walks of a roadmap by windows (docs, the mathematics, section 13).

Each new pose adds at most what `windows` says, which depends on where it and the pose before stand. So no walk gains more than
the longest path through layers whose labels say where the last pose stood. It is a tight bound where ways are long and many of
them see much, where flows mix them all; it takes one pass, in a few steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from dataclasses import replace

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.search.bound import Check
from topobelief.search.criteria import Criterion
from topobelief.search.layers import Layers
from topobelief.search.longest_paths import longest_path
from topobelief.search.rewards import Rewards, arc_weights, ways_along
from topobelief.search.tolls import next_toll
from topobelief.search.windows import Windows

_CHUNK = 200_000  # different windows valued in one step
_TOLL_TRIALS = 8
_ROUNDING = 1e-9  # relative; bounds are lowered by it


class WindowBound:
    """Lower bound of an entropy over the walks of a roadmap with at most one closure a pose; see `WalkBound`."""

    def __init__(
        self,
        criterion: Criterion,
        make: Callable[[], tuple[Windows, Layers]],
        rewards: Rewards,
        vertices: IntArray,
        max_length: float,
        covers: str,
        check: Check,
    ) -> None:
        self._criterion, self._make, self._rewards = criterion, make, rewards
        self._vertices, self._max_length, self._covers = vertices, max_length, covers
        self._check = check
        self._bound = -math.inf
        self._steps = self._work()
        self._finished = False

    @property
    def lower_bound(self) -> float:
        return self._bound

    @property
    def covers(self) -> str:
        return self._covers

    @property
    def finished(self) -> bool:
        return self._finished

    def prune(self, best_value: float) -> None:
        self._criterion = self._criterion.compared_with(best_value)

    def step(self) -> list[IntArray]:
        found = next(self._steps, None)
        self._finished = found is None
        return found or []

    def _work(self) -> Generator[list[IntArray]]:
        """One step after the other; the walks that came up."""
        windows, layers = self._make()
        yield []
        records = layers.records
        place = self._rewards.sightings.first[records.way] + records.piece
        keys, which = windows.keys(records.number.astype(np.int64), place, records.before.astype(np.int64))
        values = np.empty(len(keys))
        for start in range(0, len(keys), _CHUNK):
            values[start : start + _CHUNK] = windows.values(keys[start : start + _CHUNK])
            yield []
        yield self._longest(layers, values[which])

    def _longest(self, layers: Layers, worth: FloatArray) -> list[IntArray]:
        """The bound by what each record is worth at most; and the walks that are worth that."""
        criterion, rewards = self._criterion, replace(self._rewards, layers=layers)
        every = np.arange(len(layers.arcs.source), dtype=np.int32)
        at_end = -criterion.at_end(with_idle=False)
        weights = arc_weights(layers.arcs, every, worth, criterion.price * rewards.prices, at_end)
        most, toll, lines, found = math.inf, 0.0, list[tuple[float, float]](), list[IntArray]()
        for _ in range(_TOLL_TRIALS):
            self._check()
            longest = longest_path(layers, every, weights, toll * rewards.driven)
            if longest.value == -math.inf:
                return []
            most = min(most, longest.value + toll * self._max_length)
            length = float(rewards.driven[ways_along(layers, longest.arcs)].sum())
            lines.append((longest.value + toll * length, length))
            walk = rewards.walk(longest.arcs, self._vertices, self._max_length)
            found += [] if walk is None else [walk]
            following = next_toll(lines, toll, self._max_length)
            if following is None:
                break
            toll = following
        bound = float(criterion.to_objective(np.array([criterion.of_gain(most)]))[0])
        self._bound = bound - _ROUNDING * (abs(bound) + abs(criterion.of_gain(0.0)))
        return found
