"""Peers of the search over a roadmap: other ways to choose a walk to a goal, no longer than a limit.

Each gets the same roadmap, limit and exact values, and nothing that another has computed before.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.benchmark.search_places import SearchPlace
from topobelief.benchmark.timing import Clock
from topobelief.candidates.diverse_paths import diverse_paths
from topobelief.candidates.predicted_factors import predict_actions
from topobelief.graph.action import Action
from topobelief.planning.planner import Planner
from topobelief.search.evaluations import Evaluations
from topobelief.search.local_search import Vias, spread_vias
from topobelief.search.walks import Walk, Walks

_NUM_CANDIDATES = 60  # vertices that greedy insertion and local search lead walks through, as many as the search takes
_NUM_IN_PAIRS = 30  # vertices of which two are via-vertices
_NUM_MIDDLES = 20  # vertices that recursive greedy takes as the middle of a walk
_SHARES = (0.0, 0.5, 1.0)  # of the metres to spare that recursive greedy gives to the first half
_DEPTH = 2  # of its recursion: up to three via-vertices
_LEAST_METRES = 0.1  # that an insertion counts as at least
_MOST_RANDOM = 4  # via-vertices of a random start
_BATCH = 64  # evaluations between two looks at the clock


class Found(NamedTuple):
    """What a peer chose: the objective after it, its length (metres), and how many exact values that took."""

    value: float
    length: float
    num_evaluations: int


@dataclass(frozen=True, eq=False, slots=True)
class PeerQuestion:
    """What peers are asked.

    Attributes
    ----------
    place
    objective
    max_length
        Metres.
    max_detour
        The same in lengths of the shortest way.
    planner
        With this objective; its factors of the prior are made.
    """

    place: SearchPlace
    objective: str
    max_length: float
    max_detour: float
    planner: Planner

    def predict(self, paths: Sequence[FloatArray]) -> list[Action]:
        """What driving each path adds to the graph."""
        place = self.place
        return predict_actions(place.graph, paths, closures=place.closures, turn=None, world=place.world)

    def walks(self) -> Walks:
        """The walks to the goal, with no distances known yet."""
        return Walks(self.place.roadmap, 1, self.max_length)

    def evaluations(self) -> Evaluations:
        """No walk evaluated yet."""
        return Evaluations(self.planner, self.predict, self.place.roadmap.vertices, 0.0)


def best_of_diverse_paths(question: PeerQuestion, count: int) -> Found:
    """The best of some diverse paths, all evaluated."""
    roadmap = question.place.roadmap
    paths = diverse_paths(roadmap, roadmap.vertices[0], roadmap.vertices[1], count, question.max_detour)
    actions = question.predict(paths)
    values = question.planner.entropies(actions)
    best = int(np.argmin(values))
    return Found(float(values[best]), float(actions[best].length or 0.0), len(paths))


def through_one_via(question: PeerQuestion) -> Found:
    """Shortest walks through each vertex in reach."""
    walks = question.walks()
    return _best_through(question, walks, [(via,) for via in np.flatnonzero(walks.in_reach).tolist()])


def through_two_vias(question: PeerQuestion) -> Found:
    """Shortest walks through two of thirty vertices all over what is in reach, in either order."""
    walks = question.walks()
    some = spread_vias(walks, walks.in_reach, _NUM_IN_PAIRS).tolist()
    return _best_through(question, walks, itertools.permutations(some, 2))


def greedy_insertion(question: PeerQuestion) -> Found:
    """The via-vertex inserted that gains most per metre, again and again (as Bai et al. insert loops)."""
    walks, evaluations = question.walks(), question.evaluations()
    vias: Vias = ()
    evaluations.evaluate([walks.walk(vias)])
    candidates = spread_vias(walks, walks.in_reach, _NUM_CANDIDATES).tolist()
    while True:
        longer = _insertions(walks, vias, candidates)
        evaluations.evaluate([walks.walk(each) for each in longer])
        base = walks.walk(vias)
        rates = [_rate(evaluations, base, walks.walk(each)) for each in longer]
        if max(rates, default=0.0) <= 0:
            return _found(evaluations, base)
        vias = longer[int(np.argmax(rates))]


def recursive_greedy(question: PeerQuestion) -> Found:
    """A middle vertex and a split of the length, then the best walk to it and the best one on from there (Chekuri and Pál)."""
    walks, evaluations = question.walks(), question.evaluations()
    middles = spread_vias(walks, walks.in_reach, _NUM_MIDDLES).tolist()

    def best_between(before: Walk, target: int, budget: float, depth: int) -> Walk:
        """The walk that begins with another one and goes on to a vertex within some metres."""
        source = before[-1]
        ways = [(*before, *walks.way(source, target))]
        for middle in middles if depth else ():
            there, on = float(walks.distances(source)[middle]), float(walks.distances(middle)[target])
            spare = budget - there - on
            if spare < 0 or middle in (source, target):
                continue
            for share in _SHARES if depth > 1 else (0.0,):
                half = best_between(before, middle, there + share * spare, depth - 1)
                used = float(walks.lengths_along(half)[-1] - walks.lengths_along(before)[-1])
                ways.append(best_between(half, target, budget - used, depth - 1))
        if depth:
            evaluations.evaluate(ways)
            return min(ways, key=evaluations.value)
        return ways[0]

    walks.prepare([walks.start, *middles, 1])
    chosen = best_between((walks.start,), 1, walks.limit, _DEPTH)
    return _found(evaluations, chosen)


def random_restarts(question: PeerQuestion, seconds: float, clock: Clock, seed: int) -> Found:
    """Steepest descent from random via-vertices by insertions, replacements and omissions, for some seconds."""
    walks, evaluations, rng = question.walks(), question.evaluations(), np.random.default_rng(seed)
    end = clock() + seconds
    evaluations.evaluate([walks.walk(())])
    candidates = spread_vias(walks, walks.in_reach, _NUM_CANDIDATES).tolist()
    while clock() < end:
        vias = _random_vias(walks, candidates, rng)
        evaluations.evaluate([walks.walk(vias)])
        improved = True
        while improved and clock() < end:
            neighbours = list(_neighbours(walks, vias, candidates))
            for first in range(0, len(neighbours), _BATCH):
                evaluations.evaluate([walks.walk(each) for each in neighbours[first : first + _BATCH]])
                if clock() >= end:
                    break
            known = [each for each in neighbours if walks.walk(each) in evaluations.objectives]
            best = min(known, key=lambda each: evaluations.value(walks.walk(each)), default=vias)
            improved = evaluations.value(walks.walk(best)) < evaluations.value(walks.walk(vias))
            vias = best if improved else vias
    return _found(evaluations, evaluations.best())


def peers_without_limit(counts: Sequence[int]) -> dict[str, Callable[[PeerQuestion], Found]]:
    """By name, those that end by themselves; with best-of-k for each of some k."""

    def of(count: int) -> Callable[[PeerQuestion], Found]:
        return lambda question: best_of_diverse_paths(question, count)

    return {
        **{"shortest way" if count == 1 else f"best of {count} diverse paths": of(count) for count in (1, *counts)},
        "through one via-vertex": through_one_via,
        "through two via-vertices": through_two_vias,
        "greedy insertion": greedy_insertion,
        "recursive greedy": recursive_greedy,
    }


def _best_through(question: PeerQuestion, walks: Walks, choices: Iterable[Vias]) -> Found:
    evaluations = question.evaluations()
    within = [vias for vias in choices if walks.length(vias) <= walks.limit]
    evaluations.evaluate([walks.walk(vias) for vias in [(), *within]])
    return _found(evaluations, evaluations.best())


def _found(evaluations: Evaluations, walk: Walk) -> Found:
    return Found(evaluations.value(walk), evaluations.lengths[walk], len(evaluations))


def _rate(evaluations: Evaluations, base: Walk, walk: Walk) -> float:
    metres = max(evaluations.lengths[walk] - evaluations.lengths[base], _LEAST_METRES)
    return (evaluations.value(base) - evaluations.value(walk)) / metres


def _insertions(walks: Walks, vias: Vias, candidates: Sequence[int]) -> list[Vias]:
    longer = [(*vias[:place], via, *vias[place:]) for place in range(len(vias) + 1) for via in candidates if via not in vias]
    return [each for each in longer if walks.length(each) <= walks.limit]


def _neighbours(walks: Walks, vias: Vias, candidates: Sequence[int]) -> Iterable[Vias]:
    yield from _insertions(walks, vias, candidates)
    for place in range(len(vias)):
        rest = (*vias[:place], *vias[place + 1 :])
        yield rest
        for via in candidates:
            other = (*vias[:place], via, *vias[place + 1 :])
            if via not in vias and walks.length(other) <= walks.limit:
                yield other


def _random_vias(walks: Walks, candidates: Sequence[int], rng: np.random.Generator) -> Vias:
    vias: Vias = ()
    for _ in range(int(rng.integers(1, _MOST_RANDOM + 1))):
        longer = _insertions(walks, vias, candidates)
        if not longer:
            break
        vias = longer[int(rng.integers(len(longer)))]
    return vias
