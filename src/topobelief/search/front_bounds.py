"""Below which value no walk of each length is: the second curve of the front.

The bound over all walks within the limit says of shorter walks too what it can (`FlowBound.by_length`). But it knows most
about walks of the limit's length, by which its flow is measured. So the walks within some shorter lengths have flows of their
own on the same layers. What is proven of walks within a length is proven of those within any smaller one, so the curve at a
length is the largest of the bounds for longer ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.search.flows import FlowBound

_NUM_LENGTHS = 8
_STEPS_EACH = 6


class FrontBounds:
    """Bounds over the walks within some lengths; costs are not counted.

    Parameters
    ----------
    whole
        Bounds over the walks within the limit that there are so far, the one of the finest layers last.
    shortest, max_length
        Of all walks, metres.
    """

    def __init__(self, whole: Sequence[FlowBound], shortest: float, max_length: float) -> None:
        self._whole, self._shortest, self._max_length = whole, shortest, max_length
        self._each: list[tuple[float, FlowBound]] = []

    @property
    def finished(self) -> bool:
        """Whether each length had the steps that it is to have."""
        return len(self._each) > 0 and all(self._rests(bound) for _, bound in self._each)

    def step(self, best_within: Callable[[float], float]) -> list[IntArray]:
        """One step for the length that had the fewest, the longest of those.

        Parameters
        ----------
        best_within
            The least objective known of a walk within a length, without its cost.

        Returns
        -------
        list of arrays
            Walks that came up, as of `FlowBound.step`.
        """
        if not self._each:
            whole = self._whole[-1]
            count = _NUM_LENGTHS if whole.counts_costs else _NUM_LENGTHS - 1  # without costs the last one is the whole
            lengths = np.linspace(self._shortest, self._max_length, _NUM_LENGTHS)[:count].tolist()
            self._each = [(length, whole.within(length)) for length in reversed(lengths)]
        length, bound = min((each for each in self._each if not self._rests(each[1])), key=lambda each: each[1].num_steps)
        bound.prune(best_within(length))
        return bound.step()

    def curve(self) -> FloatArray:
        """Metres, and the least objective without cost that walks of up to so many metres can have, shape (G, 2).

        By increasing length, the bound falling; where it stays the same, at the greatest such length only.
        """
        bounds = [bound for _, bound in self._each] + [bound for bound in self._whole if not bound.counts_costs]
        points = np.concatenate([np.zeros((0, 2)), *(bound.by_length() for bound in bounds)])
        points = points[np.lexsort((points[:, 1], points[:, 0]))]
        metres, values = points[:, 0], np.maximum.accumulate(points[::-1, 1])[::-1]  # what holds of longer walks holds too
        known = np.isfinite(values)
        metres, values = metres[known], values[known]
        last = np.append(np.diff(values) < 0, True)[: len(values)]
        return np.column_stack([metres[last], values[last]])

    @staticmethod
    def _rests(bound: FlowBound) -> bool:
        return bound.finished or bound.num_steps >= _STEPS_EACH
