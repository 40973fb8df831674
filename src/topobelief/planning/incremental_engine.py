"""Forms after many actions on one prior, which is factored once: an action costs only what it touches (extra `fast`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from topobelief.forms.action_batch import ActionBatch
from topobelief.forms.increments import IncrementalForms
from topobelief.forms.prior_factors import PriorFactors
from topobelief.graph.action import Action
from topobelief.graph.alignment import DEFAULT_SAMPLE_SIZE
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.engine import Engine, Group


class IncrementalEngine(Engine):
    """Forms by increments; factors of the prior are kept.

    Parameters
    ----------
    graph, anchor, sample_size
        As for `Engine`.
    earlier
        Factors of the graph before it grew, which are taken over where they can be.
    """

    batch_size = 1024  # smaller batches compute the paths that actions share more often

    def __init__(
        self,
        graph: PoseGraph,
        anchor: int,
        *,
        sample_size: int = DEFAULT_SAMPLE_SIZE,
        earlier: PriorFactors | None = None,
    ) -> None:
        super().__init__(graph, anchor, sample_size=sample_size)
        self._prior = PriorFactors(graph, anchor, earlier=earlier, sample_size=sample_size)

    @property
    def factors(self) -> PriorFactors:
        return self._prior

    def groups(self, actions: Sequence[Action]) -> list[Group]:
        """All at once; what a new factor of the graph gives at less cost, after many closures, is left to `from_scratch`."""
        return [(np.arange(len(actions)), IncrementalForms(self._prior, ActionBatch(self.graph, tuple(actions))))]

    def extended(self, graph: PoseGraph, anchor: int) -> IncrementalEngine:
        """Orders of elimination are kept, and those parts of each factor below which nothing has changed."""
        grown = graph.group is self.graph.group and graph.num_nodes >= self.graph.num_nodes
        return IncrementalEngine(graph, anchor, sample_size=self.sample_size, earlier=self._prior if grown else None)
