"""Which loops predicted paths close and which landmarks they observe, as the options of `topobelief plan` say."""

from __future__ import annotations

from dataclasses import replace

from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.learned_closures import learn_closures
from topobelief.candidates.observations import ObservationModel, learn_observations
from topobelief.cli.console import Reporter
from topobelief.cli.plan_options import Closures
from topobelief.errors import InvalidInputError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world import FreeSpace

_OPTIONS = {
    "max_range": "--observation-range",
    "field_of_view": "--field-of-view",
    "max_per_pose": "--observation-cap",
    "probability": "--observation-chance",
}


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


def told_closures(
    stated: ClosureModel | None, graph: PoseGraph, world: FreeSpace, reporter: Reporter, *, line_of_sight: bool
) -> ClosureModel:
    """The closure model, learned from the graph where none is stated; told in one line."""
    model = stated if stated is not None else learn_closures(graph, world=world if line_of_sight else None)
    reporter.say(str(model))
    return model


def told_observations(
    graph: PoseGraph, world: FreeSpace, reporter: Reporter, *, line_of_sight: bool, **stated: float | None
) -> ObservationModel | None:
    """How landmarks are observed, learned from the graph as far as it is not `stated`, and told; None where it has none.

    Raises
    ------
    InvalidInputError
        Where something is stated and the graph has no landmarks.
    """
    given = {name: value for name, value in stated.items() if value is not None}
    model = learn_observations(graph, world=world if line_of_sight else None, **given)
    if model is not None:
        reporter.say(str(model))
    elif given:
        options = " and ".join(_OPTIONS[name] for name in given)
        raise InvalidInputError(f"expected landmarks in the graph with {options}, got none; leave out what is about them")
    return model
