"""Exact values of walks, each computed once: what driving along them adds to the graph, and the objective after that."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.distinct_paths import DistinctPaths
from topobelief.candidates.polyline import path_length
from topobelief.graph.action import Action
from topobelief.planning.planner import Planner
from topobelief.search.walks import Walk

Predict = Callable[[list[FloatArray]], list[Action]]
"""From paths, each of shape (waypoints, dim), to what driving each adds to the graph."""

SAME_VALUE = 1e-9  # relative: values that differ by less are equal
_NUM_LANDMARKS = 16


class Evaluations:
    """Values of walks; those that were evaluated are kept.

    Parameters
    ----------
    planner
        Its objective is the value.
    predict
    vertices : shape (V, dim)
        Of the roadmap, metres.
    cost_per_metre
        In the unit of the objective; the value of a walk includes it.
    """

    def __init__(self, planner: Planner, predict: Predict, vertices: FloatArray, cost_per_metre: float) -> None:
        self._planner, self._predict, self._vertices = planner, predict, vertices
        self.cost_per_metre = cost_per_metre
        self.objectives: dict[Walk, float] = {}  # in the order of their evaluation, cost excluded
        self.lengths: dict[Walk, float] = {}  # metres
        self.sees_map = False  # whether a loop with the map is closed on any walk so far

    def __len__(self) -> int:
        return len(self.objectives)

    def path(self, walk: Walk) -> FloatArray:
        """Places that a walk passes, shape (waypoints, dim)."""
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
        actions = self._predict(paths)
        values = self._planner.entropies(actions).tolist()
        self.sees_map = self.sees_map or any(self._closes_with_map(action) for action in actions)
        for walk, path, value in zip(new, paths, values, strict=True):
            self.lengths[walk] = path_length(path)
            self.objectives[walk] = value

    def _closes_with_map(self, action: Action) -> bool:
        source, target = action.edges.T
        return bool(((source >= self._planner.graph.num_poses) & (target < self._planner.graph.num_poses)).any())

    def action(self, walk: Walk) -> Action:
        """What driving a walk adds to the graph; its cost is that of its length."""
        (action,) = self._predict([self.path(walk)])
        return Action(
            action.poses,
            action.edges,
            action.information,
            cost=self.cost_per_metre * path_length(self.path(walk)),
            length=action.length,
            probabilities=action.probabilities,
        )

    def arrays(self) -> tuple[list[Walk], FloatArray, FloatArray]:
        """All walks evaluated so far, their lengths (metres) and values, in the order of their evaluation."""
        walks, lengths = list(self.objectives), np.array([*self.lengths.values()])[: len(self.objectives)]
        return walks, lengths, np.array([*self.objectives.values()]) + self.cost_per_metre * lengths

    def best(self) -> Walk:
        """The walk of least value; the shortest one of those whose values differ by rounding only."""
        walks, lengths, values = self.arrays()
        least = values.min()
        equal = np.flatnonzero(values <= least + SAME_VALUE * max(1e-3, abs(least)))
        return walks[equal[np.lexsort((values[equal], lengths[equal]))[0]]]

    def different(self, order: Iterable[int], count: int, apart: float) -> list[Walk]:
        """The first `count` walks of an order that are more than a distance from each other (Fréchet, metres)."""
        walks, kept = list(self.objectives), list[Walk]()
        distinct = DistinctPaths(self._vertices[np.linspace(0, len(self._vertices) - 1, _NUM_LANDMARKS).astype(int)])
        for index in order:
            path = self.path(walks[index])
            if not distinct.any_within(path, apart):
                distinct.add(path)
                kept.append(walks[index])
                if len(kept) == count:
                    break
        return kept
