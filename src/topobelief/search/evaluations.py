"""Exact values of walks, each computed once: what driving along them adds to the graph, and the objective after that."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from topobelief.arrays import BoolArray, FloatArray
from topobelief.candidates.distinct_paths import DistinctPaths
from topobelief.candidates.polyline import path_length
from topobelief.graph.action import Action
from topobelief.planning.planner import Planner
from topobelief.search.walks import Walk

Predict = Callable[[list[FloatArray]], list[Action]]
"""From paths, each of shape (waypoints, dim), to what driving each adds to the graph."""

SAME_VALUE = 1e-9  # relative: values that differ by less are equal
_NUM_LANDMARKS = 16
_APART = 0.05
_ROUNDING = 1e-9  # relative: lengths that differ by less are equal


class Evaluations:
    """Values of walks; those that were evaluated are kept.

    Parameters
    ----------
    planner
        Its objective is the value.
    predict
    vertices : shape (V, dim)
        Of the roadmap, metres; more may follow later.
    cost_per_metre
        In the unit of the objective; the value of a walk includes it.
    measure
        What is minimised after each action, shape (K,), cost excluded. Default: the planner's objective, exactly.
    """

    def __init__(
        self,
        planner: Planner,
        predict: Predict,
        vertices: FloatArray,
        cost_per_metre: float,
        *,
        measure: Callable[[list[Action]], FloatArray] | None = None,
    ) -> None:
        self._planner, self._predict, self.vertices = planner, predict, vertices
        self._measure = measure or planner.entropies
        self.cost_per_metre = cost_per_metre
        self._num_paths = 0  # evaluated that are no walks
        self.objectives: dict[Walk, float] = {}  # in the order of their evaluation, cost excluded
        self.lengths: dict[Walk, float] = {}  # metres
        self.sees_map = False  # whether a loop with the map is closed on any walk so far,
        self.any_sees_itself = False  # and whether one is closed between a walk's own poses

    def __len__(self) -> int:
        """How many exact evaluations were made."""
        return len(self.objectives) + self._num_paths

    def path(self, walk: Walk) -> FloatArray:
        """Places that a walk passes, shape (waypoints, dim)."""
        return self.vertices[list(walk)]

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
        values = self._measure(actions).tolist()
        self.sees_map = self.sees_map or any(self._closes_with_map(action) for action in actions)
        self.any_sees_itself = self.any_sees_itself or any(self._own_closures(action).any() for action in actions)
        for walk, path, value in zip(new, paths, values, strict=True):
            self.lengths[walk] = path_length(path)
            self.objectives[walk] = value

    def values_of_paths(self, paths: list[FloatArray]) -> FloatArray:
        """Values of paths that need not be walks, cost included; they are not kept."""
        self._num_paths += len(paths)
        lengths = np.array([path_length(path) for path in paths])
        return self._measure(self._predict(paths)) + self.cost_per_metre * lengths

    def _closes_with_map(self, action: Action) -> bool:
        source, target = action.edges.T
        return bool(((source >= self._planner.graph.num_nodes) & (target < self._planner.graph.num_nodes)).any())

    def _own_closures(self, action: Action) -> BoolArray:
        """Which edges close a loop between the action's own poses; odometry joins a pose to the one before."""
        apart = np.abs(action.edges[:, 0] - action.edges[:, 1])
        return (action.edges.min(axis=1) >= self._planner.graph.num_nodes) & (apart > 1)

    def actions(self, walks: Sequence[Walk]) -> list[Action]:
        """What driving each of some walks adds to the graph; its cost is that of its length."""
        return [
            Action(
                action.poses,
                action.edges,
                action.information,
                cost=self.cost_per_metre * path_length(self.path(walk)),
                length=action.length,
                probabilities=action.probabilities,
            )
            for walk, action in zip(walks, self._predict([self.path(walk) for walk in walks]), strict=True)
        ]

    def value_with_map_alone(self, walk: Walk) -> float:
        """Of a walk if the loops that its own poses close with each other were not closed, cost included."""
        (action,) = self.actions([walk])
        kept = ~self._own_closures(action)
        if kept.all():
            return self.value(walk)
        without = Action(action.poses, action.edges[kept], action.information[kept], length=action.length)
        return float(self._measure([without])[0]) + action.cost

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

    def best_within(self, length: float) -> float:
        """The least objective of the walks of up to a length, cost excluded; inf where there is none."""
        values = [self.objectives[walk] for walk, metres in self.lengths.items() if metres <= length * (1 + _ROUNDING)]
        return min(values, default=math.inf)

    def best_apart(self, count: int) -> list[Walk]:
        """Some walks, the best of them first, each more than a twentieth of the longest one's length from the others."""
        _, lengths, values = self.arrays()
        return self.different(np.argsort(values, kind="stable").tolist(), count, _APART * float(lengths.max()))

    def different(self, order: Iterable[int], count: int, apart: float) -> list[Walk]:
        """The first `count` walks of an order that are more than a distance from each other (Fréchet, metres)."""
        walks, kept = list(self.objectives), list[Walk]()
        distinct = DistinctPaths(self.vertices[np.linspace(0, len(self.vertices) - 1, _NUM_LANDMARKS).astype(int)])
        for index in order:
            path = self.path(walks[index])
            if not distinct.any_within(path, apart):
                distinct.add(path)
                kept.append(walks[index])
                if len(kept) == count:
                    break
        return kept
