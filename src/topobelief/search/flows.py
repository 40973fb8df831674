"""The bound over all walks of a roadmap by flows (docs, the mathematics, section 13).

Walks are paths through layers (`layers`), a mixture of walks is a flow through them, and the gain is a concave function of
the flow. Frank-Wolfe: at a flow x the longest path for the gradient is a walk, and no walk gains more than the linear
function says there. The walks found are an active set whose weights are optimised anew at each step.

Flows are in many corridors at once. So the walks are split: those whose t-th new pose stands on one side of a line, and
those for which it is on the other side. Each part has flows of its own; the least of their bounds is the bound of all.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.linalg.block_cholesky import Int32Array
from topobelief.search.bound import Check, unchecked
from topobelief.search.criteria import Criterion
from topobelief.search.information_gain import Slopes, gain_and_slopes
from topobelief.search.longest_paths import arcs_above, arcs_to_ends, longest_path
from topobelief.search.parts import Part, split
from topobelief.search.plans import Background, Mixture
from topobelief.search.rewards import Course, Rewards, used_records
from topobelief.search.tolls import next_toll
from topobelief.search.topological_prior import SeenPrior
from topobelief.search.weights import best_weights

_ROUNDING = 1e-9  # relative; bounds are lowered by it
_TIE = 1e-6  # of a layer: lengths that differ by less are equal
_BACKGROUND = 1e-5  # share of the background in each flow: it is counted as if walks had it, which lowers bounds by as little
_LARGEST_SET = 40  # walks whose weights are optimised
_TOLL_TRIALS = 2  # longest paths a step, to find the price of a metre
_STEPS_BEFORE_SPLIT = 3
_SLOW = 0.15  # of what is missing to the value of the flow: a step that raises the bound by less is slow
_CONVERGED = 0.25  # of what is missing to the best value: a part whose own optimum is known that well is split
_SLOW_STEPS = (3, 8)  # after so many in a row a part is split too, with one cell and with several; a few more, and it is left


class FlowBound:
    """Lower bound of the objective over the walks of a roadmap; see `WalkBound` and `walk_bounds`."""

    def __init__(
        self,
        prior: SeenPrior,
        criterion: Criterion,
        rewards: Rewards,
        background: Background,
        vertices: IntArray,
        max_length: float,
        lead_in: float,
        covers: str,
        arcs: Int32Array,
        check: Check = unchecked,
    ) -> None:
        self._check = check
        self._prior, self._criterion, self._rewards, self._background = prior, criterion, rewards, background
        self._vertices, self._max_length, self._lead_in, self._covers = vertices, max_length, lead_in, covers
        self._best = math.inf
        layers = rewards.layers
        self._closed = np.full(layers.num_layers, math.inf)  # least bounds of the parts that cannot be split
        self._by_layer = np.full(layers.num_layers, -math.inf)
        self._counter = itertools.count()
        records = used_records(layers.arcs, arcs, len(layers.records.number))
        whole = Part(arcs, records, by_layer=self._by_layer)
        self._open: list[tuple[float, int, Part]] = [(-math.inf, next(self._counter), whole)]
        self._slow_steps = _SLOW_STEPS[layers.num_labels > 1]
        self._arcs = arcs
        self._suggested: list[IntArray] = []
        ends = rewards.delta * (np.arange(layers.num_layers) + 2.0) - lead_in
        self._longest = np.minimum(ends, max_length)  # metres, of walks that end in each layer or in the next one
        self.num_steps = 0

    def within(self, max_length: float) -> FlowBound:
        """The bound of those walks that are no longer than a length, their costs not counted."""
        layers, arcs = self._rewards.layers, self._rewards.layers.arcs
        free = replace(self._rewards, prices=np.zeros(len(self._rewards.prices)))
        number = arcs.source // layers.num_spots
        ends_late = number + np.where(arcs.way < 0, 0, layers.whole_layers[arcs.way]) > self._last_layer(max_length)
        which = np.flatnonzero((arcs.target >= 0) | ~ends_late).astype(np.int32)
        which = arcs_to_ends(layers, which)
        return FlowBound(
            self._prior, self._criterion, free, self._background, self._vertices, max_length, self._lead_in, "", which,
            self._check,
        )  # fmt: skip

    def _last_layer(self, length: float) -> int:
        """The last layer in which walks of up to a length end."""
        return int(np.floor((length + self._lead_in) / self._rewards.delta + _TIE))

    @property
    def lower_bound(self) -> float:
        return float(self._by_layer[-1])

    @property
    def num_arcs(self) -> float:
        """Of the layers, about, if there were one cell."""
        layers = self._rewards.layers
        return len(layers.arcs.source) * len(self._vertices) / layers.num_spots

    @property
    def counts_costs(self) -> bool:
        """Whether driving costs anything."""
        return bool(self._rewards.prices.any())

    def by_length(self) -> FloatArray:
        """Metres and the least value that walks of up to so many metres can have, by increasing length, shape (layers, 2)."""
        metres = self._rewards.delta * (np.arange(len(self._by_layer)) + 1.0 - 2 * _TIE) - self._lead_in
        upto = self._last_layer(self._max_length) + 1
        return np.column_stack([np.minimum(metres, self._max_length), self._by_layer])[:upto]

    @property
    def covers(self) -> str:
        return self._covers

    @property
    def finished(self) -> bool:
        return not self._open

    @property
    def share_ruled_out(self) -> float:
        """Share of the layers' arcs that lie on no walk which may be better than the best one known."""
        kept = np.zeros(len(self._rewards.layers.arcs.source), dtype=bool)
        for _, _, part in self._open:
            kept[part.arcs] = True
        return 1 - float(kept[self._arcs].mean()) if len(self._arcs) else 0.0

    @property
    def num_parts(self) -> int:
        """Into how many parts the walks that may be better than the best one known are split."""
        return len(self._open)

    def suggest(self, walks: Sequence[IntArray]) -> None:
        """Walks that are known to be good, as vertices of the roadmap; before the first step, which begins with them."""
        self._suggested = list(walks)

    def prune(self, best_value: float) -> None:
        self._best = min(self._best, best_value)
        self._criterion = self._criterion.compared_with(self._best)
        self._open = [entry for entry in self._open if entry[0] < self._best]
        heapq.heapify(self._open)
        self._update()

    def step(self) -> list[IntArray]:
        if not self._open:
            return []
        _, _, part = self._open[0]  # it stays there until its work is done, which may be interrupted
        self._reweigh(part)
        parts = [part]
        if part.fresh >= _STEPS_BEFORE_SPLIT and part.is_ready:
            halves = split(part, self._rewards)
            if halves is not None:
                parts = halves
            elif part.slow >= self._slow_steps + 3:
                self._closed, parts = np.minimum(self._closed, part.by_layer), []
        found: list[IntArray] = []
        try:
            for each in parts:
                found.extend(self._improved(each))
        finally:
            self._update()
        heapq.heappop(self._open)
        for each in parts:
            if len(each.arcs) and each.bound < self._best:
                heapq.heappush(self._open, (each.bound, next(self._counter), each))
        self.num_steps += 1
        self._update()
        return found

    def _update(self) -> None:
        least = np.minimum.reduce([self._closed, *(part.by_layer for _, _, part in self._open)])
        if min(least[-1], self._best) < math.inf:
            self._by_layer = np.maximum(self._by_layer, np.minimum(least, self._best))

    def _improved(self, part: Part) -> list[IntArray]:
        """One step of Frank-Wolfe on a part: its bound, its walks, their weights."""
        criterion, rewards = self._criterion, self._rewards
        layers = rewards.layers
        plan = self._mixture(part)
        self._check()
        gain, slopes = gain_and_slopes(self._prior, criterion.kind, plan)
        if part.courses:
            offset = sum(w * slopes.of(c.plan) for w, c in zip(part.weights.tolist(), part.courses, strict=True))
        else:
            offset = slopes.of_background(self._background)
        priced = bool(rewards.prices.any()) or criterion.counts_poses
        rate = criterion.least_rate(gain, part.ahead) if priced else 1.0
        self._check()
        worth = rewards.of_records(slopes, part.records)
        at_end = -criterion.at_end() / rate if priced else np.zeros(rewards.num_new + 1)
        price = criterion.price / rate if priced else 0.0
        best: tuple[float, FloatArray, float] | None = None  # D less linear terms, lengths ahead, toll
        by_layer = np.full(layers.num_layers, math.inf)  # the same D, over the walks that end up to each layer
        found: list[Course] = []
        lines: list[tuple[float, float]] = []  # a path's worth without toll, and its length
        toll = part.toll
        weights = rewards.of_arcs(worth, part.arcs, slopes, price, at_end)
        for _ in range(_TOLL_TRIALS):
            self._check()
            longest = longest_path(layers, part.arcs, weights, toll * rewards.driven)
            if longest.value == -math.inf:
                part.by_layer, part.arcs = np.full(layers.num_layers, math.inf), part.arcs[:0]
                return []
            total = longest.value - offset + toll * self._max_length
            by_layer = np.minimum(by_layer, np.maximum.accumulate(longest.by_layer + toll * self._longest) - offset)
            course = rewards.course(longest.arcs, slopes)
            if best is None or total < best[0]:
                best = total, longest.ahead, toll
            found.append(course)
            lines.append((longest.value + toll * course.plan.length, course.plan.length))
            following = next_toll(lines, toll, self._max_length)
            if following is None:
                break
            toll = following
        assert best is not None
        latest = found[-1]
        total, lengths, part.toll = best
        part.ahead = total if not priced else max(slopes.of(latest.plan) - offset, 0.0)
        if priced:
            ahead = part.ahead if part.steps else 0.0
            rate_now = criterion.least_rate(gain, ahead)
            ahead = ahead if abs(rate_now - rate) <= 1e-12 * rate else self._tangent(gain, rate)
            at_tangent = float(criterion.least(gain, np.array([ahead]))[0])
            least = at_tangent + rate * (ahead - by_layer)
            threshold = ahead + (at_tangent - criterion.from_objective(self._best)) / rate
        else:
            least = criterion.least(gain, by_layer)
            threshold = criterion.needed(gain, self._best) if math.isfinite(self._best) else -math.inf
        value = float(criterion.to_objective(np.array([criterion.of_gain(gain) + criterion.linear(plan)]))[0])
        by_layer = criterion.to_objective(least)
        by_layer = by_layer - _ROUNDING * (np.where(np.isinf(by_layer), 0.0, np.abs(by_layer)) + abs(criterion.of_gain(0.0)))
        bound = float(by_layer[-1])
        missing = self._best - max(part.bound, bound)
        converged = value - max(part.bound, bound) < _CONVERGED * missing if math.isfinite(missing) else False
        part.slow = part.slow + 1 if bound - part.bound < _SLOW * abs(value - part.bound) else 0
        part.is_ready = converged or part.slow >= self._slow_steps
        part.by_layer = np.maximum(part.by_layer, by_layer)
        self._check()
        found += [course for walk in self._suggested if (course := self._course_of(walk, part, weights, slopes)) is not None]
        self._suggested = []
        if math.isfinite(threshold):
            self._thin(part, weights, lengths, threshold + offset - part.toll * self._max_length)
        part.steps += 1
        part.fresh += 1
        part.found = found
        return [walk for course in found if (walk := rewards.walk(course.arcs, self._vertices, self._max_length)) is not None]

    def _course_of(self, walk: IntArray, part: Part, weights: FloatArray, slopes: Slopes) -> Course | None:
        """The longest path that drives the ways of a walk alone; None where there is none."""
        ways, layers, size = self._rewards.ways, self._rewards.layers, int(self._vertices.max()) + 2
        source, target = self._vertices[ways.source] + 1, self._vertices[ways.target] + 1  # 0: where the robot is
        driven = np.isin(source * size + target, (walk[:-1] + 1) * size + walk[1:] + 1) | (source == 0)
        which = np.append(driven, len(walk) == 1)[layers.arcs.way[part.arcs]]
        longest = longest_path(layers, part.arcs[which], weights[which], np.zeros(len(ways.source)))
        return None if longest.value == -math.inf else self._rewards.course(longest.arcs, slopes)

    def _tangent(self, gain: float, rate: float) -> float:
        """D at which the least value falls as fast as `rate`."""
        criterion = self._criterion
        if criterion.kind == "error":
            left = criterion.start - gain
            return left * ((2 * rate * math.sqrt(left)) ** (-2 / 3) - 1)
        return criterion.size / 2 * (1 / rate - 1)

    def _thin(self, part: Part, weights: FloatArray, ahead: FloatArray, threshold: float) -> None:
        """Leave out arcs on no path that is longer than a threshold."""
        layers = self._rewards.layers
        kept = arcs_above(layers, part.arcs, weights, part.toll * self._rewards.driven, ahead, threshold)
        if len(kept) < len(part.arcs):
            part.arcs = kept
            part.records = used_records(layers.arcs, kept, len(layers.records.number))

    def _reweigh(self, part: Part) -> None:
        """Add what was found to the active set and optimise all weights: a concave function over a simplex."""
        found = part.found
        if not found:
            return
        used = part.weights > 1e-4
        courses = [course for course, keep in zip(part.courses, used, strict=True) if keep] + found
        courses = courses[-_LARGEST_SET:]
        start = np.concatenate([part.weights[used], np.zeros(len(found))])[-_LARGEST_SET:]
        start = start / start.sum() if start.sum() > 0 else np.full(len(start), 1 / len(start))
        plans = [course.plan for course in courses]
        lengths = np.array([plan.length for plan in plans])
        touched = np.flatnonzero(np.array([plan.closures.any(axis=0) for plan in plans]).any(axis=0))
        background = self._background
        criterion = self._criterion
        linear = np.array([criterion.linear(plan) for plan in plans])
        scale = 1e-2 * max(abs(criterion.of_gain(0.0)), 1e-300) if criterion.kind == "error" else 1.0

        def value(weights: FloatArray) -> tuple[float, FloatArray]:
            self._check()
            mixture = Mixture(plans, weights, background, _BACKGROUND, only_used=True)
            gained, slopes = gain_and_slopes(self._prior, criterion.kind, mixture, among=touched)
            gradient = linear - criterion.rate(gained) * np.array([slopes.of(plan) for plan in plans])
            return (criterion.of_gain(gained) + float(linear @ weights)) / scale, gradient / scale

        weights = best_weights(value, start, lengths, max(self._max_length, float(lengths.min())))
        part.courses, part.weights, part.found = courses, weights, []

    def _mixture(self, part: Part) -> Mixture:
        """The flow of a part; the background to begin with."""
        plans = [course.plan for course in part.courses]
        return Mixture(plans, part.weights, self._background, _BACKGROUND if plans else 1.0)
