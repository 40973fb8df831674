"""Decisions of a simulated robot, on the belief and the map that it has: on the way to a goal, and on a trip."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from topobelief.candidates.learned_closures import learn_closures
from topobelief.candidates.propose import CandidateRule
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.planner import Planner
from topobelief.search.result import SearchResult
from topobelief.simulation.front_end import FrontEndSettings
from topobelief.simulation.record import Deliberation, Leg, RunOptions
from topobelief.simulation.scenario import Goal
from topobelief.simulation.ways import known_candidates
from topobelief.strategies.choice import Choice, Reasons
from topobelief.strategies.choose import choose
from topobelief.strategies.question import Ground, Question
from topobelief.world import World


def decision_rule(
    rule: CandidateRule, belief: PoseGraph, world: World, settings: FrontEndSettings, *, seed: int
) -> CandidateRule:
    """A scenario's rule with factors predicted as the robot's own front end would make them."""
    closures = rule.closures
    if closures is None:
        closures = learn_closures(belief, world=world if rule.line_of_sight else None, rule=settings.expected_closures)
    return replace(
        rule,
        closures=closures,
        seed=seed,
        spacing=settings.key_pose_distance,
        turn=settings.key_pose_angle,
        information=settings.expected_information if belief.num_edges == 0 else None,
    )


def deliberated(
    belief: PoseGraph,
    world: World,
    goal: Goal,
    rule: CandidateRule,
    options: RunOptions,
    leg: Leg,
    *,
    index: int,
    chassis: float,
    position_error: float,
    rng: np.random.Generator,
) -> tuple[Deliberation, Leg]:
    """Candidates on the way to a goal, the choice among them, and what all of them would have been worth.

    Parameters
    ----------
    belief
    world
        As the robot knows it.
    goal, rule, chassis, position_error
        As for `ways.known_candidates`.
    options
        The strategy and the objective.
    leg, index
        What the decision leads to, and its index.
    rng
        For the strategy "random".

    Raises
    ------
    PlanningError
        Where there is no way.
    """
    begin = time.perf_counter()
    found = known_candidates(belief, world, goal, rule, chassis=chassis, position_error=position_error)
    candidates_seconds = time.perf_counter() - begin
    random_scores = np.eye(len(found.actions))[int(rng.integers(len(found.actions)))]
    ground = Ground(found.routes.roadmap, goal.place, world, rule)
    question = Question(belief, found.actions, found.lengths, random_scores, options.objective, ground=ground)
    choice = choose(options.strategy, question)
    own = choice.proposal
    question = question.joined_by(own)
    values, paths = question.values(), found.paths if own is None else [*found.paths, own.path]
    return Deliberation(leg=index, question=question, paths=paths, values=values, choice=choice), replace(
        leg,
        num_candidates=len(paths),
        chosen=choice.index,
        planned=float(question.lengths[choice.index]),
        prior_value=value_after(belief, belief.num_poses, options.objective),
        predicted_value=float(values[choice.index]),
        candidates_seconds=candidates_seconds,
        decision_seconds=choice.seconds,
    )


def deliberated_trip(
    belief: PoseGraph, found: SearchResult, objective: str, leg: Leg, *, index: int
) -> tuple[Deliberation, Leg]:
    """The best trip that a search found, beside some others of its; parameters as for `deliberated`."""
    ways = sorted((found.best, *found.alternatives), key=lambda way: way.length)
    lengths = np.array([way.length for way in ways])
    question = Question(belief, [way.action for way in ways], lengths, np.zeros(len(ways)), objective)
    reasons = Reasons(
        lower=found.value,
        upper=found.value,
        error_bound=None if math.isinf(found.gap) else found.gap,
        num_evaluations=found.num_evaluations,
        proven_optimal=found.proven_optimal,
    )
    choice = Choice(next(i for i, way in enumerate(ways) if way is found.best), found.seconds, reasons)
    values = np.array([way.value for way in ways])
    deliberation = Deliberation(leg=index, question=question, paths=[way.path for way in ways], values=values, choice=choice)
    return deliberation, replace(
        leg,
        num_candidates=len(ways),
        chosen=choice.index,
        planned=found.length,
        prior_value=found.value_now,
        predicted_value=found.value,
        decision_seconds=found.seconds,
    )


def value_after(graph: PoseGraph, num_existing: int, objective: str) -> float:
    """The objective of a graph whose first `num_existing` poses stood before the leg, in its unit."""
    among = (graph.edges < num_existing).all(axis=1)
    prior = PoseGraph(graph.poses[:num_existing], graph.edges[among], None, graph.information[among])
    rest = Action(graph.poses[num_existing:], graph.edges[~among], graph.information[~among])
    return float(Planner(prior, objective=objective).entropies([rest])[0])
