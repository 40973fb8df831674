"""The bound over all walks of a roadmap by flows (docs, the mathematics, section 12).

Walks are paths through layers (`layers`), a mixture of walks is a flow through them, and the gain is a concave function of the flow.
Frank-Wolfe: at a flow x the longest path for the gradient is a walk, and no walk gains more than the linear function says there. The
walks found are an active set whose weights are optimised anew at each step.

Flows are in many corridors at once. So the walks are split: those whose t-th new pose stands on one side of a line, and those for
which it is on the other side. Each part has flows of its own; the least of their bounds is the bound of all.
"""

from __future__ import annotations

import heapq
import itertools
import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize

from topobelief.arrays import FloatArray, IntArray
from topobelief.candidates.roadmap import Roadmap
from topobelief.errors import InvalidInputError, PlanningError, require_choice
from topobelief.graph.pose_graph import PoseGraph
from topobelief.search.bound import ClosureRule
from topobelief.search.criteria import Criterion
from topobelief.search.information_gain import Slopes, gain_and_slopes
from topobelief.search.layers import build_layers, longest_path, longest_to_end
from topobelief.search.plans import Plan, mixture
from topobelief.search.reduced_prior import ReducedPrior, reduced_prior
from topobelief.search.rewards import Course, Rewards, allowed_arcs, odometry_powers, used_records
from topobelief.search.ways import Ways, find_sightings
from topobelief.world import World

_OBJECTIVES = ("error", "map", "joint", "per_pose")
_ARCS = 1_500_000  # aimed at: as many layers as make about so many arcs
_FINEST, _COARSEST = 40, 4  # pieces per spacing
_IDLE = 1e-4  # information of the odometry of idle poses, in that of others, where their number does not count
_SAME_PLACE = 1e-9  # metres
_ROUNDING = 1e-9  # relative; bounds are lowered by it
_LARGEST_SET = 40  # walks whose weights are optimised
_TOLL_TRIALS = 3  # longest paths a step, to find the price of a metre
_STEPS_BEFORE_SPLIT = 3
_SLOW = 0.15  # of what is missing to the best value: a part whose bound rises by less a step is split
_SLOW_STEPS = 4  # after so many, a part that cannot be split is left as it is
_LEAST_WEIGHT = 1e-3  # of walks that count where parts are split


@dataclass(eq=False, slots=True)
class _Part:
    """Some of the walks: those on paths of these arcs."""

    arcs: IntArray
    records: IntArray  # of the arcs, each once
    courses: list[Course] = field(default_factory=list["Course"])
    weights: FloatArray = field(default_factory=lambda: np.zeros(0))
    bound: float = -math.inf
    toll: float = 0.0
    ahead: float = 0.0  # D at the longest path
    steps: int = 0
    fresh: int = 0  # steps since it was made
    slow: int = 0  # latest steps in a row that hardly raised the bound


