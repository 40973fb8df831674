"""The bounds by flows and by windows together: the larger of the two counts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from topobelief.arrays import IntArray
from topobelief.search.flows import FlowBound
from topobelief.search.window_bound import WindowBound

BoundName = Literal["flows", "windows"]


class BothBounds:
    """Flows first, because their first step is quick; then windows, which need few steps; then flows again. See `WalkBound`."""

    def __init__(self, flows: FlowBound, windows: WindowBound | None) -> None:
        self._flows, self._windows = flows, windows

    @property
    def lower_bound(self) -> float:
        return self._larger.lower_bound

    @property
    def covers(self) -> str:
        return self._larger.covers

    @property
    def by(self) -> BoundName:
        """Which of them is the larger one."""
        return "flows" if self._larger is self._flows else "windows"

    @property
    def finished(self) -> bool:
        return self._flows.finished

    def step(self) -> list[IntArray]:
        if self._windows is not None and self._flows.num_steps and not self._windows.finished:
            return self._windows.step()
        return self._flows.step()

    def suggest(self, walks: Sequence[IntArray]) -> None:
        self._flows.suggest(walks)

    def prune(self, best_value: float) -> None:
        self._flows.prune(best_value)
        if self._windows is not None:
            self._windows.prune(best_value)

    @property
    def _larger(self) -> FlowBound | WindowBound:
        if self._windows is None or self._windows.lower_bound <= self._flows.lower_bound:
            return self._flows
        return self._windows
