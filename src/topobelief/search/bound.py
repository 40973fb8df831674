"""What a search over the walks of a roadmap asks of a bound (docs, the mathematics, section 13)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from topobelief.arrays import IntArray

Check = Callable[[], None]
"""What long work calls now and then, several times a second where it can; what this raises ends the work."""


class OutOfTimeError(Exception):
    """Raised by a check after the deadline; never seen outside of the search."""


def unchecked() -> None:
    """The check of work that may take as long as it does."""


class WalkBound(Protocol):
    """A lower bound of the objective over all walks of a class, which gets better step by step.

    Attributes
    ----------
    lower_bound
        No walk of the class has a smaller value of the objective, cost included. It begins at -inf and never falls.
    covers
        Which walks the bound covers, and which bound it is.
    by
        The name of that bound.
    finished
        Whether more steps would not raise it.
    """

    @property
    def lower_bound(self) -> float: ...
    @property
    def covers(self) -> str: ...
    @property
    def by(self) -> str: ...
    @property
    def finished(self) -> bool: ...

    def step(self) -> list[IntArray]:
        """One more iteration.

        Returns
        -------
        list of arrays
            Walks that came up, each as vertices of the roadmap from the start, within the length; candidates whose exact value
            is for the caller to find.
        """
        ...

    def suggest(self, walks: Sequence[IntArray]) -> None:
        """Walks that are known to be good, as vertices of the roadmap, before the first step."""
        ...

    def prune(self, best_value: float) -> None:
        """Leave out what cannot lie on a walk with a smaller value than the best one known.

        From then on `lower_bound` is the smaller of this value and the bound over the walks that remain.
        """
        ...
