"""Why a path was chosen and why another was not: one sentence for each candidate, and more about one on request."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence

import numpy as np

from topobelief.candidates.seen_again import described, observed, seen_again
from topobelief.candidates.start import Start
from topobelief.cli.console import Reporter
from topobelief.cli.plan_candidates import Proposals
from topobelief.cli.plan_errors import PlanErrors, centimetres
from topobelief.errors import IllConditionedError, InvalidInputError, NotOptimizedWarning
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision import Decision
from topobelief.planning.units import quantity
from topobelief.position_errors import expected_errors
from topobelief.wording import closures_in_words

_MOST = 20  # reasons told unasked
_NARROW = 1e-3  # of a value: bounds that differ by less tell it well enough for a person
_EQUAL = 1e-6  # of a value: candidates that differ by less are as good


def reasons(
    graph: PoseGraph, start: Start, proposals: Proposals, decision: Decision, errors: PlanErrors, *, searched: bool = False
) -> list[str]:
    """A sentence for each candidate, in the order of their indices: what it sees again, and what excludes it.

    Of candidates from a search (`searched`), the best is the best found.
    """
    claim = "chosen: the best way found" if searched else _claim(decision)
    return [
        f"{decision.name(index)} {described(graph, seen_again(graph, start.pose, action))}{observed(graph, action)}"
        f"{_gain(decision, index, errors)}; {_standing(decision, index, claim)}"
        for index, action in enumerate(proposals.actions)
    ]


def _gain(decision: Decision, index: int, errors: PlanErrors) -> str:
    """How much of the map's error it takes, where that is the objective and known."""
    value = _value(decision, index, tolerance=_NARROW) - decision.candidates[index].cost
    if decision.objective != "error" or math.isnan(value) or errors.now is None:
        return ""
    return f", which takes the map's expected error from {' to '.join(centimetres(errors.now.map_rmse, value))} cm"


def _value(decision: Decision, index: int, *, tolerance: float = _EQUAL) -> float:
    """The objective with its cost, evaluated or between bounds that all but coincide; nan where it is not known."""
    exact = float(decision.entropies[index]) + decision.candidates[index].cost
    lower, upper = float(decision.lower[index]), float(decision.upper[index])
    return (lower + upper) / 2 if upper - lower <= tolerance * max(abs(lower), abs(upper)) else exact


def _standing(decision: Decision, index: int, claim: str) -> str:
    """Chosen, or by how much it is worse, or what is not known."""
    best = decision.best
    if index == best:
        return claim
    name, unit = decision.name(best), decision.unit
    with_costs = ", costs included" if any(candidate.cost for candidate in decision.candidates) else ""
    value, value_of_best = _value(decision, index), _value(decision, best)
    lower, upper = float(decision.lower[index]), float(decision.upper[best])
    if not math.isnan(value) and not math.isnan(value_of_best):
        worse, scale = value - value_of_best, max(abs(value), abs(value_of_best))
        if worse <= _EQUAL * scale:
            longer = decision.candidates[index].length - decision.candidates[best].length
            return f"as good as {name}, and {longer:.1f} m longer" if longer > 0 else f"as good as {name}"
        return f"worse than {name} by {quantity(worse, unit)}{with_costs}"
    if math.isnan(lower) or math.isnan(upper):
        return "not compared by bounds, only by its signature"
    if lower > upper:
        return f"excluded by its lower bound: worse than {name} by at least {quantity(lower - upper, unit)}{with_costs}"
    return f"not excluded: it could be better than {name} by up to {quantity(upper - lower, unit)}{with_costs}"


def _claim(decision: Decision) -> str:
    if decision.num_actions == 1:
        return "chosen as the only candidate"
    if decision.proven_optimal:
        return f"chosen: proven to have the least {decision.quantity}"
    if decision.num_evaluations:
        return f"chosen: the least {decision.quantity} of those evaluated"
    return "chosen: first of the ranking by signature"


def say(
    reasons: Sequence[str],
    decision: Decision,
    asked: Sequence[int],
    detailed: Callable[[int], Sequence[str]],
    reporter: Reporter,
) -> None:
    """The reasons of the first of the ranking; or of those that were asked for, each with details."""
    reporter.say("Why, and why not:")
    for index in asked or decision.ranking.tolist()[:_MOST]:
        reporter.say(f"  {reasons[index]}", *(detailed(index) if asked else ()))
    if not asked and len(reasons) > _MOST:
        reporter.say(f"  and {len(reasons) - _MOST} more: --why N, or decision.json")


def asked_for(decision: Decision, names: Sequence[str]) -> list[int]:
    """The candidates of --why, by number or label.

    Raises
    ------
    InvalidInputError
        Names one that is none.
    """
    labels = [decision.name(index) for index in range(decision.num_actions)]
    found: list[int] = []
    for name in names:
        text = name.strip()
        if text.isdecimal() and int(text) < len(labels):
            found.append(int(text))
        elif text in labels:
            found.append(labels.index(text))
        else:
            raise InvalidInputError(
                f"expected --why as the number of a path (0 to {len(labels) - 1}) or its label, got {name!r}"
            )
    return found


def details(
    graph: PoseGraph,
    start: Start,
    proposals: Proposals,
    decision: Decision,
    index: int,
    reporter: Reporter,
    *,
    searched: bool = False,
) -> list[str]:
    """Lines about one candidate: its errors in centimetres, its rank, and each stretch that it sees again.

    Candidates from a search (`searched`) were not chosen by a ranking, so it is not told.
    """
    candidate, action = decision.candidates[index], proposals.actions[index]
    rank = 1 + decision.ranking.tolist().index(index)
    ranked = "" if searched else f"; rank {rank} of {decision.num_actions} by signature"
    lines = [f"    {candidate.length:.1f} m, {candidate.num_new_poses} new poses{ranked}"]
    with reporter.stage("errors"), warnings.catch_warnings():
        warnings.simplefilter("ignore", NotOptimizedWarning)
        try:
            after = expected_errors(graph, action)
            lines[0] += (
                f"; after it the map's expected error is {centimetres(after.map_rmse)[0]} cm, "
                f"at the goal {centimetres(after.goal_std)[0]} cm"
            )
        except IllConditionedError:
            pass
    driven = np.cumsum(np.linalg.norm(np.diff(np.vstack([start.place, graph.group.position(action.poses)]), axis=0), axis=1))
    for stretch in seen_again(graph, start.pose, action):
        poses = f"pose{'s' if stretch.last > stretch.first else ''} {stretch.name(graph)}"
        closures = closures_in_words(stretch.num_closures, stretch.expected)
        lines.append(
            f"    {poses}: {closures}, {driven[stretch.first_new]:.1f} to {driven[stretch.last_new]:.1f} m along the path"
        )
    return lines
