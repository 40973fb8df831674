"""One decision in the making: signatures, bounds and exact values as they come in, and what they certify so far.

Notation as in `planner`: U^ the first of the ranking, LB and UB with the action's cost, survivors A.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.graph.action import Action, driven_lengths
from topobelief.linalg.estimate import UNIT_ROUNDOFF, Estimate
from topobelief.planning.batch import Batch, Criteria
from topobelief.planning.decision import Candidate, Decision
from topobelief.planning.engine import Engine
from topobelief.planning.ranking import first_alike, ranking_of

Progress = Callable[[str, int, int], None]
"""Called with a stage ("signatures", "bounds", "evaluations"), how many actions are done, and out of how many; equal actions
count once."""


class Clock:
    """A deadline, and a callback for progress.

    Parameters
    ----------
    deadline
        Seconds from now; None for no deadline.
    on_progress
        Called after each action.
    """

    def __init__(self, deadline: float | None, on_progress: Progress | None) -> None:
        self._end = math.inf if deadline is None else time.monotonic() + deadline
        self._on_progress = on_progress

    @property
    def limited(self) -> bool:
        """Whether there is a deadline."""
        return math.isfinite(self._end)

    @property
    def expired(self) -> bool:
        """Whether the deadline has passed."""
        return time.monotonic() >= self._end

    def report(self, stage: str, done: int, total: int) -> None:
        """Report progress."""
        if self._on_progress is not None:
            self._on_progress(stage, done, total)


class Search:
    """Fills in signatures, then bounds, then exact values; `decision()` may be taken at any time after `rank`.

    Bounds and exact values, cost excluded, are kept at the first of equal actions, for all of these.
    """

    def __init__(self, engine: Engine, criteria: Criteria, actions: Sequence[Action], clock: Clock) -> None:
        self._engine, self._criteria, self._actions, self._clock = engine, criteria, actions, clock
        count = len(actions)
        self._costs = np.array([action.cost for action in actions])
        self._signatures, self._low, self._high, self._values = np.full((4, count), np.nan)
        self._free = Estimate(*np.full((2, count), np.nan))  # exact values that came with the bounds
        self._exact_bounds = np.zeros(count, np.bool_)  # where bounds are no wider than the error of the exact value
        self._first: IntArray = first_alike(actions)
        self._ranking: list[int] = []

    def rank(self, *, bounds_too: bool) -> None:
        """Signatures and order of all actions; bounds in the same pass if wanted, while the forms they share are in memory."""
        different = self._different(range(len(self._actions)))
        done = 0
        for places in self._parts(different):
            batch = self._batch(places)
            self._signatures[places] = batch.signatures().value
            if bounds_too:
                self._bound(places, batch)
            done += len(places)
            self._clock.report("signatures", done, len(different))
        costs = self._costs if self._criteria.signature_estimates_objective else np.zeros_like(self._costs)
        self._signatures = self._signatures[self._first]
        self._ranking = ranking_of(self._signatures, costs).tolist()

    def bound_all(self) -> None:
        """Bounds of all actions, along the ranking, until the deadline."""
        different, done = self._different(self._ranking), 0
        for places in self._parts(different):
            if self._clock.expired:
                return
            self._bound(places, self._batch(places))
            done += len(places)
            self._clock.report("bounds", done, len(different))

    def prove(self, max_evaluations: int) -> None:
        """Exact values along the ranking, skipping what a lower bound rules out, in batches that double.

        Where bounds are the exact values, and no more of them than wanted, all are taken at once.
        """
        if len(self._survivors()) == 1:
            return
        every = self._different(self._ranking)
        if self._bounds_are_exact and len(every) <= max_evaluations:
            self._evaluate(every)
            return
        evaluated, size = 0, 1
        while evaluated < max_evaluations and not self._clock.expired:
            entropies, lower = self._entropies, self._lower
            left = [index for index in self._ranking if math.isnan(entropies[index])]
            if evaluated:
                threshold = self._upper[self._best()]
                left = [index for index in left if not lower[index] > threshold]
            left = self._different(left)
            places = left[: min(size, max_evaluations - evaluated)]
            if not places:
                return
            self._evaluate(places)
            evaluated += len(places)
            size = min(2 * size, self._engine.batch_size)
            self._clock.report("evaluations", evaluated, evaluated + len(left) - len(places))

    def entropies_of_all(self) -> FloatArray:
        """Exact values of all actions, cost excluded, shape (K,)."""
        different, done = self._different(range(len(self._actions))), 0
        for places in self._parts(different):
            self._values[places] = self._batch(places).entropies().value
            done += len(places)
            self._clock.report("evaluations", done, len(different))
        return self._entropies

    def decision_with_margin(self, margin: float) -> Decision:
        """Algorithm 1's first branch: the upper bound of the first of the ranking, and no other."""
        first = self._ranking[0]
        stands_for_it = [int(self._first[first])]
        self._bound(stands_for_it, self._batch(stands_for_it))
        unknown = np.full(len(self._actions), np.nan)
        upper = np.where(np.arange(len(self._actions)) == first, self._upper, np.nan)
        met = bool(upper[first] < margin)
        alone = len(self._actions) == 1
        return self._decision(
            first,
            [first] if met else self._ranking,
            (unknown, upper),
            error_bound=0.0 if alone else math.inf,
            proven=alone,
            margin_met=met,
        )

    def decision(self) -> Decision:
        """What is known so far, with its certificate."""
        best, survivors = self._best(), self._survivors()
        entropies, lower, upper = self._entropies, self._lower, self._upper
        others = [index for index in self._ranking if index != best]
        unknown = [index for index in others if math.isnan(lower[index])]
        if not others:
            error_bound = 0.0
        elif unknown or math.isnan(upper[best]):
            error_bound = math.inf
        else:
            error_bound = max(0.0, float(upper[best] - np.min(lower[others])))
        open_actions = [index for index in survivors if index != best and math.isnan(entropies[index])]
        evaluated_best = not math.isnan(entropies[best])
        proven = not open_actions and (evaluated_best or survivors == [best])
        return self._decision(best, survivors, (lower, upper), error_bound=error_bound, proven=proven, margin_met=None)

    @property
    def _lower(self) -> FloatArray:
        """LB of all actions, cost included; nan where unknown."""
        return self._low[self._first] + self._costs

    @property
    def _upper(self) -> FloatArray:
        """UB of all actions, cost included; nan where unknown."""
        return self._high[self._first] + self._costs

    @property
    def _entropies(self) -> FloatArray:
        """Exact values of all actions, cost excluded; nan where unknown."""
        return self._values[self._first]

    def _different(self, indices: Sequence[int]) -> list[int]:
        """Actions that stand for these and their equals, each once, in the order of their first mention."""
        return list(dict.fromkeys(self._first[indices].tolist()))

    def _parts(self, places: Sequence[int]) -> Iterator[list[int]]:
        size = self._engine.batch_size
        for start in range(0, len(places), size):
            yield list(places[start : start + size])

    def _batch(self, places: list[int]) -> Batch:
        return Batch(self._engine, self._criteria, [self._actions[place] for place in places], places)

    def _bound(self, places: list[int], batch: Batch) -> None:
        """Bounds, and exact values where these cost nothing more."""
        lower, upper = self._low[places], self._high[places] = batch.bounds()
        if batch.knows_entropies:
            exact = batch.entropies()
            self._free.value[places], self._free.error[places] = exact.value, exact.error
            self._exact_bounds[places] = upper - lower <= 2 * exact.error + 4 * UNIT_ROUNDOFF * np.abs(exact.value)

    @property
    def _bounds_are_exact(self) -> bool:
        return bool(self._exact_bounds[self._first].all())

    def _evaluate(self, places: list[int]) -> None:
        """Exact values in place of bounds, those that came with bounds where they did."""
        exact = Estimate(self._free.value[places], self._free.error[places])
        if not np.isfinite(exact.value).all():
            exact = self._batch(places).entropies()
        self._values[places] = exact.value
        self._low[places], self._high[places] = exact.value - exact.error, exact.value + exact.error

    def _best(self) -> int:
        """U^, or the least value once evaluated; the earlier in the ranking where values tie, rounded as signatures are."""
        values = np.where(np.isnan(self._entropies), np.inf, self._entropies)[self._ranking]
        if np.isinf(values).all():
            return self._ranking[0]
        return self._ranking[int(ranking_of(-values, self._costs[self._ranking])[0])]

    def _survivors(self) -> list[int]:
        """Actions that no bound rules out, in ranking order; U^ stays."""
        threshold = self._upper[self._best()]
        kept = ~(self._lower > threshold)  # unknown bounds rule nothing out
        return [index for position, index in enumerate(self._ranking) if position == 0 or kept[index]]

    def _decision(
        self,
        best: int,
        survivors: list[int],
        bounds: tuple[FloatArray, FloatArray],
        *,
        error_bound: float,
        proven: bool,
        margin_met: bool | None,
    ) -> Decision:
        criteria = self._criteria
        return Decision(
            best=best,
            ranking=np.array(self._ranking),
            signatures=self._signatures,
            lower=bounds[0],
            upper=bounds[1],
            entropies=self._entropies,
            survivors=np.array(survivors),
            error_bound=error_bound,
            margin_met=margin_met,
            num_evaluations=int(np.count_nonzero(~np.isnan(self._values))),
            exact_bounds=margin_met is None and self._bounds_are_exact,
            proven_optimal=proven,
            candidates=tuple(
                Candidate(
                    action.label,
                    action.num_new_poses,
                    action.num_closures,
                    length,
                    action.cost,
                    math.nan if action.probabilities is None else action.expected_closures,
                    action.num_observations,
                    math.nan if action.probabilities is None else action.expected_observations,
                )
                for action, length in zip(self._actions, driven_lengths(self._engine.graph, self._actions), strict=True)
            ),
            objective=criteria.objective,
            signature=criteria.signature,
            bounds=criteria.bounds,
            determinant=criteria.options.determinant,
        )
