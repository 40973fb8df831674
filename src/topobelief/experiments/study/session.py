"""A planning session played to its last decision, and that decision judged by the exact objective of all candidates.

The way to each earlier goal is the path of best s_ST, whatever the strategy, and what is measured on it is what the geometry
predicts (as in the sessions of Kitanov and Indelman, arXiv 1903.00927): all strategies and objectives decide on one prior
among the same candidates, so that their rows compare in pairs.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import version

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.diverse_paths import diverse_paths
from topobelief.candidates.polyline import path_length
from topobelief.candidates.predicted_factors import predict_actions
from topobelief.candidates.roadmap import build_roadmap
from topobelief.experiments.study.strategies import Question, choose
from topobelief.experiments.study.tasks import Task
from topobelief.graph.action import Action, posterior
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision_quality import DecisionQuality, decision_quality
from topobelief.planning.planner import Planner

TIE = 1e-6
"""Nats: a choice that loses no more than this is as good as the best, and an order broken by no more is kept."""

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
        All columns but those that say how the task fared. Objectives and bounds are in nats.

    Raises
    ------
    TopobeliefError
        Where a goal cannot be reached, the bounds do not cover the noise, or a value could not be computed.
    """
    graph, seconds = task.session.graph, 0.0
    last = len(task.session.goals) - 1
    for number in range(last):
        _, actions, spent = _candidates(task, graph, number)
        best = Planner(graph).decide(actions, proof="none").best
        graph, seconds = posterior(graph, actions[best]), seconds + spent
    lengths, actions, spent = _candidates(task, graph, last)
    rule = task.rule
    question = Question(graph, actions, lengths, task.objective, rule.bounds, rule.determinant)
    choice = choose(task.strategy, question, rng=task.rng)
    begin = time.perf_counter()
    values = question.planner().entropies(actions)
    spread = float(np.ptp(values))
    quality = None if choice.scores is None else decision_quality(values, choice.scores)
    scored = time.perf_counter() - begin
    chosen = actions[choice.action]
    loss = float(values[choice.action] - values.min())
    return {
        "num_poses": graph.num_poses,
        "num_edges": graph.num_edges,
        "num_candidates": len(actions),
        "chosen": choice.action,
        "length": float(lengths[choice.action]),
        "num_new_poses": chosen.num_new_poses,
        "num_closures": chosen.num_closures,
        "value": float(values[choice.action]),
        "best_value": float(values.min()),
        "spread": spread,
        "loss": loss,
        "action_consistent": loss <= TIE,
        "signature": None if choice.scores is None else float(choice.scores[choice.action]),
        "lower": choice.lower,
        "upper": choice.upper,
        "error_bound": choice.error_bound,
        "num_survivors": choice.num_survivors,
        "num_evaluations": choice.num_evaluations,
        "proven_optimal": choice.proven_optimal,
        **_quality_columns(quality, spread),
        "candidate_lengths": lengths.tolist(),
        "candidate_values": values.tolist(),
        "candidate_scores": None if choice.scores is None else choice.scores.tolist(),
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


def _candidates(task: Task, graph: PoseGraph, number: int) -> tuple[FloatArray, list[Action], float]:
    """Lengths of the candidate paths to a goal, the actions along them, and the seconds that both took."""
    paths, seconds = _paths(_Leg(task.place, number, task.seed, task))
    begin, rule = time.perf_counter(), task.rule
    actions = predict_actions(
        graph,
        paths,
        information=task.noise.information,
        spacing=rule.spacing,
        closure_radius=rule.closure_radius,
        closure_angle=rule.closure_angle,
        min_index_gap=rule.min_index_gap,
        world=task.world if rule.line_of_sight else None,
    )
    return np.array([path_length(path) for path in paths]), actions, seconds + time.perf_counter() - begin


@lru_cache(maxsize=16)
def _paths(leg: _Leg) -> tuple[Sequence[FloatArray], float]:
    """Paths of a leg and the seconds they took; neighbouring tasks differ in what comes after them alone."""
    begin = time.perf_counter()
    task, number, rule = leg.task, leg.number, leg.task.rule
    session = task.session
    start = session.graph.positions[-1] if number == 0 else session.goals[number - 1]
    goal = session.goals[number]
    max_detour = rule.max_detour if np.isfinite(rule.max_detour) else None
    roadmap = build_roadmap(task.world, start, goal, rule.num_vertices, rule.robot_radius, task.seed)
    paths = diverse_paths(roadmap, start, goal, session.num_paths[number], max_detour, task.seed)
    return paths, time.perf_counter() - begin