class FlowBound:
    """Lower bound of the objective over the walks of a roadmap; see `WalkBound` and `flow_bound`."""

    def __init__(
        self, prior: ReducedPrior, criterion: Criterion, rewards: Rewards, vertices: IntArray, max_length: float, covers: str
    ) -> None:
        self._prior, self._criterion, self._rewards = prior, criterion, rewards
        self._vertices, self._max_length, self._covers = vertices, max_length, covers
        self._best = math.inf
        self._closed = math.inf  # least bound of the parts that cannot be split
        self._bound = -math.inf
        self._counter = itertools.count()
        arcs = rewards.layers.arcs
        every = np.arange(len(arcs.source))
        whole = _Part(every, used_records(arcs, every, len(rewards.layers.records.number)))
        self._open: list[tuple[float, int, _Part]] = [(-math.inf, next(self._counter), whole)]
        self._begin, self._end = rewards.places()
        self._num_arcs = len(every)
        self.num_steps = 0

    @property
    def lower_bound(self) -> float:
        return self._bound

    @property
    def covers(self) -> str:
        return self._covers

    @property
    def finished(self) -> bool:
        return not self._open

    @property
    def share_ruled_out(self) -> float:
        """Share of the layers' arcs that lie on no walk which may be better than the best one known."""
        kept = np.zeros(self._num_arcs, dtype=bool)
        for _, _, part in self._open:
            kept[part.arcs] = True
        return 1 - float(kept.mean()) if len(kept) else 0.0

    @property
    def num_parts(self) -> int:
        """Into how many parts the walks that may be better than the best one known are split."""
        return len(self._open)

    def prune(self, best_value: float) -> None:
        self._best = min(self._best, best_value)
        self._criterion = self._criterion.compared_with(self._best)
        self._open = [entry for entry in self._open if entry[0] < self._best]
        heapq.heapify(self._open)
        self._update()

    def step(self) -> list[IntArray]:
        if not self._open:
            return []
        _, _, part = heapq.heappop(self._open)
        parts = [part]
        if part.fresh >= _STEPS_BEFORE_SPLIT and part.slow >= 1:
            halves = self._split(part)
            if halves is not None:
                parts = halves
            elif part.slow >= _SLOW_STEPS:
                self._closed = min(self._closed, part.bound)
                parts = []
        found: list[IntArray] = []
        for each in parts:
            found.extend(self._improved(each))
            if len(each.arcs) and each.bound < self._best:
                heapq.heappush(self._open, (each.bound, next(self._counter), each))
        self.num_steps += 1
        self._update()
        return found

    def _update(self) -> None:
        least = min((entry[0] for entry in self._open), default=math.inf)
        bound = min(least, self._best, self._closed)
        if bound > self._bound and bound < math.inf:
            self._bound = bound

    def _improved(self, part: _Part) -> list[IntArray]:
        """One step of Frank-Wolfe on a part: its bound, its walks, their weights."""
        criterion, rewards = self._criterion, self._rewards
        layers = rewards.layers
        plan = mixture([course.plan for course in part.courses], part.weights) if part.courses else self._nothing()
        gain, slopes = gain_and_slopes(self._prior, criterion.kind, plan)
        offset = slopes.of(plan)
        priced = bool(rewards.prices.any()) or criterion.has_costs
        rate = criterion.least_rate(gain, part.ahead) if priced else 1.0
        worth = rewards.of_records(slopes, part.records)
        at_end = -criterion.at_end() / rate if priced else np.zeros(rewards.num_new + 1)
        price = criterion.price / rate if priced else 0.0
        best: tuple[float, FloatArray, FloatArray, float] | None = None  # D less linear terms, weights, lengths ahead, toll
        found: list[Course] = []
        lines: list[tuple[float, float]] = []  # a path's worth without toll, and its length
        toll = part.toll
        for _ in range(_TOLL_TRIALS):
            weights = rewards.of_arcs(worth, part.arcs, slopes, price, toll, at_end)
            longest = longest_path(layers, part.arcs, weights)
            if longest.value == -math.inf:
                part.bound, part.arcs = math.inf, part.arcs[:0]
                return []
            total = longest.value - offset + toll * self._max_length
            course = rewards.course(longest.arcs, slopes)
            if best is None or total < best[0]:
                best = total, weights, longest.ahead, toll
            found.append(course)
            lines.append((longest.value + toll * course.plan.length, course.plan.length))
            following = self._next_toll(lines, toll)
            if following is None:
                break
            toll = following
        assert best is not None
        total, weights, lengths, part.toll = best
        part.ahead = total if not priced else slopes.of(found[-1].plan) - offset
        if priced:
            ahead = part.ahead if part.steps else 0.0
            rate_now = criterion.least_rate(gain, ahead)
            ahead = ahead if abs(rate_now - rate) <= 1e-12 * rate else self._tangent(gain, rate)
            bound = criterion.least(gain, ahead) + rate * (ahead - total)
            threshold = ahead + (criterion.least(gain, ahead) - criterion.from_objective(self._best)) / rate
        else:
            bound = criterion.least(gain, total)
            threshold = criterion.needed(gain, self._best) if math.isfinite(self._best) else -math.inf
        value = criterion.to_objective(criterion.of_gain(gain) + criterion.linear(plan))
        bound = criterion.to_objective(bound)
        bound -= _ROUNDING * (abs(bound) + abs(criterion.of_gain(0.0)))
        missing = self._best - part.bound
        slow = bound - part.bound < (_SLOW * missing if math.isfinite(missing) else _SLOW * (value - part.bound))
        part.slow = part.slow + 1 if slow else 0
        part.bound = max(part.bound, bound)
        if math.isfinite(threshold):
            self._thin(part, weights, lengths, threshold + offset - part.toll * self._max_length)
        part.steps += 1
        part.fresh += 1
        self._reweigh(part, found)
        return [walk for walk in map(self._walk, found) if walk is not None]

    def _tangent(self, gain: float, rate: float) -> float:
        """D at which the least value falls as fast as `rate`."""
        criterion = self._criterion
        if criterion.kind == "error":
            left = criterion.start - gain
            return left * ((2 * rate * math.sqrt(left)) ** (-2 / 3) - 1)
        return criterion.size / 2 * (1 / rate - 1)

    def _next_toll(self, lines: list[tuple[float, float]], toll: float) -> float | None:
        """The price of a metre to try next: where the best too long path and the best one within the length tie."""
        worth, length = lines[-1]
        slack = _SAME_PLACE + _ROUNDING * self._max_length
        if length <= self._max_length + slack and toll == 0.0:
            return None
        over = [line for line in lines if line[1] > self._max_length + slack]
        within = [line for line in lines if line[1] <= self._max_length + slack]
        if not over:
            return 0.0 if len(lines) == 1 else None
        longest = max(over, key=lambda line: line[0] - toll * line[1])
        if not within:
            excess = longest[1] - self._max_length
            return 2 * toll if toll else 0.1 * max(abs(worth), 1e-300) / max(self._max_length, excess)
        shortest = max(within, key=lambda line: line[0] - toll * line[1])
        following = (longest[0] - shortest[0]) / (longest[1] - shortest[1])
        return following if following > 0 and abs(following - toll) > 1e-3 * toll else None

    def _thin(self, part: _Part, weights: FloatArray, ahead: FloatArray, threshold: float) -> None:
        """Leave out arcs on no path that is longer than a threshold."""
        layers, arcs = self._rewards.layers, self._rewards.layers.arcs
        behind = longest_to_end(layers, part.arcs, weights)
        target = arcs.target[part.arcs]
        rest = np.where(target >= 0, behind[target], 0.0)
        through = ahead[arcs.source[part.arcs]] + weights + rest
        kept = through > threshold - _ROUNDING * (abs(threshold) + np.abs(weights))
        if not kept.all():
            part.arcs = part.arcs[kept]
            part.records = used_records(arcs, part.arcs, len(layers.records.number))

    def _reweigh(self, part: _Part, found: list[Course]) -> None:
        """Add walks to the active set and optimise all weights: a concave function over a simplex."""
        used = part.weights > 1e-4
        courses = [course for course, keep in zip(part.courses, used, strict=True) if keep] + found
        part.courses = courses[-_LARGEST_SET:]
        start = np.concatenate([part.weights[used], np.zeros(len(found))])[-_LARGEST_SET:]
        start = start / start.sum() if start.sum() > 0 else np.full(len(start), 1 / len(start))
        if len(start) == 1:
            part.weights = start
            return
        plans = [course.plan for course in part.courses]
        lengths = np.array([plan.length for plan in plans])
        touched = np.flatnonzero(sum(plan.closures.any(axis=0) for plan in plans))
        criterion = self._criterion
        linear = np.array([criterion.linear(plan) for plan in plans])
        scale = 1e-2 * max(abs(criterion.of_gain(0.0)), 1e-300) if criterion.kind == "error" else 1.0

        def fun(weights: FloatArray) -> tuple[float, FloatArray]:
            weights = np.maximum(weights, 0.0)
            weights = weights / weights.sum()
            gained, slopes = gain_and_slopes(self._prior, criterion.kind, mixture(plans, weights), among=touched)
            rate = criterion.rate(gained)
            gradient = linear - rate * np.array([slopes.of(plan) for plan in plans])
            return (criterion.of_gain(gained) + float(linear @ weights)) / scale, gradient / scale

        limit = max(self._max_length, float(lengths.min()), float(start @ lengths))
        constraints = [
            {"type": "eq", "fun": lambda w: w.sum() - 1, "jac": lambda w: np.ones(len(w))},
            {"type": "ineq", "fun": lambda w: limit - lengths @ w, "jac": lambda w: -lengths},
        ]
        result = minimize(
            fun, start, jac=True, method="SLSQP", bounds=[(0, 1)] * len(start), constraints=constraints,
            options={"maxiter": 8, "ftol": 1e-6},
        )  # fmt: skip
        weights = np.maximum(np.asarray(result.x), 0.0)
        if np.isfinite(weights).all() and weights.sum() > 0.5 and fun(weights)[0] <= fun(start)[0]:
            part.weights = weights / weights.sum()
        else:
            part.weights = start

    def _nothing(self) -> Plan:
        """A plan to begin with: no closures, and odometry as on the first way."""
        rewards = self._rewards
        closures = np.zeros((rewards.num_new, len(self._prior.closures)))
        odometry = np.broadcast_to(rewards.powers[0, 0], (rewards.num_new, *rewards.idle.shape)).copy()
        return Plan(closures, odometry, 0.0, 0.0, 0.0)

    def _walk(self, course: Course) -> IntArray | None:
        """The vertices of a walk within the length, or None."""
        if course.plan.length > self._max_length + _SAME_PLACE:
            return None
        ways = self._rewards.layers.arcs.way[course.arcs]
        targets = self._rewards.ways.target[ways[ways >= 0]]
        places = np.concatenate([[self._rewards.layers.first_state], targets])
        vertices = self._vertices[places]
        return vertices[vertices >= 0]

    def _split(self, part: _Part) -> list[_Part] | None:
        """Two parts of the walks, by what separates the weight of the active set best; None where its walks agree.

        That is the side of a line on which one of the new poses stands, or the number of new poses.
        """
        layers = self._rewards.layers
        line, count = self._dividing_line(part), self._dividing_number(part)
        if line is None and count is None:
            return None
        if count is None or (line is not None and line[0] >= count[0]):
            assert line is not None
            _, number, normal, at = line
            is_it = layers.records.number == number
            one, other = self._begin @ normal, self._end @ normal
            kept = [
                allowed_arcs(layers.arcs, part.arcs, ~is_it | side)
                for side in (np.minimum(one, other) <= at, np.maximum(one, other) >= at)
            ]
        else:
            last = layers.arcs.last[part.arcs]
            kept = [part.arcs[(last < 0) | (last <= count[1])], part.arcs[(last < 0) | (last > count[1])]]
        return [self._restricted(part, arcs) for arcs in kept]

    def _restricted(self, part: _Part, arcs: IntArray) -> _Part:
        """The walks of a part that take these arcs only."""
        layers = self._rewards.layers
        within = np.array([bool(np.isin(course.arcs, arcs, assume_unique=True).all()) for course in part.courses], dtype=bool)
        courses = [course for course, keep in zip(part.courses, within, strict=True) if keep]
        weights = part.weights[within]
        total = float(weights.sum())
        weights = weights / total if total > 0 else np.full(len(courses), 1 / max(len(courses), 1))
        records = used_records(layers.arcs, arcs, len(layers.records.number))
        return _Part(arcs, records, courses, weights, part.bound, part.toll)

    def _dividing_line(self, part: _Part) -> tuple[float, int, FloatArray, float] | None:
        """Score, number of a new pose, unit vector, and where along it to cut."""
        records = self._rewards.layers.records
        middle = (self._begin + self._end) / 2
        best: tuple[float, int, FloatArray, float] | None = None
        numbers = [records.number[course.records] for course in part.courses]
        for t in range(1, self._rewards.num_new + 1):
            places: list[FloatArray] = []
            weights: list[float] = []
            for course, number, weight in zip(part.courses, numbers, part.weights.tolist(), strict=True):
                at = np.flatnonzero(number == t)
                if at.size and weight > _LEAST_WEIGHT:
                    places.append(middle[course.records[at[0]]])
                    weights.append(weight)
            if len(places) < 2:
                continue
            cut = _best_cut(np.array(places), np.array(weights), self._rewards.delta)
            if cut is not None and (best is None or cut[0] > best[0]):
                best = cut[0], t, cut[1], cut[2]
        return best

    def _dividing_number(self, part: _Part) -> tuple[float, int] | None:
        """Score, and up to how many new poses the walks of one side have."""
        used = part.weights > _LEAST_WEIGHT
        number = np.array([course.plan.num_poses for course, keep in zip(part.courses, used, strict=True) if keep])
        if len(number) < 2 or np.ptp(number) == 0:
            return None
        spacing = self._rewards.delta * self._rewards.layers.pieces_per_pose
        cut = _cut_along(spacing * number, part.weights[used], 0.5 * spacing)
        return None if cut is None else (cut[0], math.floor(cut[1] / spacing))


