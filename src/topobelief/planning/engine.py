"""Where the forms after actions come from: from scratch, an action at a time, or by increments to a prior factored once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from topobelief.arrays import IntArray
from topobelief.forms.of_graph import GraphForms
from topobelief.forms.protocol import Forms
from topobelief.graph.action import Action, posterior
from topobelief.graph.alignment import DEFAULT_SAMPLE_SIZE
from topobelief.graph.fisher import FisherRows, fisher_rows
from topobelief.graph.pose_graph import PoseGraph

if TYPE_CHECKING:
    from topobelief.forms.prior_factors import PriorFactors  # needs numba, which the other engine does without

Group = tuple[IntArray, Forms[Any]]
"""Places in a list of actions, and the forms after these."""


class Engine(ABC):
    """Forms after actions on one prior. Values that it keeps belong to the prior alone, so threads may share it.

    Parameters
    ----------
    graph
        The prior; connected.
    anchor
        The pose that bounds hold.
    sample_size
        Over how many poses of the prior traces are taken at most.
    """

    batch_size: int
    """Actions that are best asked for together."""

    def __init__(self, graph: PoseGraph, anchor: int, *, sample_size: int = DEFAULT_SAMPLE_SIZE) -> None:
        self.graph, self.anchor, self.sample_size = graph, anchor, sample_size

    @property
    def factors(self) -> PriorFactors | None:
        """Factors of the prior, where the engine keeps them."""
        return None

    @abstractmethod
    def groups(self, actions: Sequence[Action]) -> list[Group]:
        """Forms after checked actions; those that are in no group, and values that are nan, are left to `from_scratch`."""

    @abstractmethod
    def extended(self, graph: PoseGraph, anchor: int) -> Engine:
        """The same on a graph that has grown out of this one's; this one stays as it is."""

    def from_scratch(self, action: Action) -> GraphForms:
        """Forms after one action."""
        after = posterior(self.graph, action)
        return GraphForms(
            after, anchor=self.anchor, prior=self.graph, prior_rows=self._prior_rows, sample_size=self.sample_size
        )

    @cached_property
    def _prior_rows(self) -> FisherRows:
        return fisher_rows(self.graph)


class ScratchEngine(Engine):
    """Everything from scratch on the posterior graph: the reference."""

    batch_size = 1

    def groups(self, actions: Sequence[Action]) -> list[Group]:
        return [(np.array([place]), self.from_scratch(action)) for place, action in enumerate(actions)]

    def extended(self, graph: PoseGraph, anchor: int) -> ScratchEngine:
        return ScratchEngine(graph, anchor, sample_size=self.sample_size)
