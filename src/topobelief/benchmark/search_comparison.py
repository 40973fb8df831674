"""The search over a roadmap and its peers at the same places, as a run: a task is one place and seed, with all of them.

Times that are compared with each other are measured in one go, one after the other in one process.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from itertools import groupby
from pathlib import Path

import numpy as np

from topobelief.benchmark.search_peers import Found, PeerQuestion, peers_without_limit, random_restarts
from topobelief.benchmark.search_places import checked_source, search_place
from topobelief.benchmark.timing import Clock
from topobelief.errors import InvalidInputError, require_choice
from topobelief.graph.action import Action
from topobelief.io.row_files import json_rows, rows_of_json
from topobelief.planning.planner import Planner
from topobelief.planning.registry import OBJECTIVES
from topobelief.runs.attempt import Executor
from topobelief.runs.journal import Journal
from topobelief.runs.lock import alone
from topobelief.runs.machine import describe_machine
from topobelief.runs.run import OnProgress, UnfinishedRunError, run_tasks
from topobelief.search.result import SearchResult
from topobelief.search.roadmap_search import search_roadmap


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchComparison:
    """What is compared.

    Attributes
    ----------
    objectives
    num_paths
        Numbers of diverse paths of which the best is taken.
    deadlines
        Of the search, seconds; random restarts get as long as the last search took.
    max_detour
        The limit in lengths of the shortest way.
    num_vertices, way, goal
        As for `search_place`.
    cpu_time
        Measure the processor's time, of all threads together, in place of elapsed time, and end searches by it.
    """

    objectives: tuple[str, ...] = ("error", "map")
    num_paths: tuple[int, ...] = (20, 200, 1000)
    deadlines: tuple[float, ...] = (0.1, 1.0, 10.0)
    max_detour: float = 1.3
    num_vertices: int = 1000
    way: float = 30.0
    goal: tuple[float, float] | None = None
    cpu_time: bool = False

    def __post_init__(self) -> None:
        for objective in self.objectives:
            require_choice("objective", objective, tuple(OBJECTIVES))
        if not self.max_detour >= 1:
            raise InvalidInputError(f"expected a max_detour of at least 1 times the shortest way, got {self.max_detour}")
        for name, values, least in (("num_paths", self.num_paths, 1), ("deadlines", self.deadlines, 0.0)):
            for value in values:
                if not value >= least:
                    raise InvalidInputError(f"expected {name} of at least {least}, got {value}")
        if not self.deadlines:
            raise InvalidInputError("expected at least one deadline, got none")
        if self.num_vertices < 2:
            raise InvalidInputError(f"expected num_vertices of at least 2, got {self.num_vertices}")

    @property
    def clock(self) -> Clock:
        """What times are read from."""
        return time.process_time if self.cpu_time else time.monotonic


@dataclass(frozen=True, slots=True)
class PlaceTask:
    """One place and seed of a comparison."""

    comparison: SearchComparison
    source: str
    seed: int

    @property
    def id(self) -> str:
        """Of this comparison's places, it alone."""
        return f"{self.source} seed {self.seed}"


@dataclass(frozen=True, slots=True)
class PeerRow:
    """What one way to choose found.

    Attributes
    ----------
    place, seed, objective, peer
    num_poses, way
        Of the graph; of the shortest way to the goal, metres.
    value_now, value, length
        The objective of the graph as it is, and after the walk that was chosen; of that walk, metres.
    lower_bound
        That this one proved itself; -inf for none.
    num_evaluations, seconds
    """

    place: str
    seed: int
    objective: str
    peer: str
    num_poses: int
    way: float
    value_now: float
    value: float
    length: float
    lower_bound: float
    num_evaluations: int
    seconds: float


@dataclass(frozen=True, slots=True)
class PeerSummary:
    """One way to choose at one place, medians over seeds.

    Attributes
    ----------
    place, objective, peer
    num_seeds, num_poses, way
    gain
        By how much the value is below that of the graph as it is.
    share
        Of the gain of the best that any found.
    gap
        To the best lower bound that any proved; nan where none did.
    own_gap
        To the lower bound that this one proved itself; nan for none.
    num_evaluations, seconds
    """

    place: str
    objective: str
    peer: str
    num_seeds: int
    num_poses: int
    way: float
    gain: float
    share: float
    gap: float
    own_gap: float
    num_evaluations: float
    seconds: float


@dataclass(frozen=True, slots=True)
class ComparedPeers:
    """What a comparison found.

    Attributes
    ----------
    comparison
    machine
    rows
        By place, seed, objective, in the order in which they were measured.
    failed
        Why tasks failed, by their ids.
    """

    comparison: SearchComparison
    machine: dict[str, str]
    rows: tuple[PeerRow, ...]
    failed: dict[str, str]

    @property
    def summaries(self) -> list[PeerSummary]:
        """By place, then objective, then peer."""
        return list(summarised(self.rows))


def compare_peers(task: PlaceTask) -> list[PeerRow]:
    """All peers at one place, one objective after the other."""
    comparison = task.comparison
    place = search_place(task.source, task.seed, num_vertices=comparison.num_vertices, way=comparison.way, goal=comparison.goal)
    way = float(place.roadmap.distances_to(1)[0])
    rows: list[PeerRow] = []
    for objective in comparison.objectives:
        planner = Planner(place.graph, objective=objective, engine="incremental")
        stay = Action(np.zeros((0, place.graph.poses.shape[1])), np.zeros((0, 2), np.int64), np.eye(place.graph.tangent_dim))
        now = float(planner.entropies([stay])[0])
        question = PeerQuestion(place, objective, comparison.max_detour * way, comparison.max_detour, planner)
        for peer, found, bound, seconds in _measured(question, comparison, task.seed):
            size = place.graph.num_poses
            rows.append(
                PeerRow(place.name, task.seed, objective, peer, size, way, now, found.value, found.length, bound,
                        found.num_evaluations, seconds)
            )  # fmt: skip
    return rows


