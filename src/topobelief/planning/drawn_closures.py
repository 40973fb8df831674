"""What an action is worth if only some of its closures are made: exact objectives of draws.

An action whose closures are probable and not certain carries their expected information, p times that of a measurement. ln det
is concave in the information and the trace of its inverse convex, so by Jensen's inequality every entropy J and every squared
error E^2 at the expected information is a lower bound of its expectation. It ranks well and is cheap, but it is optimistic. For
the few actions that a decision is about, closures are drawn, each made or not; one that is made counts with full information.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topobelief.arrays import FloatArray, read_only
from topobelief.errors import InvalidInputError
from topobelief.graph.action import Action
from topobelief.planning.planner import Planner


@dataclass(frozen=True, eq=False, slots=True)
class DrawnValues:
    """Exact objectives of an action over draws of its closures, cost excluded.

    Attributes
    ----------
    values : shape (N,)
        One a draw, in the planner's unit.
    """

    values: FloatArray

    @property
    def mean(self) -> float:
        """Over the draws."""
        return float(self.values.mean())

    @property
    def std(self) -> float:
        """Sample standard deviation over the draws; 0 for a single one."""
        return float(self.values.std(ddof=1)) if len(self.values) > 1 else 0.0


def drawn_values(planner: Planner, action: Action, num_draws: int = 30, *, rng: np.random.Generator) -> DrawnValues:
    """Exact objective of an action over draws of which of its probable measurements are made.

    Parameters
    ----------
    planner
    action
        Without probabilities all draws are the same.
    num_draws
        At least 1.
    rng
        Draws each measurement independently.

    Raises
    ------
    InvalidInputError
        For fewer draws than one.
    InvalidActionError
        Where a new pose hangs on measurements that may not be made.

    Examples
    --------
    >>> import numpy as np
    >>> import topobelief as tb
    >>> graph = tb.PoseGraph([[x, 0, 0] for x in range(4)], [(0, 1), (1, 2), (2, 3)], None, np.eye(3) * 100)
    >>> closure = tb.Action([[2, 1, 0]], [(3, 4), (4, 0)], np.array([1, 0.5])[:, None, None] * np.eye(3) * 100,
    ...                     probabilities=[1, 0.5])
    >>> planner = tb.Planner(graph, objective="map")
    >>> drawn = drawn_values(planner, closure, 100, rng=np.random.default_rng(0))
    >>> bool(planner.entropies([closure])[0] < drawn.mean)  # Jensen
    True
    """
    if num_draws < 1:
        raise InvalidInputError(f"expected at least 1 draw, got {num_draws}")
    if action.probabilities is None:
        return DrawnValues(read_only(np.repeat(planner.entropies([action]), num_draws)))
    draws = rng.random((num_draws, len(action.edges))) < action.probabilities
    kinds, which = np.unique(draws, axis=0, return_inverse=True)
    drawn = [_made(action, action.probabilities, made) for made in kinds]
    return DrawnValues(read_only(planner.entropies(drawn)[which.ravel()]))


def _made(action: Action, probabilities: FloatArray, made: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> Action:
    """The action with the measurements that were made, at full information."""
    information = action.information[made] / probabilities[made, None, None]
    return Action(action.poses, action.edges[made], information, label=action.label, cost=action.cost, length=action.length)
