"""Which loops predicted paths close, as the options of `topobelief plan` say: learned, by the paper's rule, or by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.learned_closures import learn_closures
from topobelief.candidates.propose import CandidateRule
from topobelief.cli.console import Reporter
from topobelief.errors import InvalidInputError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world import World

Closures = Literal["learned", "paper", "by-hand"]


def stated_closures(
    name: Closures | None,
    *,
    paper: bool,
    closure_radius: float | None,
    closure_angle: float | None,
    min_index_gap: int | None,
) -> ClosureModel | None:
    """The closure model of the options; None where it is to be learned from the graph.

    Without a name, numbers state a rule by hand, all of the paper's choices (`paper`) include its rule, and else it is learned.
    Numbers take the place of those of the rule that is named.

    Raises
    ------
    InvalidInputError
        Where numbers are given for a model that is to be learned.
    """
    numbers = {"radius": closure_radius, "angle": closure_angle, "min_index_gap": min_index_gap}
    given = {key: value for key, value in numbers.items() if value is not None}
    if name is None:
        name = "paper" if paper else "by-hand" if given else "learned"
    if name == "learned":
        if given:
            raise InvalidInputError(
                "expected --closures learned without numbers, got some; use --closures by-hand, or leave out "
                "--closure-radius, --closure-angle and --min-index-gap"
            )
        return None
    return replace(ClosureModel.paper() if name == "paper" else ClosureModel.by_hand(), **given)


def with_closures(rule: CandidateRule, graph: PoseGraph, world: World, reporter: Reporter) -> CandidateRule:
    """The rule with its closure model, learned where none is stated; told in one line."""
    seen_in = world if rule.line_of_sight else None
    model = rule.closures if rule.closures is not None else learn_closures(graph, world=seen_in)
    reporter.say(str(model))
    return replace(rule, closures=model)
