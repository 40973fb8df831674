"""Answers to questions, for the page and for ROS: what `topobelief plan` would say, with all that a picture of it needs."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from threading import Lock

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.closure_rate import rate_warning
from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.learned_closures import learn_closures
from topobelief.candidates.polyline import path_length, path_poses
from topobelief.candidates.propose import CandidateRule
from topobelief.candidates.roadmap import Roadmap, build_roadmap
from topobelief.candidates.start import Start
from topobelief.cli import plan_candidates, plan_certificate, plan_errors, plan_reasons, plan_search
from topobelief.cli.console import Reporter
from topobelief.cli.plan_ends import Goal, shown
from topobelief.errors import NotOptimizedWarning, PlanningError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.path_formats import path_text
from topobelief.page.desk import Publish
from topobelief.page.question import Question
from topobelief.page.situation import rounded
from topobelief.planning.decision import Decision
from topobelief.planning.planner import Planner
from topobelief.planning.registry import default_signature, has_bounds
from topobelief.planning.units import cell, shown_factor, shown_unit
from topobelief.report.map_layers import Sight
from topobelief.search.anytime import SearchProgress
from topobelief.search.result import SearchResult
from topobelief.search.roadmap_search import search_roadmap
from topobelief.wording import counted
from topobelief.world import World

_FIRST = 0.05  # seconds of search before the first answer
_LATER = 3.0  # times as many before the next
_LARGE = 2000  # poses from which on these take longer than the rest of an answer
_POINTS = 24  # of the front
_FORMATS = ("csv", "tum", "yaml")


@dataclass(frozen=True)
class Answers:
    """Answers questions about one situation; threads may share it.

    Attributes
    ----------
    graph
        In SE(2), at its estimate.
    world
    start
    rule
        Its closure model aside, which a question names.
    max_detour
        Longest way to a goal in lengths of the shortest, where a question gives no length.
    seconds
        Of search.
    max_evaluations
        Of search, where answers are to be repeated; None for no limit.
    """

    graph: PoseGraph
    world: World
    start: Start
    rule: CandidateRule
    max_detour: float
    seconds: float
    max_evaluations: int | None = None
    _planners: dict[tuple[str, str], Planner] = field(default_factory=dict[tuple[str, str], Planner], repr=False)
    _lock: Lock = field(default_factory=Lock, repr=False)

    def __call__(self, question: Question, publish: Publish, unwanted: Callable[[], bool]) -> None:
        """Answer a question, better and better until the time is up, it is proven, or nobody waits."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotOptimizedWarning)  # reading the graph has told
            if question.candidates:
                self._compare(question, publish)
            else:
                self._search(question, publish, unwanted)

    def continuing(self, earlier: Answers | None) -> Answers:
        """These answers, with planners and, in the same world, the roadmap taken over from those of an earlier situation."""
        if earlier is None:
            return self
        for key, planner in earlier._planners.copy().items():
            self._planners[key] = planner.extended(self.graph)
        if earlier.world is self.world:
            with suppress(PlanningError):  # where the old roadmap does not lead to the new start
                self.__dict__["roadmap"] = earlier.roadmap.between(self.start.place, earlier.roadmap.vertices[1])
        return self

    @cached_property
    def models(self) -> Mapping[str, ClosureModel]:
        """Closure models by the names of questions."""
        sight = self.world if self.rule.line_of_sight else None
        return {"learned": learn_closures(self.graph, world=sight), "paper": ClosureModel.paper()}

    @cached_property
    def roadmap(self) -> Roadmap:
        """Of all that can be reached."""
        rule = self.rule
        return build_roadmap(self.world, self.start.place, None, rule.num_vertices, rule.robot_radius, rule.seed)

    def _search(self, question: Question, publish: Publish, unwanted: Callable[[], bool]) -> None:
        limits = plan_search.Limits(
            max_length=question.max_length,
            return_to_start=question.return_to_start,
            seconds=self.seconds,
            max_evaluations=self.max_evaluations,
            cost_per_metre=0.0,
            enough=None,
        )

        next_answer = _FIRST

        def told(progress: SearchProgress) -> None:
            nonlocal next_answer
            publish({"progress": plan_search.progress_told(progress, question.objective)})
            if progress.so_far is not None and progress.seconds >= next_answer:
                publish(self._found(question, progress.so_far(), limits))
                next_answer = _LATER * progress.seconds
            if unwanted():
                raise KeyboardInterrupt  # on which a search ends with what it has

        found = search_roadmap(
            self.graph,
            self.roadmap,
            goal=question.goal,
            max_detour=self.max_detour,
            max_length=question.max_length,
            return_to_start=question.return_to_start,
            objective=question.objective,
            closures=self.models[question.closures],
            world=self.world if self.rule.line_of_sight else None,
            deadline=self.seconds,
            max_evaluations=self.max_evaluations,
            spacing=self.rule.spacing,
            information=self.rule.information,
            start=self.start,
            planner=self._planner(question.objective, "auto"),
            seed=self.rule.seed,
            on_progress=told,
        )
        publish(self._found(question, found, limits, final=True))

    def _found(
        self, question: Question, found: SearchResult, limits: plan_search.Limits, *, final: bool = False
    ) -> Mapping[str, object]:
        """What a search has found so far; on a large graph, errors in centimetres come with the last answer."""
        goals = _goals(question)
        searched = plan_search.gathered([found], goals, points=_POINTS)
        planner = self._planner(question.objective, "auto")
        decision = plan_search.decide(planner, searched)
        errors = plan_errors.PlanErrors(searched.proposals.shortest(decision.best), None, None, None)
        if final or self.graph.num_poses < _LARGE:
            errors = plan_errors.expected(
                self.graph, searched.proposals, decision, Reporter(as_json=True, shows_progress=False)
            )
        names = {name: place for place, name in searched.names.items()}
        front = [
            {"metres": length, "value": value, "way": way}
            for way in range(decision.num_actions)
            if (place := names.get(decision.name(way))) is not None
            for length, value in [found.front[place].tolist()]
        ]
        reached = "" if found.sees_map else "No place in reach sees the map again. "
        return {
            "progress": f"{counted(found.num_evaluations, 'way')} evaluated in {found.seconds:.1f} s",
            "headline": plan_certificate.headline(searched, decision, errors, goals, limits),
            "certificate": reached + plan_certificate.certificate(searched, limits),
            "front": front,
            "limit": found.max_length,
            "most_to_gain": found.value_now - found.lower_bound,
            **self._ways(searched.proposals, decision, errors, searched=True),
            "front_bounds": [{"metres": metres, "value": value} for metres, value in found.front_bounds.tolist()],
        }

    def _compare(self, question: Question, publish: Publish) -> None:
        """A decision among diverse paths; on a large graph, errors in centimetres come after it."""
        begin = time.monotonic()
        rule = replace(
            self.rule, num_paths=question.candidates, max_detour=self.max_detour, closures=self.models[question.closures]
        )
        reporter = Reporter(as_json=True, shows_progress=False)
        proposals = plan_candidates.find_proposals(
            self.graph, self.world, self.start, _goals(question), (), rule, reporter, roadmap=self.roadmap
        )
        family = question.bounds if has_bounds(question.objective, question.bounds) else "auto"
        decision = self._planner(question.objective, family).decide(proposals.actions, proof="bounded")
        note = rate_warning(self.graph, self.models[question.closures], proposals.actions)

        def told(errors: plan_errors.PlanErrors) -> None:
            answer: dict[str, object] = {
                "progress": f"{counted(len(proposals.paths), 'path')} compared in {time.monotonic() - begin:.1f} s",
                "headline": plan_errors.answer(proposals, decision, errors, _goals(question)),
                "certificate": decision.summary(),
                "front": [],
                "limit": max(map(path_length, proposals.paths)),
            }
            publish({**answer, **self._ways(proposals, decision, errors, notes=[note] if note else [])})

        if self.graph.num_poses >= _LARGE:
            told(plan_errors.PlanErrors(proposals.shortest(decision.best), None, None, None))
        told(plan_errors.expected(self.graph, proposals, decision, reporter))

    def _planner(self, objective: str, family: str) -> Planner:
        """One for each, so that the prior is factored once."""
        with self._lock:
            if (objective, family) not in self._planners:
                signature = default_signature(objective)
                planner = Planner(self.graph, objective=objective, signature=signature, bounds=family, engine="incremental")
                self._planners[objective, family] = planner
            return self._planners[objective, family]

    def _ways(
        self,
        proposals: plan_candidates.Proposals,
        decision: Decision,
        errors: plan_errors.PlanErrors,
        *,
        searched: bool = False,
        notes: Sequence[str] = (),
    ) -> Mapping[str, object]:
        why = plan_reasons.reasons(self.graph, self.start, proposals, decision, errors, searched=searched)
        surviving: set[int] = set() if searched else set(decision.survivors.tolist())
        values, ranking = _values(decision), decision.ranking.tolist()
        ways: list[dict[str, object]] = []
        for index, (path, action) in enumerate(zip(proposals.paths, proposals.actions, strict=True)):
            sight, poses = Sight.of(self.graph, self.start, action), path_poses(path)
            standing = "best" if index == decision.best else "possible" if index in surviving else "ruled-out"
            ways.append(
                {
                    "name": decision.name(index),
                    "length": path_length(path),
                    "closures": counted(len(sight.closures), "closure"),
                    "value": _told(values[index], decision.unit),
                    "standing": standing,
                    "rank": ranking.index(index),
                    "why": why[index],
                    "path": rounded(path),
                    "poses": poses.tolist(),
                    "seen": sight.seen.tolist(),
                    "links": rounded(sight.thinned().reshape(-1, 4)),
                    "files": {suffix: path_text(f"way.{suffix}", poses) for suffix in _FORMATS},
                }
            )
        return {
            "ways": ways,
            "best": decision.best,
            "notes": list(notes),
            "unit": shown_unit(decision.unit),
            "scale": shown_factor(decision.unit),
            "front_bounds": [],
        }


def _goals(question: Question) -> list[Goal]:
    return [] if question.goal is None else [Goal(np.array(question.goal), shown(question.goal))]


def _values(decision: Decision) -> FloatArray:
    """The objective of each candidate where it is known, else its lower bound; cost excluded."""
    costs = np.array([candidate.cost for candidate in decision.candidates])
    return np.where(np.isnan(decision.entropies), decision.lower - costs, decision.entropies)


def _told(value: float, unit: str) -> str | None:
    return None if math.isnan(value) else f"{cell(value, unit)} {shown_unit(unit)}"
