"""The best way of the whole roadmap, to each goal of a plan or to anywhere, and what is said about it.

A search is one more source of `Proposals`: its best way, the ways that its front is told by, and some alternatives. So they
are explained, drawn and written as other candidates are; beside them stand the front and the certificate.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from topobelief.candidates.propose import CandidateRule
from topobelief.candidates.roadmap import build_roadmap
from topobelief.candidates.start import Start
from topobelief.cli.console import Reporter
from topobelief.cli.plan_candidates import Proposals
from topobelief.cli.plan_ends import Goal, shown
from topobelief.cli.plan_world import told_of_poses_outside
from topobelief.errors import NotOptimizedWarning
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision import Decision
from topobelief.planning.planner import Planner
from topobelief.search.anytime import SearchProgress
from topobelief.search.result import SearchResult, Way, said
from topobelief.world import FreeSpace

POINTS_TOLD = 5
"""Of the front."""

_NUM_ALTERNATIVES = 5


@dataclass(frozen=True, slots=True)
class Limits:
    """What a search may take, and what it is for.

    Attributes
    ----------
    max_length
        Metres; None: `CandidateRule.max_detour` limits the length.
    return_to_start
        Whether a trip ends where it begins.
    seconds
        In all; None for no limit.
    max_evaluations
        To each goal; None for no limit.
    cost_per_metre
        In the unit of the objective.
    enough
        Gain of a trip that is worth driving for; None where that is not asked.
    """

    max_length: float | None
    return_to_start: bool
    seconds: float | None
    max_evaluations: int | None
    cost_per_metre: float
    enough: float | None


@dataclass(frozen=True, eq=False, slots=True)
class Searched:
    """What was found.

    Attributes
    ----------
    proposals
    best
        Index of the best way among them.
    found
        The search that it comes from.
    lower_bound
        Of the ways to all goals.
    num_searches
        One to each goal.
    names
        Of proposals on the front of `found`, by their places on it.
    """

    proposals: Proposals
    best: int
    found: SearchResult
    lower_bound: float
    num_searches: int
    names: dict[int, str]

    @property
    def has_goal(self) -> bool:
        """Whether it leads to one."""
        return self.proposals.goals[self.best] is not None


@dataclass(frozen=True, eq=False, slots=True)
class _Listed:
    """A way before it has its place among others."""

    way: Way
    goal: int | None


def search(
    planner: Planner,
    world: FreeSpace,
    begin: Start,
    goals: Sequence[Goal],
    rule: CandidateRule,
    limits: Limits,
    reporter: Reporter,
) -> Searched:
    """Search the roadmap for the best way to each goal, or for the best trip where there is none; the time is shared.

    The graph is factored before, so that a large one leaves as much time to search as a small one.

    Raises
    ------
    PlanningError
        Where a goal cannot be reached, or not within the length.
    """
    with reporter.stage("prior"):  # kernels are loaded and the map is factored, so that the time of the search is its own
        planner.entropies([_one_loop(planner.graph)])
    results: list[SearchResult] = []
    for goal in goals or [None]:
        seconds = None if limits.seconds is None else limits.seconds / max(1, len(goals))
        found = _search_one(planner, world, begin, goal, rule, replace(limits, seconds=seconds), reporter)
        reporter.say(_work(found, begin, goal))
        results.append(found)
    return gathered(results, goals)


def _one_loop(graph: PoseGraph) -> Action:
    """A new pose at the last one, which sees the first: evaluating it makes all that evaluating ways needs of the map."""
    new = graph.num_nodes
    edges = [(graph.last_pose, new), (new, graph.pose_indices[0])]
    return Action(graph.poses[[graph.last_pose]], edges, np.eye(graph.tangent_dim))


def gathered(results: Sequence[SearchResult], goals: Sequence[Goal], *, points: int = POINTS_TOLD) -> Searched:
    """The ways that searches found as candidates, shortest first.

    Parameters
    ----------
    results
        One to each goal, or one where there is none.
    goals
    points
        How many ways of each front to name at most.
    """
    listed = [_Listed(way, number if goals else None) for number, found in enumerate(results) for way in _ways(found, points)]
    listed.sort(key=lambda each: each.way.length)
    chosen = min(results, key=lambda found: found.value)
    labels = [_label(index, each, goals) for index, each in enumerate(listed)]
    ways = [each.way for each in listed]
    places = {id(way): index for index, way in enumerate(chosen.on_front)}
    actions = [replace(way.action, label=label) for way, label in zip(ways, labels, strict=True)]
    return Searched(
        Proposals([way.path for way in ways], actions, [each.goal for each in listed]),
        next(index for index, way in enumerate(ways) if _same(way, chosen.best)),
        chosen,
        min(found.lower_bound for found in results),
        len(results),
        {places[id(way)]: label for way, label in zip(ways, labels, strict=True) if id(way) in places},
    )


def _search_one(
    planner: Planner,
    world: FreeSpace,
    begin: Start,
    goal: Goal | None,
    rule: CandidateRule,
    limits: Limits,
    reporter: Reporter,
) -> SearchResult:
    from topobelief.search.roadmap_search import search_roadmap  # needs the extra fast

    graph, objective = planner.graph, planner.objective
    place = None if goal is None else goal.place
    with reporter.stage("roadmap"), told_of_poses_outside(graph, world):
        roadmap = build_roadmap(world, begin.place, place, rule.num_vertices, rule.robot_radius, rule.seed)
    with reporter.activity("search") as update, warnings.catch_warnings():
        warnings.simplefilter("ignore", NotOptimizedWarning)  # reading the graph has told
        return search_roadmap(
            graph,
            roadmap,
            goal=place,
            max_detour=rule.max_detour or 1.0,
            max_length=limits.max_length,
            return_to_start=limits.return_to_start,
            objective=objective,
            closures=rule.closures,
            observations=rule.observations,
            world=world if rule.line_of_sight else None,
            cost_per_metre=limits.cost_per_metre,
            deadline=limits.seconds,
            enough=limits.enough,
            max_evaluations=limits.max_evaluations,
            num_alternatives=_NUM_ALTERNATIVES,
            spacing=rule.spacing,
            information=rule.information,
            start=begin,
            refine=True,
            attitude=rule.attitude,
            planner=planner,
            seed=rule.seed,
            on_progress=lambda progress: update(progress_told(progress, objective)),
        )


def _ways(found: SearchResult, points: int) -> list[Way]:
    """Those that are worth telling, each once: on the front first, so that its points have names."""
    few = found.few_places(points)
    ways: list[Way] = [found.on_front[place] for place in few]
    for way in (found.best, *([] if found.shortest is None else [found.shortest]), *found.alternatives):
        if not any(_same(way, other) for other in ways):
            ways.append(way)
    return ways


def _same(one: Way, other: Way) -> bool:
    return np.array_equal(one.path, other.path)


def _label(index: int, listed: _Listed, goals: Sequence[Goal]) -> str:
    if len(listed.way.path) == 1:
        return "staying"
    return f"path {index}" + (f" to {goals[listed.goal].name}" if listed.goal is not None and len(goals) > 1 else "")


def progress_told(progress: SearchProgress, objective: str) -> str:
    """How far a search is."""
    known = "" if math.isinf(progress.lower_bound) else f", none below {said(progress.lower_bound, objective)}"
    return f"{progress.num_evaluations} ways: best {said(progress.value, objective)}{known}"


def _work(found: SearchResult, begin: Start, goal: Goal | None) -> str:
    """Which walks were searched, how hard, and why no longer."""
    to = "" if goal is None else f" to {goal.name}"
    reasons = {"rest": "it improved no more", "deadline": "the time was up", "evaluations": "their limit", "enough": "enough"}
    why = {**reasons, "proof": "proven", "gap": "proven to the gap", "interrupt": "interrupted"}[found.stopped_by]
    return (
        f"searched: all walks of the roadmap from {shown(begin.place)}{to} of up to {found.max_length:.1f} m, "
        f"{found.num_evaluations} of them evaluated; ended: {why}"
    )


def decide(planner: Planner, searched: Searched) -> Decision:
    """The ways that were found as a decision: its choice is the best way of the search, its ranking goes by value."""
    decision = planner.decide(searched.proposals.actions, proof="optimal")
    order = sorted(decision.ranking.tolist(), key=lambda index: (index != searched.best, decision.lower[index]))
    return replace(decision, best=searched.best, ranking=np.array(order))
