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
}
SIGNATURES = {
    "spanning_trees": "topobelief.signatures.spanning_trees:spanning_trees",
    "von_neumann": "topobelief.signatures.von_neumann:von_neumann",
    "von_neumann_approx": "topobelief.signatures.von_neumann:von_neumann_approx",
}
BOUNDS = {
    "paper": "topobelief.bounds.paper:paper",
    "fischer": "topobelief.bounds.fischer:fischer",
    "fischer_step": "topobelief.bounds.fischer_step:fischer_step",
    "anchored": "topobelief.bounds.anchored:anchored",
    "chain": "topobelief.bounds.chain:chain",
}
ENGINES = {
    "scratch": "topobelief.planning.engine:ScratchEngine",
    "incremental": "topobelief.planning.incremental_engine:IncrementalEngine",
}
AUTO = "auto"
"""Bounds and engine may be left to the planner."""


def chosen(choices: Mapping[str, str], name: str) -> Any:
    """What a name stands for."""
    return imported(choices[name])


def imported(place: str) -> Any:
    """What stands at a place, "module:attribute"."""
    module, _, attribute = place.partition(":")
    return getattr(import_module(module), attribute)
