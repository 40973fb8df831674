"""Exact values of walks, each computed once: what driving along them adds to the graph, and the objective after that."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.polyline import path_length
from topobelief.graph.action import Action
from topobelief.planning.planner import Planner
from topobelief.search.walks import Walk

Predict = Callable[[list[FloatArray]], list[Action]]
"""From paths, each of shape (waypoints, 2), to what driving each adds to the graph."""


class Evaluations:
    """Values of walks; those that were evaluated are kept.

    Parameters
    ----------
    planner
        Its objective is the value.
    predict
    vertices : shape (V, 2)
        Of the roadmap, metres.
    cost_per_metre
        In the unit of the objective; the value of a walk includes it.
    """

    def __init__(self, planner: Planner, predict: Predict, vertices: FloatArray, cost_per_metre: float) -> None:
        self._planner, self._predict, self._vertices = planner, predict, vertices
        self.cost_per_metre = cost_per_metre
        self.objectives: dict[Walk, float] = {}  # in the order of their evaluation, cost excluded
        self.lengths: dict[Walk, float] = {}  # metres

    def __len__(self) -> int:
        return len(self.objectives)

    def path(self, walk: Walk) -> FloatArray:
        """Places that a walk passes, shape (waypoints, 2)."""
        return self._vertices[list(walk)]

    def value(self, walk: Walk) -> float:
        """Of a walk that was evaluated, cost included."""
        return self.objectives[walk] + self.cost_per_metre * self.lengths[walk]

    def evaluate(self, walks: Sequence[Walk]) -> None:
        """Evaluate those walks that were not."""
        new = [walk for walk in dict.fromkeys(walks) if walk not in self.objectives]
        if not new:
            return
        paths = [self.path(walk) for walk in new]
        values = self._planner.entropies(self._predict(paths)).tolist()
        for walk, path, value in zip(new, paths, values, strict=True):
            self.lengths[walk] = path_length(path)
            self.objectives[walk] = value

    def action(self, walk: Walk, label: str) -> Action:
        """What driving a walk adds to the graph, its cost that of its length."""
        (action,) = self._predict([self.path(walk)])
        cost = self.cost_per_metre * path_length(self.path(walk))
        return Action(action.poses, action.edges, action.information, label=label, cost=cost, length=action.length)

    def arrays(self) -> tuple[list[Walk], FloatArray, FloatArray]:
        """All walks evaluated so far, their lengths (metres) and objectives, in the order of their evaluation."""
        walks = list(self.objectives)
        return walks, np.array([self.lengths[walk] for walk in walks]), np.array(list(self.objectives.values()))
