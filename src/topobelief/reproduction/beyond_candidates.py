"""Beyond candidates: the best of some diverse paths against the best way that a search of the whole roadmap finds.

In the paper's second session, with closures learned from its graph and new poses by distance. Every way has one exact value,
whatever chose it: the expected error of the map, or its entropy. The search runs in its metric form, on the information matrix,
and in its topological form, on effective resistance or spanning trees alone; the latter's best way is valued afterwards.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.diverse_paths import diverse_paths
from topobelief.candidates.learned_closures import learn_closures
from topobelief.candidates.polyline import path_length
from topobelief.candidates.predicted_factors import predict_actions
from topobelief.graph.action import Action
from topobelief.planning.planner import Planner
from topobelief.reproduction.planning_sessions import PlanningSession, office_session
from topobelief.search.compile_kernels import compile_kernels
from topobelief.search.roadmap_search import search_roadmap

DETOURS = (1.3, 2.5)
OBJECTIVES = ("error", "map")
METRIC, TOPOLOGICAL = "search, metric", "search, topological"
NUM_PATHS = (20, 200)


@dataclass(frozen=True, slots=True)
class BeyondRow:
    """The best way that one method finds in one decision.

    Attributes
    ----------
    seed, xi, max_detour, objective
        Which decision; values are in metres for "error", else nats.
    method
        "20 paths" and the like, `METRIC` or `TOPOLOGICAL`.
    now, shortest, value
        The objective of the graph as it is, after the shortest path, and after the way found.
    gap
        No walk of the roadmap is better by more than this in what the method minimises; nan where it does not know.
    length
        Of the way, metres.
    num_evaluations
        Paths, or walks that were evaluated.
    seconds
        Of processor time, paths and predictions included, the roadmap not.
    """

    seed: int
    xi: float
    max_detour: float
    objective: str
    method: str
    now: float
    shortest: float
    value: float
    gap: float
    length: float
    num_evaluations: int
    seconds: float

    @property
    def gain(self) -> float:
        """Against staying, in the unit of the objective."""
        return self.now - self.value


@dataclass(frozen=True, slots=True)
class BeyondSummary:
    """One method over all seeds and noises.

    Attributes
    ----------
    objective, max_detour, method, num_decisions
    gain, shortest_gain
        Medians, centimetres for "error", else nats; the latter of the shortest path.
    gap
        Median of those that are known, likewise.
    length, seconds
        Medians.
    """

    objective: str
    max_detour: float
    method: str
    num_decisions: int
    gain: float
    shortest_gain: float
    gap: float
    length: float
    seconds: float


def beyond_rows(
    seed: int, xi: float, detours: Sequence[float], num_paths: Sequence[int], max_evaluations: int
) -> list[BeyondRow]:
    """All methods in all decisions of a session.

    Parameters
    ----------
    seed, xi
        Of the session.
    detours
    num_paths
        How many diverse paths are made, at most, each time.
    max_evaluations
        Of a search.
    """
    _warm_up()
    session = office_session("S2", seed, xi)
    return [
        row
        for objective in OBJECTIVES
        for detour in detours
        for row in _rows(session, objective, detour, num_paths, max_evaluations)
    ]


def _rows(
    session: PlanningSession, objective: str, max_detour: float, num_paths: Sequence[int], max_evaluations: int
) -> list[BeyondRow]:
    graph, world, roadmap, goal = session.graph, session.world, session.roadmap, session.goal
    closures = learn_closures(graph, world=world)
    planner = Planner(graph, objective=objective, engine="incremental")
    stay = Action(np.zeros((0, 3)), np.zeros((0, 2), dtype=np.int64), graph.information[0])

    def values_of(paths: list[FloatArray]) -> FloatArray:
        actions = predict_actions(graph, paths, closures=closures, spacing=1.0, turn=None, world=world)
        return planner.entropies(actions)

    shortest = diverse_paths(roadmap, roadmap.vertices[0], goal, 1, max_detour, session.seed)
    now, after_shortest = float(planner.entropies([stay])[0]), float(values_of(shortest)[0])
    rows: list[BeyondRow] = []
    methods: list[tuple[str, int]] = [*((f"{number} paths", number) for number in num_paths), (METRIC, 0), (TOPOLOGICAL, 0)]
    for method, number in methods:
        begin, gap = time.process_time(), math.nan
        if number:
            paths = diverse_paths(roadmap, roadmap.vertices[0], goal, number, max_detour, session.seed)
            values = values_of(paths)
            best, count = paths[int(np.argmin(values))], len(paths)
        else:
            found = search_roadmap(
                graph,
                roadmap,
                goal=goal,
                max_detour=max_detour,
                objective=objective,
                closures=closures,
                world=world,
                max_evaluations=max_evaluations,
                num_alternatives=0,
                seed=session.seed,
                metric=method == METRIC,
            )
            best, count, gap = found.path, found.num_evaluations, found.gap
        seconds = time.process_time() - begin
        rows.append(
            BeyondRow(
                seed=session.seed,
                xi=session.xi,
                max_detour=max_detour,
                objective=objective,
                method=method,
                now=now,
                shortest=after_shortest,
                value=float(values_of([best])[0]),
                gap=gap if math.isfinite(gap) else math.nan,
                length=path_length(best),
                num_evaluations=count,
                seconds=seconds,
            )
        )
    return rows


@lru_cache(maxsize=1)
def _warm_up() -> None:
    """Load what is compiled before anything is timed."""
    compile_kernels()


def beyond_summaries(rows: Sequence[BeyondRow]) -> list[BeyondSummary]:
    """One for each objective, detour and method."""
    found: list[BeyondSummary] = []
    for objective, detour, method in dict.fromkeys((row.objective, row.max_detour, row.method) for row in rows):
        mine = [row for row in rows if (row.objective, row.max_detour, row.method) == (objective, detour, method)]
        factor = 100.0 if objective == "error" else 1.0
        gaps = [row.gap for row in mine if not math.isnan(row.gap)]
        found.append(
            BeyondSummary(
                objective=objective,
                max_detour=detour,
                method=method,
                num_decisions=len(mine),
                gain=factor * float(np.median([row.gain for row in mine])),
                shortest_gain=factor * float(np.median([row.now - row.shortest for row in mine])),
                gap=factor * float(np.median(gaps)) if gaps else math.nan,
                length=float(np.median([row.length for row in mine])),
                seconds=float(np.median([row.seconds for row in mine])),
            )
        )
    return found
