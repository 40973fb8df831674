"""The answer in centimetres: the map's expected error now, after the chosen path and after the shortest one."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

from topobelief.cli.console import Reporter
from topobelief.cli.plan_candidates import Proposals
from topobelief.cli.plan_ends import Goal
from topobelief.errors import IllConditionedError, NotOptimizedWarning
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision import Decision
from topobelief.position_errors import ExpectedErrors, expected_errors


@dataclass(frozen=True, slots=True)
class PlanErrors:
    """Expected errors, metres; None where double precision cannot give them."""

    shortest_path: int  # the shortest candidate to the goal of the chosen one
    now: ExpectedErrors | None
    chosen: ExpectedErrors | None
    shortest: ExpectedErrors | None

    def document(self) -> dict[str, object]:
        """For a program."""

        def one(errors: ExpectedErrors | None) -> dict[str, float] | None:
            return None if errors is None else {"map_rmse": errors.map_rmse, "goal_std": errors.goal_std}

        return {
            "now": None if self.now is None else {"map_rmse": self.now.map_rmse},
            "chosen": one(self.chosen),
            "shortest": one(self.shortest),
            "shortest_path": self.shortest_path,
        }


def expected(graph: PoseGraph, proposals: Proposals, decision: Decision, reporter: Reporter) -> PlanErrors:
    """The errors that an answer tells; exact, whatever the objective."""
    chosen, shortest = decision.best, proposals.shortest(decision.best)
    with reporter.stage("errors"), warnings.catch_warnings():
        warnings.simplefilter("ignore", NotOptimizedWarning)  # reading the graph has told
        try:
            now = expected_errors(graph)
            after = expected_errors(graph, proposals.actions[chosen])
            after_shortest = after if shortest == chosen else expected_errors(graph, proposals.actions[shortest])
        except IllConditionedError as error:
            reporter.note(f"errors in centimetres are not known: {error}")
            return PlanErrors(shortest, None, None, None)
    return PlanErrors(shortest, now, after, after_shortest)


def answer(proposals: Proposals, decision: Decision, errors: PlanErrors, goals: Sequence[Goal]) -> str:
    """What to drive and what it does to the map, in a sentence or two."""
    best = decision.best
    the_shortest = f"the shortest{_of_which(goals, proposals.goals[best])}"
    length, least = (decision.candidates[index].length for index in (best, errors.shortest_path))
    shortest = errors.shortest_path == best
    alone = sum(goal == proposals.goals[best] for goal in proposals.goals) == 1
    extra = "" if alone else f", {the_shortest}" if shortest else f", {length - least:.1f} m more than {the_shortest}"
    drive = f"Drive {decision.name(best)} ({length:.1f} m{extra})"
    if errors.now is None or errors.chosen is None or errors.shortest is None:
        return f"{drive}."
    before = errors.now if shortest else errors.shortest
    after, instead = centimetres(errors.chosen.map_rmse, before.map_rmse)
    as_it_is = " now" if shortest else ""
    map_error = f"expected map error {after} cm instead of {instead}{as_it_is}"
    if shortest:
        return f"{drive}: {map_error}; at the goal {centimetres(errors.chosen.goal_std)[0]} cm."
    at_goal = centimetres(errors.chosen.goal_std, errors.shortest.goal_std)
    now = centimetres(errors.now.map_rmse)[0]
    return (
        f"{drive}: {map_error}; at the goal {at_goal[0]} cm instead of {at_goal[1]}. "
        f"That is against {decision.name(errors.shortest_path)}, {the_shortest}; now the map's expected error is {now} cm."
    )


def _of_which(goals: Sequence[Goal], goal: int | None) -> str:
    """Of which paths the shortest is meant, where they lead to several goals."""
    if len(goals) < 2:
        return ""
    return " of those to none of the goals" if goal is None else f" to {goals[goal].name}"


def centimetres(*metres: float) -> tuple[str, ...]:
    """Lengths in centimetres: two digits of the smallest or more, up to three decimals where that tells them apart.

    Examples
    --------
    >>> centimetres(0.0841, 0.119), centimetres(2.5, 2.5), centimetres(0.0024, 0.0041), centimetres(0.12341, 0.12348)
    (('8.4', '11.9'), ('250', '250'), ('0.24', '0.41'), ('12.34', '12.35'))
    """
    smallest = 100 * min(metres)
    least = 0 if smallest >= 100 else 1 if smallest >= 1 else 2
    shown = [tuple(f"{100 * value:.{digits}f}" for value in metres) for digits in range(least, 4)]
    return next((texts for texts in shown if len(set(texts)) == len(texts)), shown[0])
