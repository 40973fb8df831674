"""What a search of the roadmap tells: what to drive, what no walk can beat, what each further metre buys, when to stop."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

from topobelief.cli.console import Reporter
from topobelief.cli.plan_ends import Goal
from topobelief.cli.plan_errors import PlanErrors, answer, centimetres
from topobelief.cli.plan_search import POINTS_TOLD, Limits, Searched
from topobelief.planning.decision import Decision
from topobelief.planning.units import quantity
from topobelief.report.search_tables import front_table
from topobelief.search.result import SearchResult, said

Verdict = Literal["enough", "drive on", "undecided"]

_QUANTITIES = {
    "error": "the expected map error",
    "map": "the entropy of the map",
    "joint": "the joint entropy",
    "per_pose": "the joint entropy per pose",
}


def say_search(
    searched: Searched, decision: Decision, errors: PlanErrors, goals: Sequence[Goal], limits: Limits, reporter: Reporter
) -> None:
    """The answer, the certificate and the front."""
    found = searched.found
    reporter.say("")
    if limits.enough is not None:
        reporter.say(_verdict_told(found, limits.enough))
    nothing = not found.sees_map and found.stopped_by in ("proof", "rest")
    if nothing:
        reporter.say(f"Nothing to gain within {found.max_length:.1f} m: no place in reach sees the map again.")
    reporter.say(headline(searched, decision, errors, goals, limits))
    if not nothing:
        reporter.say(certificate(searched, limits), front_table(found, POINTS_TOLD, names=searched.names))


def headline(searched: Searched, decision: Decision, errors: PlanErrors, goals: Sequence[Goal], limits: Limits) -> str:
    """What to drive, and what that does to the map."""
    if searched.has_goal:
        return answer(searched.proposals, decision, errors, goals)
    return _trip(searched.found, decision, errors, limits)


def _trip(found: SearchResult, decision: Decision, errors: PlanErrors, limits: Limits) -> str:
    """What to drive without a goal."""
    if len(found.path) == 1:
        return "Stay: no trip that was found is worth its way."
    back = ", back to the start" if limits.return_to_start else ""
    drive = f"Drive {decision.name(decision.best)} ({found.length:.1f} m{back})"
    if errors.now is None or errors.chosen is None:
        return f"{drive}."
    after, now = centimetres(errors.chosen.map_rmse, errors.now.map_rmse)
    return f"{drive}: expected map error {after} cm instead of {now} now."


def certificate(searched: Searched, limits: Limits) -> str:
    """Below which value no walk is, and which walks that is about."""
    found, bound = searched.found, searched.lower_bound
    if math.isinf(bound):
        listed = ", or compare a list of paths, with a proof, by --candidates 20" if searched.has_goal else ""
        return f"Nothing is proven of other walks in this time: give more --seconds{listed}."
    to = " to the goal" if searched.num_searches == 1 else " to a goal"
    where = to if searched.has_goal else " back to the start" if limits.return_to_start else ""
    longest = "" if searched.num_searches > 1 else f", up to {found.max_length:.1f} m,"
    walks = f"walk of the roadmap{where}{longest}"
    own = quantity(found.own_closures_gain, found.unit) if found.own_closures_gain > 0 else ""
    here = f"those of this one gain {own}" if own else "this one has none"
    about = f"(That counts loop closures with the map, not those that a walk closes with itself; {here}.)"
    if found.proven_optimal and bound >= found.lower_bound:
        return f"Proven: no {walks} is better. {about}"
    cost = ", the cost of its metres included" if found.cost_per_metre else ""
    least = f"{centimetres(bound)[0]} cm" if found.objective == "error" else said(bound, found.objective)
    gap = quantity(found.value - bound, found.unit)
    return f"No {walks} leaves less than {least}{cost}: none is better than this by more than {gap}. {about}"


def verdict(found: SearchResult, enough: float) -> Verdict:
    """Whether trips still gain more than is enough: decided by the bound, or by a trip that does."""
    if found.value_now - found.lower_bound <= enough:
        return "enough"
    return "drive on" if found.value_now - found.value > enough else "undecided"


def _verdict_told(found: SearchResult, enough: float) -> str:
    most, gain = found.value_now - found.lower_bound, found.value_now - found.value
    asked = quantity(enough, found.unit) if enough else "anything"
    improves = f"trip of up to {found.max_length:g} m improves {_QUANTITIES[found.objective]}"
    cost = ", its cost deducted," if found.cost_per_metre else ""
    decided = verdict(found, enough)
    if decided == "enough":
        return f"Enough: no {improves}{cost} by more than {asked}."
    if decided == "drive on":
        return f"Not enough yet: a {improves}{cost} by {quantity(gain, found.unit)}, more than {asked}."
    known = "nothing is proven of the others" if math.isinf(most) else f"none by more than {quantity(most, found.unit)}"
    return (
        f"Undecided: the best {improves}{cost} by {quantity(gain, found.unit)}, and {known}, where {asked} was asked for; "
        "give more --seconds."
    )


def document(searched: Searched, limits: Limits) -> dict[str, object]:
    """The search for a program; numbers in metres, or in the unit of the objective."""
    found = searched.found

    def finite(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return {
        "path": found.path.tolist(),
        "value": found.value,
        "length": found.length,
        "value_now": found.value_now,
        "lower_bound": finite(searched.lower_bound),
        "gap": finite(found.value - searched.lower_bound),
        "value_with_map_alone": found.value_with_map_alone,
        "proven_optimal": found.proven_optimal and searched.lower_bound >= found.lower_bound,
        "covers": found.covers,
        "bound_by": found.bound_by or None,
        "max_length": found.max_length,
        "sees_map": found.sees_map,
        "front": found.front.tolist(),
        "front_bounds": found.front_bounds.tolist(),
        "stopped_by": found.stopped_by,
        "num_evaluations": found.num_evaluations,
        "enough": None if limits.enough is None else verdict(found, limits.enough),
    }