def _measured(question: PeerQuestion, comparison: SearchComparison, seed: int) -> Iterator[tuple[str, Found, float, float]]:
    """Name, what was found, lower bound, and seconds, of one peer after the other."""
    clock = comparison.clock
    _search(question, clock, seed, max_evaluations=2)  # loads the kernels
    for name, peer in peers_without_limit(comparison.num_paths).items():
        began = clock()
        found = peer(question)
        yield name, found, -math.inf, clock() - began
    seconds = 0.0
    for deadline in comparison.deadlines:
        began = clock()
        result = _search(question, clock, seed, deadline=deadline)
        seconds = clock() - began
        found = Found(result.value, result.length, result.num_evaluations)
        yield f"this search, {deadline:g} s", found, result.lower_bound, seconds
    began = clock()
    yield "random restarts", random_restarts(question, seconds, clock, seed), -math.inf, clock() - began


def _search(
    question: PeerQuestion, clock: Clock, seed: int, *, deadline: float | None = None, max_evaluations: int | None = None
) -> SearchResult:
    place = question.place
    return search_roadmap(
        place.graph,
        place.roadmap,
        goal=place.roadmap.vertices[1],
        max_length=question.max_length,
        objective=question.objective,
        closures=place.closures,
        world=place.world,
        deadline=deadline,
        max_evaluations=max_evaluations,
        seed=seed,
        clock=clock,
    )


def run_comparison(
    comparison: SearchComparison,
    sources: Sequence[str],
    seeds: Sequence[int],
    folder: Path,
    executor: Executor,
    *,
    retry_failed: bool = False,
    on_progress: OnProgress = lambda _: None,
) -> ComparedPeers:
    """Measure at all places that the folder does not have yet; seed by seed, each at every place.

    Parameters
    ----------
    comparison
    sources
        Of places; see `search_places`.
    seeds
    folder
        Where the journal is kept; made where there is none. A later call may ask for more sources and seeds.
    executor
    retry_failed
        Whether places that failed earlier are measured again.
    on_progress
        Called at the start and after each place.

    Raises
    ------
    InvalidInputError, FileError
        For a source that is not there, and where the folder holds another comparison.
    UnfinishedRunError
        Where every place failed.
    """
    for source in sources:
        checked_source(source)
    if comparison.goal is not None and len(sources) > 1:
        raise InvalidInputError(f"expected one place for a goal that is given, got {len(sources)}; run them one by one")
    tasks = [PlaceTask(comparison, source, seed) for seed in seeds for source in dict.fromkeys(sources)]
    settings = {**asdict(comparison), "topobelief": version("topobelief")}
    with alone(folder):
        journal: Journal[PlaceTask, list[PeerRow]] = Journal(
            folder / "journal.jsonl", settings, json_rows, about=describe_machine()
        )
        run_tasks(tasks, compare_peers, journal, executor, retry_failed=retry_failed, on_progress=on_progress)
    errors = {task.id: journal.error(task.id) for task in tasks}
    failed = {name: error for name, error in errors.items() if error is not None}
    if len(failed) == len(tasks):
        raise UnfinishedRunError(
            f"expected places to compare at, got {len(tasks)} that failed, the first with {errors[tasks[0].id]}"
        )
    done = sorted((task for task in tasks if task.id not in failed), key=lambda task: (sources.index(task.source), task.seed))
    rows = [row for task in done for row in rows_of_json(PeerRow, journal.result(task.id))]
    return ComparedPeers(comparison, journal.about, tuple(rows), failed)


def summarised(rows: Iterable[PeerRow]) -> Iterator[PeerSummary]:
    """Medians over seeds, by place, objective and peer, each in the order of its first row."""
    kept = list(rows)
    for place, objective in dict.fromkeys((row.place, row.objective) for row in kept):
        here = [row for row in kept if (row.place, row.objective) == (place, objective)]
        by_seed = {seed: list(some) for seed, some in groupby(here, key=lambda row: row.seed)}
        least = {seed: min(row.value for row in some) for seed, some in by_seed.items()}
        bound = {seed: max(row.lower_bound for row in some) for seed, some in by_seed.items()}
        for peer in dict.fromkeys(row.peer for row in here):
            some = [row for row in here if row.peer == peer]
            yield PeerSummary(
                place,
                objective,
                peer,
                len(some),
                some[0].num_poses,
                statistics.median(row.way for row in some),
                statistics.median(row.value_now - row.value for row in some),
                statistics.median(_share(row, least[row.seed]) for row in some),
                _median_gap((row.value - bound[row.seed]) for row in some),
                _median_gap((row.value - row.lower_bound) for row in some),
                statistics.median(row.num_evaluations for row in some),
                statistics.median(row.seconds for row in some),
            )


def _share(row: PeerRow, least: float) -> float:
    most = row.value_now - least
    return (row.value_now - row.value) / most if most > 0 else 1.0


def _median_gap(gaps: Iterable[float]) -> float:
    """nan where most have none."""
    median = statistics.median(gaps)
    return max(0.0, median) if math.isfinite(median) else math.nan
