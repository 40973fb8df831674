"""Local search over via-vertices: good walks, found by small changes to the good walks found before.

A walk is the chain of shortest ways between its via-vertices (`walks`). Its neighbours come from

- insertion: one more via-vertex, anywhere in the order;
- replacement: another one in the place of one, near or far;
- omission of one, exchange of two;
- recombination: the first part of one walk up to a vertex, and the second part of another walk from there.

The search keeps all walks that it has evaluated. The *leaders* are the best of them that differ from each other, and some of
the best at shorter lengths, which have room for insertions. Neighbours of the first leader that has any left are evaluated, a
batch at a time, most promising first: insertions whose via-vertex has gained most per metre so far. When all neighbours of all
leaders are known, the search starts again from a leader some of whose via-vertices are replaced by random ones; and when that
has led nowhere, it goes on with the neighbours of all other walks, best first, and last with *spurs*: there and back to a
vertex nearby.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.search.evaluations import Evaluations
from topobelief.search.front import on_front, spread_on_front
from topobelief.search.walks import Walk, Walks

Vias = tuple[int, ...]

_NUM_LEADERS = 10
_NUM_SHORTER = 6  # leaders at shorter lengths
_DIFFERENT = 0.1  # share of the length limit by which leaders differ (Fréchet)
_LEAST_EXTRA = 0.02  # share of the length limit that an insertion counts as at least
_ONE_PLACE = 1e-6  # metres; where the limit is 0
_NUM_NEAR = 8  # vertices near a via-vertex that may replace it
_BATCHES_PER_CLIMB = 2  # of the neighbours of a walk, while climbing from a new start
_MOST_COMPARED = 250  # walks among which leaders are looked for


@dataclass(frozen=True, slots=True)
class _Change:
    """A neighbour of a walk, by its via-vertices or as a walk."""

    vias: Vias
    inserted: int | None = None  # the one that is new
    walk: Walk | None = None


class LocalSearch:
    """Improves the best walk, a batch of evaluations at a time.

    Parameters
    ----------
    walks
    evaluations
        Walks that are there already take part.
    candidates
        Vertices to lead walks through.
    rng
    """

    def __init__(self, walks: Walks, evaluations: Evaluations, candidates: IntArray, *, rng: np.random.Generator) -> None:
        self._walks, self._evaluations, self._rng = walks, evaluations, rng
        self._candidates = candidates[walks.in_reach[candidates]]
        reachable = np.flatnonzero(walks.in_reach)
        self._reachable, self._near = reachable, KDTree(walks.roadmap.vertices[reachable])
        self._yield: dict[int, float] = {}  # most that inserting a via-vertex gained, per metre
        self._left: dict[tuple[Walk, bool], Iterator[list[_Change]]] = {}  # by walk, and whether they are spurs
        self._exhausted: set[tuple[Walk, bool]] = set()
        self._sweep: Iterator[list[_Change]] | None = None  # each candidate alone as via-vertex, before all else
        self._tried: set[Vias] = set()  # as neighbours
        self._known = 0  # walks that were evaluated when the leaders were chosen
        self._leading: list[Walk] = []  # the best that differ from each other;
        self._least_of_rest = np.inf  # no walk of this value or more can be one of them
        self._shorter: list[Walk] = []  # leaders at shorter lengths

    def seed(self, walks: Iterable[Walk]) -> None:
        """Evaluate walks that come from elsewhere; they take part from now on."""
        self._evaluations.evaluate([walk for walk in walks if self._fits(walk)])

    def step(self, size: int) -> int:
        """Evaluate about `size` neighbours of leaders.

        Returns
        -------
        int
            How many walks were evaluated; 0 when all neighbours of all leaders are known.
        """
        if self._sweep is None:
            self._sweep = _batches(iter(self._insertions(())), size)
        for batch in self._sweep:
            before = len(self._evaluations)
            self._try(self._walks.walk(()), batch)
            if len(self._evaluations) > before:
                return len(self._evaluations) - before
        return self._evaluate_neighbours(self._leaders(), size)

    def widen(self, size: int) -> int:
        """Evaluate about `size` neighbours or spurs of any walk, best first; 0 when those of all walks are known."""
        walks, _, values = self._evaluations.arrays()
        order: list[int] = np.argsort(values, kind="stable").tolist()
        best_first = [walks[index] for index in order]
        return self._evaluate_neighbours(best_first, size) or self._evaluate_neighbours(best_first, size, spurs=True)

    def _evaluate_neighbours(self, walks: Iterable[Walk], size: int, *, spurs: bool = False) -> int:
        """Of the first of the walks that has any left: spurs, or all others."""
        before = len(self._evaluations)
        for walk in walks:
            key = walk, spurs
            while key not in self._exhausted:
                if key not in self._left:
                    self._left[key] = _batches(self._spurs(walk) if spurs else self._changes(walk), size)
                batch = next(self._left[key], None)
                if batch is None:
                    self._exhausted.add(key)
                    del self._left[key]
                    break
                self._try(walk, batch)
                if len(self._evaluations) > before:
                    return len(self._evaluations) - before
        return 0

    def restart(self, size: int) -> int:
        """Replace some via-vertices of a leader by random ones, and climb from there; returns how many walks were evaluated."""
        before = len(self._evaluations)
        leaders = self._leaders()
        leader = leaders[int(self._rng.integers(len(leaders)))]
        vias = self._shaken(self._walks.vias(leader))
        walk = self._walks.walk(vias)
        self._evaluations.evaluate([walk])
        improved = True
        while improved:
            improved = False
            for batch in itertools.islice(_batches(self._changes(walk), size), _BATCHES_PER_CLIMB):
                walks = [change.walk or self._walks.walk(change.vias) for change in batch]
                self._evaluations.evaluate(walks)
                best = min(walks, key=self._evaluations.value, default=walk)
                if self._evaluations.value(best) < self._evaluations.value(walk):
                    walk, improved = best, True
                    break
        return len(self._evaluations) - before

    def _shaken(self, vias: Vias) -> Vias:
        kept = [via for via in vias if self._rng.random() < 0.5]
        for _ in range(2):
            if changes := self._insertions(tuple(kept)):
                kept = list(changes[int(self._rng.integers(len(changes)))].vias)
        return tuple(kept)

    def _fits(self, walk: Walk) -> bool:
        return float(self._walks.lengths_along(walk)[-1]) <= self._walks.limit

    def _try(self, leader: Walk, batch: list[_Change]) -> None:
        walks = [change.walk or self._walks.walk(change.vias) for change in batch]
        self._evaluations.evaluate(walks)
        value, length = self._evaluations.value(leader), self._evaluations.lengths[leader]
        for change, walk in zip(batch, walks, strict=True):
            if change.inserted is not None:
                metres = max(self._evaluations.lengths[walk] - length, _LEAST_EXTRA * self._walks.max_length, _ONE_PLACE)
                gain = (value - self._evaluations.value(walk)) / metres
                self._yield[change.inserted] = max(gain, self._yield.get(change.inserted, -np.inf))

    def _leaders(self) -> list[Walk]:
        """The best walks that differ from each other, then some of the best at shorter lengths."""
        if self._known < len(self._evaluations):
            walks, lengths, values = self._evaluations.arrays()
            if values[self._known :].min() < self._least_of_rest:
                best_first = np.argsort(values, kind="stable")[:_MOST_COMPARED].tolist()
                apart = _DIFFERENT * self._walks.max_length
                self._leading = self._evaluations.different(best_first, _NUM_LEADERS, apart)
                if len(self._leading) == _NUM_LEADERS:
                    self._least_of_rest = self._evaluations.value(self._leading[-1])
                elif len(best_first) == _MOST_COMPARED:
                    self._least_of_rest = float(values[best_first[-1]])
            on_it = on_front(lengths, values)
            spread: list[int] = on_it[spread_on_front(lengths[on_it], _NUM_SHORTER)].tolist()
            self._shorter = [walks[index] for index in spread]
            self._known = len(walks)
        return list(dict.fromkeys([*self._leading, *self._shorter]))

    def _changes(self, walk: Walk) -> Iterator[_Change]:
        """Neighbours of a walk that were not tried as another one's, most promising first."""
        vias = self._walks.vias(walk)
        changes = itertools.chain(
            self._omissions(vias),
            self._insertions(vias),
            self._shifts(vias),
            self._replacements(vias),
            self._exchanges(vias),
            self._recombinations(walk),
        )
        for change in changes:
            if change.walk is not None:
                yield change
            elif change.vias not in self._tried:
                self._tried.add(change.vias)
                yield change

    def _insertions(self, vias: Vias, places: Iterable[int] | None = None) -> list[_Change]:
        """One more via-vertex where that is within the length; those first that have gained most per metre so far.

        Parameters
        ----------
        vias
        places
            Where in the order it may come. Default: anywhere.
        """
        stops = self._walks.stops(vias)
        self._walks.prepare(stops)
        length, candidates = self._walks.length(vias), self._candidates
        found: list[tuple[float, _Change]] = []
        for place in range(len(vias) + 1) if places is None else places:
            before = self._walks.distances(stops[place])
            total = length + before[candidates]
            if place + 1 < len(stops):
                after = stops[place + 1]
                total += self._walks.distances(after)[candidates] - before[after]
            for via in candidates[total <= self._walks.limit].tolist():
                rank = self._yield.get(via, np.inf)
                found.append((-rank, _Change((*vias[:place], via, *vias[place:]), inserted=via)))
        found.sort(key=lambda each: each[0])
        return [change for _, change in found]

    def _replacements(self, vias: Vias) -> Iterator[_Change]:
        """Another candidate in the place of a via-vertex."""
        for place in range(len(vias)):
            for change in self._insertions((*vias[:place], *vias[place + 1 :]), [place]):
                yield _Change(change.vias)

    def _shifts(self, vias: Vias) -> Iterator[_Change]:
        """A vertex nearby in the place of a via-vertex."""
        for place, via in enumerate(vias):
            for other in self._neighbours(via):
                yield from self._within((*vias[:place], other, *vias[place + 1 :]))

    def _neighbours(self, via: int) -> list[int]:
        _, near = self._near.query(self._walks.roadmap.vertices[via], k=min(_NUM_NEAR + 1, len(self._reachable)))
        return [vertex for vertex in self._reachable[np.atleast_1d(near)].tolist() if vertex != via]

    def _omissions(self, vias: Vias) -> Iterator[_Change]:
        for place in range(len(vias)):
            yield from self._within((*vias[:place], *vias[place + 1 :]))

    def _exchanges(self, vias: Vias) -> Iterator[_Change]:
        """Two via-vertices in each other's place, and the part between two of them backwards."""
        for first, last in itertools.combinations(range(len(vias)), 2):
            yield from self._within((*vias[:first], vias[last], *vias[first + 1 : last], vias[first], *vias[last + 1 :]))
            if last > first + 2:
                yield from self._within((*vias[:first], *vias[first : last + 1][::-1], *vias[last + 1 :]))

    def _recombinations(self, walk: Walk) -> Iterator[_Change]:
        """The first part of one leader and the last part of another, joined at a vertex of both."""
        so_far = self._walks.lengths_along(walk)
        for other in self._leaders():
            if other == walk:
                continue
            others_so_far = self._walks.lengths_along(other)
            at = {vertex: index for index, vertex in enumerate(other)}
            joints = [(index, at[vertex]) for index, vertex in enumerate(walk) if vertex in at]
            for i, j in joints:
                for new, length in (
                    (walk[: i + 1] + other[j + 1 :], so_far[i] + others_so_far[-1] - others_so_far[j]),
                    (other[: j + 1] + walk[i + 1 :], others_so_far[j] + so_far[-1] - so_far[i]),
                ):
                    if length <= self._walks.limit:
                        yield _Change((), walk=new)

    def _spurs(self, walk: Walk) -> Iterator[_Change]:
        """There and back to a vertex nearby, from each vertex of a walk."""
        length = float(self._walks.lengths_along(walk)[-1])
        for index, vertex in enumerate(walk):
            distances = self._walks.distances(vertex)
            for other in self._neighbours(vertex):
                if length + 2 * distances[other] <= self._walks.limit:
                    spur = *self._walks.way(vertex, other), *self._walks.way(other, vertex)
                    yield _Change((), walk=(*walk[: index + 1], *spur, *walk[index + 1 :]))

    def _within(self, vias: Vias) -> Iterator[_Change]:
        if vias not in self._tried and self._walks.length(vias) <= self._walks.limit:
            yield _Change(vias)


def _batches(changes: Iterator[_Change], size: int) -> Iterator[list[_Change]]:
    while batch := list(itertools.islice(changes, size)):
        yield batch


def spread_vias(walks: Walks, useful: BoolArray, count: int) -> IntArray:
    """Vertices all over what is in reach, to lead walks through.

    Parameters
    ----------
    walks
    useful : shape (V,), bool
        Vertices that are taken before others.
    count
        How many at most: each is as far as can be from those before it.
    """
    first, others = walks.in_reach & useful, walks.in_reach & ~useful
    vertices = _far_apart(walks.roadmap.vertices, np.flatnonzero(first), count)
    return np.concatenate([vertices, _far_apart(walks.roadmap.vertices, np.flatnonzero(others), count - len(vertices))])


def _far_apart(all_places: FloatArray, vertices: IntArray, count: int) -> IntArray:
    """Some of the vertices, each as far as can be from those before it."""
    if len(vertices) <= count:
        return vertices
    if count == 0:
        return vertices[:0]
    places = all_places[vertices]
    chosen, distance = [0], np.linalg.norm(places - places[0], axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return vertices[np.array(chosen)]
