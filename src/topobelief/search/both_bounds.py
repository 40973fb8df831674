"""The bounds by flows and by windows together: the largest counts.

Coarse layers give a first bound in a fraction of the time that fine ones take, with cells often a better one at first."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Literal

from topobelief.arrays import IntArray
from topobelief.search.flows import FlowBound
from topobelief.search.window_bound import WindowBound

BoundName = Literal["flows", "windows"]
Make = Callable[[int | None], tuple[FlowBound, WindowBound | None]]
"""From the number of layers per new pose, None for as many as are affordable, to the bounds."""

COARSEST = 3
"""Layers per new pose."""

_MUCH_FINER = 5  # layers per new pose from which on fine ones are worth being made


class BothBounds:
    """One step of flows in coarse layers; then those in fine ones: flows, whose first step is quick, windows, which need few
    steps, then flows again. See `WalkBound`. Each is made in its first step.

    Parameters
    ----------
    make
    affordable
        From the number of arcs, where there is one layer per new pose, to how many layers are affordable.
    """

    def __init__(self, make: Make, affordable: Callable[[float], int]) -> None:
        self._make, self._affordable = make, affordable
        self.flows: list[FlowBound] = []  # the finest last
        self._windows: WindowBound | None = None
        self._is_complete = False
        self._suggested: list[IntArray] = []
        self._best: float | None = None

    @property
    def lower_bound(self) -> float:
        return -math.inf if self._largest is None else self._largest.lower_bound

    @property
    def covers(self) -> str:
        return "" if self._largest is None else self._largest.covers

    @property
    def by(self) -> BoundName:
        """Which of them is the largest."""
        return "windows" if isinstance(self._largest, WindowBound) else "flows"

    @property
    def finished(self) -> bool:
        return bool(self.flows) and self.flows[-1].finished

    def step(self) -> list[IntArray]:
        if not self.flows:
            self._add(COARSEST)
            return self.flows[0].step()
        if not self._is_complete:
            if self._affordable(self.flows[0].num_arcs / COARSEST) >= _MUCH_FINER:
                self._add(None)
            self._is_complete = True
        flows = self.flows[-1]
        if self._windows is not None and flows.num_steps and not self._windows.finished:
            return self._windows.step()
        return flows.step()

    def _add(self, pieces_per_pose: int | None) -> None:
        flows, self._windows = self._make(pieces_per_pose)
        flows.suggest(self._suggested)
        self.flows.append(flows)
        if self._best is not None:
            self.prune(self._best)

    def suggest(self, walks: Sequence[IntArray]) -> None:
        self._suggested = list(walks)

    def prune(self, best_value: float) -> None:
        self._best = best_value
        for bound in self._each:
            bound.prune(best_value)

    @property
    def _each(self) -> list[FlowBound | WindowBound]:
        return [*self.flows, *([] if self._windows is None else [self._windows])]

    @property
    def _largest(self) -> FlowBound | WindowBound | None:
        return max(self._each, key=lambda bound: bound.lower_bound, default=None)
