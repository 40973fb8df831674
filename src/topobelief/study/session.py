"""A planning session played to its last decision, and that decision judged by the exact objective of all candidates.

The way to each earlier goal is the path of best s_ST, whatever the strategy, and what is measured on it is what the geometry
predicts (as in the sessions of Kitanov and Indelman, arXiv 1903.00927): all strategies and objectives decide on one prior
among the same candidates, so that their rows compare in pairs.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from functools import lru_cache
from importlib.metadata import version

import numpy as np

from topobelief.candidates.propose import Candidates, Routes, find_routes, predict_candidates
from topobelief.graph.action import posterior
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision_quality import DecisionQuality, decision_quality
from topobelief.planning.planner import Planner
from topobelief.strategies.choose import choose
from topobelief.strategies.question import Ground, Question
from topobelief.study.tasks import Task

TIE = 1e-6
"""A choice that loses no more than this, in the unit of the objective, is as good as the best; so is an order."""

Row = dict[str, object]
"""Values by the names of `rows.COLUMNS`."""


@dataclass(frozen=True, slots=True)
class _Leg:
    """The way to one goal; legs of the same world, session, rule, goal and seed are the same."""

    place: str
    number: int
    seed: int
    task: Task = field(compare=False)


def play(task: Task) -> Row:
    """Play a session and judge its last decision.

    Returns
    -------
    Row
        All columns but those that say how the task fared. Objectives and bounds are in the unit of the objective.

    Raises
    ------
    TopobeliefError
        Where a goal cannot be reached, the bounds do not cover the noise, or a value could not be computed.
    """
    graph, seconds = task.session.graph, 0.0
    last = len(task.session.goals) - 1
    for number in range(last):
        found, spent = _candidates(task, graph, number)
        best = Planner(graph).decide(found.actions, proof="none").best
        graph, seconds = posterior(graph, found.actions[best]), seconds + spent
    found, spent = _candidates(task, graph, last)
    actions, lengths = found.actions, found.lengths
    rule = task.rule
    random_scores = task.rng.permutation(len(actions)).astype(np.float64)
    of_candidates = replace(rule.candidates, information=task.noise.information, seed=task.seed)
    ground = Ground(found.routes.roadmap, task.session.goals[last], task.world, of_candidates)
    question = Question(graph, actions, lengths, random_scores, task.objective, rule.bounds, rule.determinant, ground=ground)
    choice = choose(task.strategy, question)
    reasons = choice.reasons
    question = question.joined_by(choice.proposal)
    actions, lengths = question.actions, question.lengths
    begin = time.perf_counter()
    values = question.values()
    spread = float(np.ptp(values))
    quality = None if reasons.scores is None else decision_quality(values, reasons.scores)
    scored = time.perf_counter() - begin
    chosen = actions[choice.index]
    loss = float(values[choice.index] - values.min())
    return {
        "num_poses": graph.num_poses,
        "num_edges": graph.num_edges,
        "num_candidates": len(actions),
        "chosen": choice.index,
        "length": float(lengths[choice.index]),
        "num_new_poses": chosen.num_new_poses,
        "num_closures": chosen.num_closures,
        "value": float(values[choice.index]),
        "best_value": float(values.min()),
        "spread": spread,
        "loss": loss,
        "action_consistent": loss <= TIE,
        "signature": None if reasons.scores is None else float(reasons.scores[choice.index]),
        "lower": reasons.lower,
        "upper": reasons.upper,
        "error_bound": reasons.error_bound,
        "num_survivors": reasons.num_survivors,
        "num_evaluations": reasons.num_evaluations,
        "proven_optimal": reasons.proven_optimal,
        **_quality_columns(quality, spread),
        "candidate_lengths": lengths.tolist(),
        "candidate_values": values.tolist(),
        "candidate_scores": None if reasons.scores is None else reasons.scores.tolist(),
        "version": version("topobelief"),
        "candidates_seconds": seconds + spent,
        "decision_seconds": choice.seconds,
        "scoring_seconds": scored,
    }


def _quality_columns(quality: DecisionQuality | None, spread: float) -> Row:
    """Of the order of all candidates, where the strategy has one; where all tie, correlations would be those of rounding."""
    if quality is None:
        return {"order_consistent": None, "gamma": None, "spearman": None, "kendall": None}
    distinct = spread > TIE
    return {
        "order_consistent": quality.gamma <= TIE,
        "gamma": quality.gamma,
        "spearman": quality.spearman if distinct else None,
        "kendall": quality.kendall if distinct else None,
    }


def _candidates(task: Task, graph: PoseGraph, number: int) -> tuple[Candidates, float]:
    """Candidates for a goal, and the seconds that finding them took."""
    routes, seconds = _routes(_Leg(task.place, number, task.seed, task))
    begin = time.perf_counter()
    rule = replace(task.rule.candidates, information=task.noise.information)
    found = predict_candidates(graph, task.world, routes, rule)
    return found, seconds + time.perf_counter() - begin


@lru_cache(maxsize=16)
def _routes(leg: _Leg) -> tuple[Routes, float]:
    """Ways of a leg and the seconds they took; neighbouring tasks differ in what comes after them alone."""
    begin = time.perf_counter()
    task, number = leg.task, leg.number
    session = task.session
    start = session.graph.positions[-1] if number == 0 else session.goals[number - 1]
    rule = replace(task.rule.candidates, num_paths=session.num_paths[number], seed=task.seed)
    return find_routes(task.world, start, session.goals[number], rule), time.perf_counter() - begin
