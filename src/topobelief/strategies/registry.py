"""The strategies by name, each with the place of its one file, which is loaded when the strategy is first used.

To add one, write its file and a line here: the simulation and the studies read this table. A new signature needs no line.
"""

from __future__ import annotations

import re

from topobelief.errors import InvalidInputError
from topobelief.planning.registry import SIGNATURES

STRATEGIES = {
    **dict.fromkeys(SIGNATURES, "topobelief.strategies.by_bounds:by_bounds"),
    "optimum": "topobelief.strategies.optimum:optimum",
    "standard": "topobelief.strategies.standard:standard",
    "roadmap": "topobelief.strategies.roadmap:roadmap",
    "shortest": "topobelief.strategies.shortest:shortest",
    "random": "topobelief.strategies.random_choice:random_choice",
}
"""Signatures rank; "optimum" proves which candidate is best; "standard" evaluates all; "roadmap" finds a path of its own; the
last two ignore the graph."""

_PATH_K = "topobelief.strategies.path_k:path_k"


def place_of(name: str) -> str:
    """Module and function of one of `STRATEGIES`, or of "path-k": the k-th shortest candidate from 0 (the last, if fewer).

    Raises
    ------
    InvalidInputError
        Names the choices.
    """
    if name in STRATEGIES:
        return STRATEGIES[name]
    if re.fullmatch(r"path-(0|[1-9][0-9]*)", name):
        return _PATH_K
    raise InvalidInputError(f'expected a strategy of {", ".join(STRATEGIES)}, or path-0, path-1, …, got "{name}"')


def proposes(name: str) -> bool:
    """Whether a strategy finds a path of its own in place of choosing among candidates.

    Examples
    --------
    >>> proposes("roadmap"), proposes("optimum")
    (True, False)
    """
    return name == "roadmap"


def checked_strategy(name: str) -> str:
    """The name of a strategy, as it is; refuses what `place_of` refuses."""
    place_of(name)
    return name
