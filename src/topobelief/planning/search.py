"""One decision in the making: signatures, bounds and exact values as they come in, and what they certify so far.

Notation as in `planner`: U^ the first of the ranking, LB and UB with the action's cost, survivors A.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import IllConditionedError
from topobelief.graph.action import Action
from topobelief.planning.decision import Candidate, Decision
from topobelief.planning.evaluation import ScratchEvaluation

Progress = Callable[[str, int, int], None]
"""Called with a stage ("signatures", "bounds", "evaluations"), how many actions are done, and out of how many."""


@contextmanager
def naming_action(index: int, action: Action) -> Generator[None]:
    """Put the action's place before what an `IllConditionedError` says."""
    try:
        yield
    except IllConditionedError as error:
        place = f"action {index}" + (f" ({action.label!r})" if action.label else "")
        raise IllConditionedError(f"{place}: {error.what}", error.error_estimate) from None


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

    def __init__(self, evaluation: ScratchEvaluation, actions: Sequence[Action], clock: Clock) -> None:
        self._evaluation, self._actions, self._clock = evaluation, actions, clock
        count = len(actions)
        self._costs = np.array([action.cost for action in actions])
        self._signatures, self._lower, self._upper, self._entropies = np.full((4, count), np.nan)
        self._ranking: list[int] = []

    def rank(self, *, bounds_too: bool) -> None:
        """Signatures of all actions and their order; bounds in the same pass if wanted, while the posterior is at hand."""
        rounding = 0.0
        for index, action in enumerate(self._actions):
            with naming_action(index, action):
                evaluation = self._evaluation.of(action)
                signature = evaluation.signature()
                self._signatures[index] = signature.value
                rounding = max(rounding, signature.error)
                if bounds_too:
                    self._set_bounds(index, evaluation.bounds())
            self._clock.report("signatures", index + 1, len(self._actions))
        in_nats = self._evaluation.signature == "spanning_trees"
        score = self._signatures - self._costs if in_nats else self._signatures
        self._ranking = _descending(score, tolerance=2 * rounding)

    def bound_all(self) -> None:
        """Bounds of all actions, along the ranking, until the deadline."""
        for done, index in enumerate(self._ranking):
            if self._clock.expired:
                return
            self._bound(index)
            self._clock.report("bounds", done + 1, len(self._actions))

    def prove(self, max_evaluations: int) -> None:
        """Exact values along the ranking, skipping what a lower bound rules out."""
        if len(self._survivors()) == 1:
            return
        evaluated = 0
        for index in self._ranking:
            if evaluated == max_evaluations or self._clock.expired:
                return
            if evaluated and self._lower[index] > self._upper[self._best()]:
                continue
            with naming_action(index, self._actions[index]):
                value = self._evaluation.of(self._actions[index]).entropy()
            self._entropies[index] = value.value
            self._set_bounds(index, (value.value - value.error, value.value + value.error))
            evaluated += 1
            self._clock.report("evaluations", evaluated, len(self._survivors()))

    def decision_with_margin(self, margin: float) -> Decision:
        """Algorithm 1's first branch: the upper bound of the first of the ranking, and no other."""
        first = self._ranking[0]
        self._bound(first)
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

    def _bound(self, index: int) -> None:
        with naming_action(index, self._actions[index]):
            self._set_bounds(index, self._evaluation.of(self._actions[index]).bounds())

    def _set_bounds(self, index: int, bounds: tuple[float, float]) -> None:
        self._lower[index], self._upper[index] = np.add(bounds, self._costs[index])

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
            candidates=tuple(self._candidate(action) for action in self._actions),
            objective=session.objective,
            signature=session.signature,
            bounds=session.family,
            determinant=session.determinant,
        )

    def _candidate(self, action: Action) -> Candidate:
        graph = self._evaluation.graph
        k = graph.group.position_dim
        path = np.concatenate([graph.positions[-1:], action.poses[:, :k]]) if action.num_new_poses else np.zeros((1, k))
        length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
        return Candidate(action.label, action.num_new_poses, action.num_closures, length, action.cost)


def _descending(scores: FloatArray, *, tolerance: float) -> list[int]:
    """Indices by descending score; runs of scores that rounding cannot tell apart are ties, ordered by index."""
    order = np.argsort(-scores, kind="stable")
    runs = np.cumsum(np.diff(scores[order], prepend=scores[order[:1]]) < -tolerance)
    return [int(index) for index in order[np.lexsort((order, runs))]]
