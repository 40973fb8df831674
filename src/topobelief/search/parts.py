"""Parts of the walks of a roadmap, and how a part is split: by the side of a line on which one of the new poses stands, or by
the number of new poses."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.linalg.block_cholesky import Int32Array
from topobelief.search.cuts import best_line, best_place
from topobelief.search.rewards import Course, Rewards, allowed_arcs, used_records

_LEAST_WEIGHT = 1e-3  # of walks that count where parts are split
_SMALL_WEIGHT = 0.05  # of all walks of the active set, where those that count agree


@dataclass(eq=False, slots=True)
class Part:
    """Some of the walks: those on paths of these arcs."""

    arcs: Int32Array
    records: Int32Array  # of the arcs, each once
    courses: list[Course] = field(default_factory=list["Course"])
    weights: FloatArray = field(default_factory=lambda: np.zeros(0))
    by_layer: FloatArray = field(default_factory=lambda: np.zeros(0))  # bound of the walks that end up to each layer
    toll: float = 0.0
    ahead: float = 0.0  # D at the longest path
    steps: int = 0
    fresh: int = 0  # steps since it was made
    slow: int = 0  # latest steps in a row that hardly raised the bound
    is_ready: bool = False  # to be split
    found: list[Course] = field(default_factory=list["Course"])  # in the last step; not in the active set yet

    @property
    def bound(self) -> float:
        """Of all its walks."""
        return float(self.by_layer[-1])


def split(part: Part, rewards: Rewards) -> list[Part] | None:
    """Two parts of the walks, by what separates the weight of the active set best; None where its walks agree.

    That is the side of a line on which one of the new poses stands, or the number of new poses.
    """
    layers = rewards.layers
    for weights in (part.weights, np.maximum(part.weights, _SMALL_WEIGHT)):
        line, count = _dividing_line(part, rewards, weights), _dividing_number(part, rewards, weights)
        if line is not None or count is not None:
            break
    else:
        return None
    if count is None or (line is not None and line[0] >= count[0]):
        assert line is not None
        _, number, normal, at = line
        which = part.records[layers.records.number[part.records] == number]
        one, other = (ends @ normal for ends in rewards.places(which.astype(np.int64)))
        kept: list[Int32Array] = []
        for side in (np.minimum(one, other) <= at, np.maximum(one, other) >= at):
            allowed = np.ones(len(layers.records.number), dtype=bool)
            allowed[which[~side]] = False
            kept.append(allowed_arcs(layers.arcs, part.arcs, allowed))
    else:
        last = layers.arcs.last[part.arcs]
        kept = [part.arcs[(last < 0) | (last <= count[1])], part.arcs[(last < 0) | (last > count[1])]]
    return [_restricted(part, rewards, arcs) for arcs in kept]


def _restricted(part: Part, rewards: Rewards, arcs: Int32Array) -> Part:
    """The walks of a part that take these arcs only."""
    layers = rewards.layers
    within = np.array([bool(np.isin(course.arcs, arcs, assume_unique=True).all()) for course in part.courses], dtype=bool)
    courses = [course for course, keep in zip(part.courses, within, strict=True) if keep]
    weights = part.weights[within]
    total = float(weights.sum())
    weights = weights / total if total > 0 else np.full(len(courses), 1 / max(len(courses), 1))
    records = used_records(layers.arcs, arcs, len(layers.records.number))
    return Part(arcs, records, courses, weights, part.by_layer, part.toll)


def _dividing_line(part: Part, rewards: Rewards, shares: FloatArray) -> tuple[float, int, FloatArray, float] | None:
    """Score, number of a new pose, unit vector, and where along it to cut."""
    records = rewards.layers.records
    best: tuple[float, int, FloatArray, float] | None = None
    numbers = [records.number[course.records] for course in part.courses]
    middles = [np.mean(rewards.places(course.records), axis=0) for course in part.courses]
    for t in range(1, rewards.num_new + 1):
        places: list[FloatArray] = []
        weights: list[float] = []
        for middle, number, weight in zip(middles, numbers, shares.tolist(), strict=True):
            at = np.flatnonzero(number == t)
            if at.size and weight > _LEAST_WEIGHT:
                places.append(middle[at[0]])
                weights.append(weight)
        if len(places) < 2:
            continue
        cut = best_line(np.array(places), np.array(weights), rewards.delta)
        if cut is not None and (best is None or cut[0] > best[0]):
            best = cut[0], t, cut[1], cut[2]
    return best


def _dividing_number(part: Part, rewards: Rewards, shares: FloatArray) -> tuple[float, int] | None:
    """Score, and up to how many new poses the walks of one side have."""
    used = shares > _LEAST_WEIGHT
    number = np.array([course.plan.num_poses for course, keep in zip(part.courses, used, strict=True) if keep])
    if len(number) < 2 or np.ptp(number) == 0:
        return None
    spacing = rewards.delta * rewards.layers.pieces_per_pose
    cut = best_place(spacing * number, shares[used], 0.5 * spacing)
    return None if cut is None else (cut[0], math.floor(cut[1] / spacing))
