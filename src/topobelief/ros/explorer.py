"""Trips one after the other until none is worth driving: when to ask for the next."""

from __future__ import annotations

import math
from typing import Literal

Step = Literal["wait", "ask"]


class Explorer:
    """Keeps track of the trip that is being driven.

    Parameters
    ----------
    tolerance
        Metres within which the end of a trip counts as reached.
    """

    def __init__(self, tolerance: float) -> None:
        self._tolerance = tolerance
        self._end: tuple[float, float] | None = None
        self._asked = False
        self.active = False

    def start(self) -> None:
        """Explore from now on."""
        self.active, self._end, self._asked = True, None, False

    def stop(self) -> None:
        """Explore no more."""
        self.active = False

    def next_step(self, place: tuple[float, float] | None) -> Step:
        """What to do, the robot being at a place: ask for a trip where none is being driven."""
        if not self.active or self._asked:
            return "wait"
        if self._end is not None and (place is None or math.dist(place, self._end) > self._tolerance):
            return "wait"
        self._asked = True
        return "ask"

    def answered(self, end: tuple[float, float] | None) -> None:
        """A trip was answered that ends there, or none."""
        self._end, self._asked = end, False
