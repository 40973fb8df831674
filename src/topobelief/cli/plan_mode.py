"""What `topobelief plan` is asked for: to search the roadmap, or to compare a list of candidates; and what goes with which."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import typer

from topobelief.cli.extras import require_extras
from topobelief.optional import has_kernels

SECONDS = 2.0
"""How long the roadmap is searched unless a limit is given."""

_OF_LISTS = {
    "candidates": "--candidates",
    "as_paper": "--as-paper",
    "path": "--path",
    "signature": "--signature",
    "bounds": "--bounds",
    "proof": "--proof",
    "margin": "--margin",
    "normalized": "--normalized",
    "allow_dense_spectrum": "--allow-dense-spectrum",
}


@dataclass(frozen=True, slots=True)
class Mode:
    """How a plan finds its answer.

    Attributes
    ----------
    searches
        The whole roadmap; else candidates are compared.
    note
        What a person should know about that, or None.
    """

    searches: bool
    note: str | None = None


def choose(options: Mapping[str, Any]) -> Mode:
    """The mode that the options of a command line ask for.

    Raises
    ------
    typer.BadParameter
        Where options contradict each other.
    InvalidInputError
        Where only a search can answer and numba, which it needs, is not installed.
    """
    of_lists = [option for name, option in _OF_LISTS.items() if _given(options[name])]
    of_lists += ["--determinant"] if options["determinant"] != "cholesky" else []
    _check_trip(options)
    _check_length(options, of_lists)
    if options["max_detour"] == math.inf:
        of_lists.append("--max-detour none")
    if of_lists:
        asked = {"--candidates", "--as-paper", "--path"} & set(of_lists)
        told = f"{of_lists[0]} is for a list of candidates, which are compared in place of a search of the roadmap"
        return Mode(False, None if asked else told)
    if has_kernels():
        return Mode(True)
    if options["max_length"] is not None:
        require_extras("fast")
    return Mode(
        False,
        "the roadmap is not searched, because numba is not installed (pip install 'topobelief[fast]'); candidates are "
        "compared instead",
    )


def _given(value: object) -> bool:
    """Whether an option was: flags are False and lists empty where they were not."""
    return value is not None and value is not False and value != ()


def _check_trip(options: Mapping[str, Any]) -> None:
    """Options of a trip, which has no goal."""
    if options["goal"]:
        for name, option in (("return_to_start", "--return"), ("enough", "--enough")):
            if _given(options[name]):
                raise typer.BadParameter(
                    f"expected a trip without a goal, got {option} with --goal; leave out one of them.", param_hint=option
                )
    elif not options["path"] and options["max_length"] is None:
        raise typer.BadParameter(
            "expected --goal ID or X Y, a candidate of your own by --path FILE, or --max-length M for a trip to anywhere.",
            param_hint="the goal",
        )


def _check_length(options: Mapping[str, Any], of_lists: list[str]) -> None:
    """Limits of length, and that no search and list are asked for at once."""
    for name, option in (("max_length", "--max-length"), ("return_to_start", "--return"), ("enough", "--enough")):
        if _given(options[name]) and of_lists:
            raise typer.BadParameter(
                f"expected a search of the roadmap, got {of_lists[0]}, which compares a list of candidates; "
                "leave out one of them.",
                param_hint=option,
            )
    if options["max_length"] is not None and options["max_detour"] is not None:
        raise typer.BadParameter(
            "expected one limit of length, got --max-detour too; leave out one of them.", param_hint="--max-length"
        )
