"""One decision in the making: signatures, bounds and exact values as they come in, and what they certify so far.

Notation as in `planner`: U^ the first of the ranking, LB and UB with the action's cost, survivors A.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import IllConditionedError
from topobelief.graph.action import Action, driven_lengths
from topobelief.planning.decision import Candidate, Decision
from topobelief.planning.evaluation import Evaluation

Quantity = Callable[[Sequence[Action]], tuple[FloatArray, FloatArray]]

Progress = Callable[[str, int, int], None]
"""Called with a stage ("signatures", "bounds", "evaluations"), how many actions are done, and out of how many."""


def named_quantity(quantity: Quantity, actions: Sequence[Action], batch: list[int]) -> tuple[FloatArray, FloatArray]:
    """A quantity of a batch of actions; an `IllConditionedError` says which action is to blame.

    Raises
    ------
    IllConditionedError
        Names the first action whose quantity double precision cannot give.
    """
    try:
        return quantity([actions[index] for index in batch])
    except IllConditionedError:
        for index in batch:
            try:
                quantity([actions[index]])
            except IllConditionedError as error:
                label = f" ({actions[index].label!r})" if actions[index].label else ""
                raise IllConditionedError(f"action {index}{label}: {error.what}", error.error_estimate) from None
        raise


class Clock:
    """A deadline, and whom to tell of progress.

    Parameters
    ----------
    deadline
        Seconds from now; None for no deadline.
    on_progress
        Told after each action.
    """

    def __init__(self, deadline: float | None, on_progress: Progress | None) -> None:
        self._end = math.inf if deadline is None else time.monotonic() + deadline
        self._on_progress = on_progress

    @property
    def expired(self) -> bool:
        """Whether the deadline has passed."""
        return time.monotonic() >= self._end

    def report(self, stage: str, done: int, total: int) -> None:
        """Tell of progress."""
        if self._on_progress is not None:
            self._on_progress(stage, done, total)


class Search:
    """Fills in signatures, then bounds, then exact values; `decision()` may be taken at any time after `rank`."""

    def __init__(self, evaluation: Evaluation, actions: Sequence[Action], clock: Clock) -> None:
        self._evaluation, self._actions, self._clock = evaluation, actions, clock
        count = len(actions)
        self._costs = np.array([action.cost for action in actions])
        self._signatures, self._lower, self._upper, self._entropies = np.full((4, count), np.nan)
        self._ranking: list[int] = []

    def rank(self, *, bounds_too: bool) -> None:
        """Signatures of all actions and their order; bounds in the same pass if wanted, while what they share is at hand."""
        rounding = 0.0
        for batch in self._batches(range(len(self._actions))):
            self._signatures[batch], errors = self._of(batch, self._evaluation.signatures)
            rounding = max(rounding, float(errors.max()))
            if bounds_too:
                self._bound(batch)
            self._clock.report("signatures", batch[-1] + 1, len(self._actions))
        in_nats = self._evaluation.signature == "spanning_trees"
        score = self._signatures - self._costs if in_nats else self._signatures
        self._ranking = _descending(score, tolerance=2 * rounding)

    def bound_all(self) -> None:
        """Bounds of all actions, along the ranking, until the deadline."""
        done = 0
        for batch in self._batches(self._ranking):
            if self._clock.expired:
                return
            self._bound(batch)
            done += len(batch)
            self._clock.report("bounds", done, len(self._actions))

    def prove(self, max_evaluations: int) -> None:
        """Exact values along the ranking, skipping what a lower bound rules out, in batches that double."""
        if len(self._survivors()) == 1:
            return
        evaluated, size = 0, 1
        while evaluated < max_evaluations and not self._clock.expired:
            left = [index for index in self._ranking if math.isnan(self._entropies[index])]
            if evaluated:
                threshold = self._upper[self._best()]
                left = [index for index in left if not self._lower[index] > threshold]
            batch = left[: min(size, max_evaluations - evaluated)]
            if not batch:
                return
            self._entropies[batch], errors = self._of(batch, self._evaluation.entropies)
            self._set_bounds(batch, self._entropies[batch] - errors, self._entropies[batch] + errors)
            evaluated += len(batch)
            size = min(2 * size, self._evaluation.batch_size)
            self._clock.report("evaluations", evaluated, evaluated + len(left) - len(batch))

    def decision_with_margin(self, margin: float) -> Decision:
        """Algorithm 1's first branch: the upper bound of the first of the ranking, and no other."""
        first = self._ranking[0]
        self._bound([first])
        self._lower[first] = np.nan
        met = bool(self._upper[first] < margin)
        alone = len(self._actions) == 1
        return self._decision(
            best=first,
            survivors=[first] if met else self._ranking,
            error_bound=0.0 if alone else math.inf,
            proven=alone,
            margin_met=met,
        )

    def decision(self) -> Decision:
        """What is known so far, with its certificate."""
        best, survivors = self._best(), self._survivors()
        others = [index for index in self._ranking if index != best]
        unknown = [index for index in others if math.isnan(self._lower[index])]
        if not others:
            error_bound = 0.0
        elif unknown or math.isnan(self._upper[best]):
            error_bound = math.inf
        else:
            error_bound = max(0.0, float(self._upper[best] - np.min(self._lower[others])))
        open_actions = [index for index in survivors if index != best and math.isnan(self._entropies[index])]
        evaluated_best = not math.isnan(self._entropies[best])
        proven = not open_actions and (evaluated_best or survivors == [best])
        return self._decision(best, survivors, error_bound, proven, margin_met=None)

    def _batches(self, indices: Sequence[int]) -> Iterator[list[int]]:
        size = self._evaluation.batch_size
        for start in range(0, len(indices), size):
            yield list(indices[start : start + size])

    def _bound(self, batch: list[int]) -> None:
        self._set_bounds(batch, *self._of(batch, self._evaluation.bounds))

    def _set_bounds(self, batch: list[int], lower: FloatArray, upper: FloatArray) -> None:
        self._lower[batch], self._upper[batch] = lower + self._costs[batch], upper + self._costs[batch]

    def _of(self, batch: list[int], quantity: Quantity) -> tuple[FloatArray, FloatArray]:
        return named_quantity(quantity, self._actions, batch)

    def _best(self) -> int:
        """U^, or the least value once evaluated; the earlier in the ranking where values tie."""
        values = (self._entropies + self._costs)[self._ranking]
        return self._ranking[0 if np.isnan(values).all() else int(np.nanargmin(values))]

    def _survivors(self) -> list[int]:
        """Actions that no bound rules out, in ranking order; U^ stays."""
        threshold = self._upper[self._best()]
        kept = ~(self._lower > threshold)  # unknown bounds rule nothing out
        return [index for position, index in enumerate(self._ranking) if position == 0 or kept[index]]

    def _decision(self, best: int, survivors: list[int], error_bound: float, proven: bool, margin_met: bool | None) -> Decision:
        session = self._evaluation
        return Decision(
            best=best,
            ranking=np.array(self._ranking),
            signatures=self._signatures,
            lower=self._lower,
            upper=self._upper,
            entropies=self._entropies,
            survivors=np.array(survivors),
            error_bound=error_bound,
            margin_met=margin_met,
            num_evaluations=int(np.count_nonzero(~np.isnan(self._entropies))),
            proven_optimal=proven,
            candidates=tuple(
                Candidate(action.label, action.num_new_poses, action.num_closures, length, action.cost)
                for action, length in zip(self._actions, driven_lengths(session.graph, self._actions), strict=True)
            ),
            objective=session.objective,
            signature=session.signature,
            bounds=session.family,
            determinant=session.determinant,
        )


def _descending(scores: FloatArray, *, tolerance: float) -> list[int]:
    """Indices by descending score; runs of scores that rounding cannot tell apart are ties, ordered by index."""
    order = np.argsort(-scores, kind="stable")
    runs = np.cumsum(np.diff(scores[order], prepend=scores[order[:1]]) < -tolerance)
    return [int(index) for index in order[np.lexsort((order, runs))]]
