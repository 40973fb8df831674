"""The choices of a planner by name, each with the place of its one file; a file is loaded when it is first chosen.

To add one, write its file and a line here: the command line, the studies and the documentation read these tables.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

OBJECTIVES = {
    "joint": "topobelief.objectives.joint:OBJECTIVE",
    "map": "topobelief.objectives.map:OBJECTIVE",
    "per_pose": "topobelief.objectives.per_pose:OBJECTIVE",
    "error": "topobelief.objectives.error:OBJECTIVE",
}
FOCUSED = "focused"
ALL_OBJECTIVES = {**OBJECTIVES, FOCUSED: "topobelief.objectives.focused:FocusedEntropy"}
"""Besides those that need no more than a name, one that is told which poses are in focus."""
SIGNATURES = {
    "spanning_trees": "topobelief.signatures.spanning_trees:spanning_trees",
    "von_neumann": "topobelief.signatures.von_neumann:von_neumann",
    "von_neumann_approx": "topobelief.signatures.von_neumann:von_neumann_approx",
    "resistance": "topobelief.signatures.resistance:resistance",
}
SIGNATURE_UNITS = {"spanning_trees": "nats", "resistance": "m"}
"""Of the signatures that estimate an objective of this unit; from these the cost is taken before actions are ranked."""

SIGNATURE_WORDS = {
    "spanning_trees": "spanning trees",
    "von_neumann": "von Neumann entropy",
    "von_neumann_approx": "von Neumann entropy by degrees",
    "resistance": "effective resistance",
}
"""Signatures as sentences name them."""

BOUNDS = {
    "paper": "topobelief.bounds.paper:paper",
    "fischer": "topobelief.bounds.fischer:fischer",
    "fischer_step": "topobelief.bounds.fischer_step:fischer_step",
    "anchored": "topobelief.bounds.anchored:anchored",
    "chain": "topobelief.bounds.chain:chain",
}
"""Families of bounds of ln det I, for the entropies: all names."""

ERROR_BOUNDS = {
    "fischer": "topobelief.bounds.squared_error:fischer",
    "anchored": "topobelief.bounds.squared_error:exact",
    "chain": "topobelief.bounds.squared_error:exact",
}
"""Families of bounds of the squared expected error; the last two are exact."""

FAMILIES = {"log_det": BOUNDS, "squared_error": ERROR_BOUNDS}
"""Families of bounds by what an objective is a function of (`Objective.argument`)."""

ENGINES = {
    "scratch": "topobelief.planning.engine:ScratchEngine",
    "incremental": "topobelief.planning.incremental_engine:IncrementalEngine",
}
AUTO = "auto"
"""Bounds and engine may be left to the planner."""


def default_signature(objective: str) -> str:
    """The signature that ranks actions for an objective where no other is named.

    Examples
    --------
    >>> default_signature("error"), default_signature("joint")
    ('resistance', 'spanning_trees')
    """
    return "resistance" if objective == "error" else "spanning_trees"


def has_bounds(objective: str, family: str) -> bool:
    """Whether there are bounds of an objective by a family; those that are left to the planner there always are."""
    return family == AUTO or family in FAMILIES[chosen(ALL_OBJECTIVES, objective).argument]


def unit_of(objective: str) -> str:
    """Of an objective, by name (`planning.units` says how its numbers are shown)."""
    return chosen(ALL_OBJECTIVES, objective).unit


def chosen(choices: Mapping[str, str], name: str) -> Any:
    """What a name stands for."""
    return imported(choices[name])


def imported(place: str) -> Any:
    """What stands at a place, "module:attribute"."""
    module, _, attribute = place.partition(":")
    return getattr(import_module(module), attribute)