def _best_cut(places: FloatArray, weights: FloatArray, least: float) -> tuple[float, FloatArray, float] | None:
    """Score, normal of a line across the main axis of some places, and where along it the line is."""
    mean = weights @ places / weights.sum()
    scatter = (places - mean).T @ ((places - mean) * weights[:, None])
    normal = np.linalg.eigh(scatter)[1][:, -1]
    cut = _cut_along(places @ normal, weights, least)
    return None if cut is None else (cut[0], normal, cut[1])


def _cut_along(values: FloatArray, weights: FloatArray, least: float) -> tuple[float, float] | None:
    """Where to cut numbers, further than `least` apart, so that the variance between the two sides is largest; that and the place."""
    order = np.argsort(values)
    values, share = values[order], weights[order] / weights.sum()
    left = np.cumsum(share)[:-1]
    below = np.cumsum(share * values)[:-1] / left
    above = (share @ values - left * below) / np.maximum(1 - left, _LEAST_WEIGHT)
    between = np.where(np.diff(values) > least, left * (1 - left) * (above - below) ** 2, 0.0)
    cut = int(np.argmax(between))
    return (float(between[cut]), float((values[cut] + values[cut + 1]) / 2)) if between[cut] > 0 else None


def flow_bound(
    graph: PoseGraph,
    roadmap: Roadmap,
    *,
    start: int,
    goal: int | None,
    max_length: float,
    objective: str,
    closures: ClosureRule,
    spacing: float,
    information: ArrayLike,
    world: World | None,
    cost_per_metre: float = 0.0,
    return_to_start: bool = False,
    pose: int | None = None,
    edge_costs: ArrayLike | None = None,
    pieces_per_pose: int | None = None,
) -> FlowBound:
    """The bound over the walks from one vertex of a roadmap.

    It covers every walk that `predict_actions` makes an action of with these closures, this spacing and information, and no turn,
    and counts the closures with poses of the map. Closures among the walk's own new poses are not counted.

    Parameters
    ----------
    graph
        At its estimate.
    roadmap
    start, goal
        Vertices of the roadmap. Without a goal walks may end at any vertex, or at the start if they are to return.
    max_length
        Metres along the walk.
    objective
        "error" (metres), "map", "joint" (nats) or "per_pose" (nats a pose).
    closures
    spacing
        Metres from new pose to new pose.
    information : shape (kappa, kappa)
        Of every predicted factor.
    world
        What poses must see each other in; None: they always do.
    cost_per_metre
        In the unit of the objective.
    return_to_start
    pose
        Of the graph, to which the first new pose is joined. Default: the last one.
    edge_costs : shape (edges of the roadmap,), optional
        What driving each edge costs beyond its length, in the unit of the objective: time, energy, risk.
    pieces_per_pose
        Into how many layers the spacing is cut. Default: as many as are affordable, from 4 to 40.

    Raises
    ------
    InvalidInputError
        For an unknown objective, or a number out of range.
    PlanningError
        Where no walk within the length reaches the goal.
    """
    require_choice("objective", objective, _OBJECTIVES)
    omega = np.asarray(information, dtype=np.float64)
    pose = graph.num_poses - 1 if pose is None else pose
    if not (math.isfinite(max_length) and max_length >= 0):
        raise InvalidInputError(f"expected a length of at least 0 m, got {max_length}")
    if not (math.isfinite(cost_per_metre) and cost_per_metre >= 0):
        raise InvalidInputError(f"expected a cost of at least 0 a metre, got {cost_per_metre}")
    extra = np.zeros(len(roadmap.edges)) if edge_costs is None else np.asarray(edge_costs, dtype=np.float64)
    end = start if return_to_start and goal is None else goal
    to_go = np.zeros(len(roadmap.vertices)) if end is None else roadmap.distances_to(end)
    if not to_go[start] <= max_length * (1 + _ROUNDING):
        raise PlanningError(
            f"expected a length of at least {to_go[start]:.2f} m, that of the shortest path, got {max_length:g} m; allow more"
        )
    from_start = roadmap.distances_to(start)
    a, b = roadmap.edges.T
    lengths = roadmap.lengths
    edges = np.tile(np.arange(len(lengths)), 2)
    source, target = np.r_[a, b], np.r_[b, a]
    alive = from_start[source] + lengths[edges] + to_go[target] <= max_length * (1 + _ROUNDING) + _SAME_PLACE
    alive &= lengths[edges] > 0
    edges, source, target = edges[alive], source[alive], target[alive]
    kept = np.unique(np.concatenate([source, target, [start]]))
    vertices = np.concatenate([kept, [-1]])  # the last one: the pose where the robot is
    place = np.full(len(roadmap.vertices), -1)
    place[kept] = np.arange(len(kept))
    at_pose, begin = len(kept), graph.positions[pose, :2]
    lead_in = float(np.linalg.norm(roadmap.vertices[start] - begin))
    has_lead = lead_in > _SAME_PLACE
    lead = [at_pose] if has_lead else []
    points = np.concatenate([roadmap.vertices[kept], begin[None]])
    source = np.r_[place[source], lead].astype(np.int64)
    target = np.r_[place[target], [place[start]] if has_lead else []].astype(np.int64)
    ways = Ways(source, target, points[source], points[target], np.linalg.norm(points[target] - points[source], axis=1))
    if len(ways.source) == 0:
        raise PlanningError(f"expected a roadmap with a way of at most {max_length:g} m from the start, got none; allow more")
    driven = np.r_[lengths[edges], [0.0] if has_lead else []]
    prices = np.r_[cost_per_metre * lengths[edges] + extra[edges], [0.0] if has_lead else []]
    whole = max_length + (lead_in if has_lead else 0.0)
    is_end = np.ones(len(points), dtype=bool)
    if end is not None:
        is_end[:] = vertices == end
    is_end[at_pose] = False
    remaining = np.concatenate([to_go[kept], [lead_in + to_go[start]]])
    if pieces_per_pose is None:
        slack = max_length - from_start[vertices[source[: len(edges)]]] - lengths[edges] - to_go[vertices[target[: len(edges)]]]
        per_metre = 1.5 * float(np.maximum(slack, 0.0).sum())  # arcs, for layers of one metre
        pieces_per_pose = int(np.clip(_ARCS * spacing / max(per_metre, 1e-9), _COARSEST, _FINEST))
    delta = spacing / pieces_per_pose
    first_vertex = at_pose if has_lead else int(place[start])
    layers = build_layers(ways, first_vertex, remaining, is_end, whole, delta, pieces_per_pose)
    num_new = max(1, int(layers.records.number.max(initial=1)))
    sightings = find_sightings(graph, ways, pose, delta, closures, world, num_new)
    seen = sightings.seen if len(sightings.seen) else np.array([pose])
    prior = reduced_prior(
        graph,
        pose,
        seen,
        omega,
        probability=closures.probability,
        min_index_gap=closures.min_index_gap,
        with_errors=objective == "error",
    )
    powers = odometry_powers(graph.group, ways.poses(graph, pose), graph.positions[pose], omega)
    idle = powers[0, 0] * (_IDLE if objective in ("error", "map") else 1.0)
    fewest = max(0, math.ceil((whole - max_length + to_go[start]) / spacing - 1e-6))
    criterion = Criterion.of(objective, prior, idle, num_new, fewest)
    most = closures.max_per_pose or 0
    rewards = Rewards(layers, ways, sightings, delta, powers, idle, prior.earliest, most, num_new, driven, prices)
    covers = (
        f"every walk of the roadmap of at most {max_length:.6g} m"
        + (" to the goal" if goal is not None else " that returns to its start" if return_to_start else "")
        + ", counting loop closures with the poses of the map, not those among its own new poses; by flows in layers of "
        f"{100 * delta:.3g} cm"
    )
    return FlowBound(prior, criterion, rewards, vertices, max_length, covers)
