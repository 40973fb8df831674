"""Local search and a bound in turns, each the other's food, until the best value is proven, the time is up, or both rest."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.search.bound import Check, OutOfTimeError, WalkBound
from topobelief.search.evaluations import SAME_VALUE, Evaluations
from topobelief.search.local_search import LocalSearch
from topobelief.search.walks import Walk

if TYPE_CHECKING:
    from topobelief.search.front_bounds import FrontBounds  # needs numba, which a plan of candidates does without
    from topobelief.search.result import SearchResult

Reason = Literal["proof", "gap", "enough", "deadline", "evaluations", "interrupt", "rest"]
"""Why a search stopped."""

_FIRST_BATCH, _LARGEST_BATCH = 8, 64  # evaluations between two looks at the clock; batches double
_WARM_UP = 400  # evaluations before the first step of the bound,
WARM_UP_SHARE = 0.4  # or this share of the time or of the evaluations that a search may take
_PATIENCE = 1000  # evaluations without improvement after which local search rests
_MOST_RESTARTS = 20  # without improvement, likewise
_STEPS_PER_LOOK = 20  # of the bound, in which it closes at least
_LEAST_PROGRESS = 0.05  # this share of the gap, or rests; with a deadline it goes on
_STEPS_PER_FRONT_STEP = 3  # of the bound for one of the bounds of shorter walks
_SUGGESTED = 8  # walks from which the bound begins
_ONE_AS_LONG_AS = 3  # steps of a kind: the longest of so many says how long the next may take


class SearchProgress(NamedTuple):
    """What is known at some time of a search."""

    seconds: float
    num_evaluations: int
    value: float  # of the best way so far, cost included
    lower_bound: float  # -inf while nothing is known
    so_far: Callable[[], SearchResult] | None = None  # what would be returned if the search ended now; from `search_roadmap`


class AnytimeSearch:
    """A search that can be stopped at any time.

    Parameters
    ----------
    evaluations, local
        Local search evaluates its walks there.
    make_bounds
        Called once, when local search has found first values: the bound, and those of shorter walks, whose work calls the
        check that it is given. None: search without.
    began, deadline
        Seconds: on the clock, and from then on; None for no deadline.
    first_bound_by
        The deadline while nothing is known of the bound. Default: the same.
    gap
        To stop at, in the unit of the objective.
    enough
        To stop when no walk can have a smaller value than this.
    max_evaluations
        After which to stop, whatever the time; None for no limit.
    on_progress
    clock
    """

    def __init__(
        self,
        evaluations: Evaluations,
        local: LocalSearch,
        make_bounds: Callable[[Check], tuple[WalkBound, FrontBounds]] | None,
        *,
        began: float,
        deadline: float | None,
        first_bound_by: float | None = None,
        gap: float,
        enough: float = math.inf,
        max_evaluations: int | None = None,
        on_progress: Callable[[SearchProgress], None] | None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._evaluations, self._local, self._make_bounds = evaluations, local, make_bounds
        self._began, self._gap, self._enough, self._on_progress = began, gap, enough, on_progress
        self._clock = clock
        self._end = math.inf if deadline is None else began + deadline
        self._end_of_first = self._end if first_bound_by is None else max(self._end, began + first_bound_by)
        self._warm = math.inf if deadline is None else began + WARM_UP_SHARE * deadline
        self._most = math.inf if max_evaluations is None else max_evaluations
        self._bound: WalkBound | None = None
        self._front: FrontBounds | None = None
        self._took: dict[str, list[float]] = {"whole": [], "front": []}  # seconds, by step of each kind
        self._no_time = False  # for one more step of the bound
        self._best = math.inf
        self._at_best = 0  # evaluations made when the best value was found
        self._restarts = 0  # of local search, since then
        self._batch = _FIRST_BATCH
        self._pace = 0.0  # seconds an evaluation, in the last batch
        self._ahead = 0.0  # seconds that local search has had more than the bound; with a deadline each gets half
        self._bounds: list[float] = []  # after each step

    @property
    def lower_bound(self) -> float:
        """No walk of the class has a smaller value; never above the best one found."""
        return -math.inf if self._bound is None else min(self._bound.lower_bound, self._best)

    @property
    def covers(self) -> str:
        """Which walks the lower bound covers."""
        return "" if self._bound is None else self._bound.covers

    @property
    def bound_by(self) -> str:
        """The name of the bound; empty where nothing is known."""
        return "" if self._bound is None or math.isinf(self.lower_bound) else self._bound.by

    @property
    def front_bounds(self) -> FloatArray:
        """Metres, and the least objective without cost that walks of up to so many metres can have, shape (G, 2)."""
        return np.zeros((0, 2)) if self._front is None else self._front.curve()

    @property
    def proven(self) -> bool:
        """Whether no walk can be better, to rounding; loops that a walk closes with itself are not counted."""
        return self._best - self.lower_bound <= SAME_VALUE * abs(self._best)

    def run(self, seeds: Sequence[Walk]) -> Reason:
        """Search, from some walks; returns why it stopped."""
        try:
            self._local.seed(seeds)
            while True:
                self._note()
                if self.proven and not self._evaluations.any_sees_itself:
                    self._bound_front()
                    return "proof"
                if self._best - self.lower_bound <= self._gap and self._gap > 0:
                    return "gap"
                if self.lower_bound >= self._enough:
                    return "enough"
                if self._clock() >= self._end:
                    if math.isinf(self.lower_bound) and not self._no_time:
                        self._bound_on()
                        self._note()
                    return "deadline"
                if len(self._evaluations) >= self._most:
                    self._bound_front()
                    return "evaluations"
                began = self._clock()
                moved = self._search_on()
                half = self._clock()
                self._ahead += half - began
                if (self._is_warm and (self._end == math.inf or self._ahead >= 0)) or not moved:
                    moved |= self._bound_on()
                    self._ahead -= self._clock() - half
                if not moved:
                    self._bound_front()
                    return "proof" if self.proven else "deadline" if self._no_time else "rest"
        except KeyboardInterrupt:
            if len(self._evaluations) == 0:
                raise
            return "interrupt"

    def _search_on(self) -> bool:
        """One batch of local search; whether there was anything left worth trying."""
        if len(self._evaluations) - self._at_best > _PATIENCE:
            return False
        began, before = self._clock(), len(self._evaluations)
        size, self._batch = max(1, min(self._batch, self._evaluations_left)), min(2 * self._batch, _LARGEST_BATCH)
        moved = bool(self._local.step(size))
        while not moved and self._restarts < _MOST_RESTARTS:
            self._restarts += 1
            moved = bool(self._local.restart(size))
        moved = moved or self._local.widen(size) > 0
        if (made := len(self._evaluations) - before) > 0:
            self._pace = (self._clock() - began) / made
        return moved

    @property
    def _evaluations_left(self) -> int:
        """How many end before the deadline, if they take as long as the last ones."""
        left = (self._end - self._clock()) / max(self._pace, 1e-9)
        return int(min(max(left, 0.0), _LARGEST_BATCH))

    @property
    def _is_warm(self) -> bool:
        """Whether local search has found first values, or the bound would come too late otherwise."""
        enough = min(_WARM_UP, WARM_UP_SHARE * self._most)
        return len(self._evaluations) >= enough or self._clock() >= self._warm

    def _bound_on(self) -> bool:
        """One step of the bound; whether it may still make progress."""
        if self._make_bounds is None:
            return False
        if self._bound is None or self._front is None:
            self._bound, self._front = self._make_bounds(self._check)
            self._bound.suggest([np.array(walk) for walk in self._evaluations.best_apart(_SUGGESTED)])
        if self._bound.finished or self.proven or self._bound_rests:
            return False
        if not self._has_time_for("whole"):
            self._no_time = True
            return False
        self._bound.prune(self._best)
        self._take(self._bound.step, "whole")
        self._bounds.append(self._bound.lower_bound)
        if len(self._bounds) % _STEPS_PER_FRONT_STEP == 0 and not self._front.finished and self._has_time_for("front"):
            self._step_front(self._front)
        return True

    def _bound_front(self) -> None:
        """All steps that the bounds of shorter walks are to have, as far as there is time."""
        while self._front is not None and not self._front.finished and self._has_time_for("front"):
            self._step_front(self._front)

    def _step_front(self, front: FrontBounds) -> None:
        self._take(lambda: front.step(self._evaluations.best_within), "front")

    def _take(self, step: Callable[[], list[IntArray]], kind: str) -> None:
        """One step of a kind; its walks are for local search."""
        began = self._clock()
        try:
            walks = step()
        except OutOfTimeError:
            self._no_time = True
            return
        self._took[kind].append(self._clock() - began)
        self._local.seed([tuple(walk.tolist()) for walk in walks])

    def _check(self) -> None:
        if self._clock() >= (self._end_of_first if math.isinf(self.lower_bound) else self._end):
            raise OutOfTimeError

    def _has_time_for(self, kind: str) -> bool:
        """Whether one more step of a kind would end before the deadline, if it takes as long as the last ones."""
        latest = self._took[kind][-_ONE_AS_LONG_AS:] or self._took["whole"][-_ONE_AS_LONG_AS:]
        end = self._end_of_first if math.isinf(self.lower_bound) else self._end
        return self._clock() + max(latest, default=0.0) <= end

    @property
    def _bound_rests(self) -> bool:
        """Whether its last steps closed hardly any of the gap."""
        if len(self._bounds) <= _STEPS_PER_LOOK or self._end < math.inf:
            return False
        before = self._bounds[-_STEPS_PER_LOOK - 1]
        return self._bounds[-1] - before < _LEAST_PROGRESS * (self._best - before)

    def _note(self) -> None:
        """Take in the best value, and tell of progress."""
        best = self._evaluations.value(self._evaluations.best())
        if best < self._best - SAME_VALUE * abs(best):
            self._best, self._at_best, self._restarts = best, len(self._evaluations), 0
        if self._on_progress is not None:
            seconds = self._clock() - self._began
            self._on_progress(SearchProgress(seconds, len(self._evaluations), self._best, self.lower_bound))
