"""Entropy or error, as a table: what each way to choose loses, over all places, seeds and noises."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from topobelief.report.reproduction.panels import CHOOSER_NAMES, CLOSURE_NAMES, signed
from topobelief.reproduction.entropy_or_error import CLOSURES, DETOURS, ChoiceRow, ChoiceSummary, summaries

_NAMES = {"error": "expected error, exact", **CHOOSER_NAMES}


def choice_cells(rows: Sequence[ChoiceRow]) -> list[list[str]]:
    """A header, then a line for each way to choose.

    A cell of a case says: mean loss and largest loss in per cent of the least expected error; median rank correlation.
    """
    cases = [(kind, detour) for kind in CLOSURES for detour in DETOURS]
    by_case = {
        (each.closures, each.max_detour, each.chooser): each for each in summaries([replace(row, place="") for row in rows])
    }
    overall = {each.chooser: each for each in summaries([replace(row, place="", closures="", max_detour=0.0) for row in rows])}
    header = [
        "chosen by",
        *(f"{CLOSURE_NAMES[kind]}, detour {detour:g}" for kind, detour in cases),
        "error lost, cm",
        "map entropy lost, nats",
        "ms an action",
    ]
    lines = [
        [
            _NAMES[chooser],
            *(_case(by_case.get((kind, detour, chooser))) for kind, detour in cases),
            f"{whole.mean_error_lost:.2f} ({whole.max_error_lost:.1f})",
            f"{whole.mean_map_lost:.2f} ({whole.max_map_lost:.1f})",
            "" if math.isnan(whole.milliseconds) else f"{whole.milliseconds:.2f}",
        ]
        for chooser in _NAMES
        if (whole := overall.get(chooser)) is not None
    ]
    return [header, *lines]


def choices_markdown(rows: Sequence[ChoiceRow]) -> str:
    """The table in Markdown."""
    header, *lines = choice_cells(rows)
    written = [header, ["---"] * len(header), *lines]
    return "".join(f"| {' | '.join(line)} |\n" for line in written)


def _case(found: ChoiceSummary | None) -> str:
    if found is None:
        return ""
    rank = "" if math.isnan(found.error_correlation) else f"; ρ {signed(found.error_correlation)}"
    return f"{found.mean_share_lost:.2f} % ({found.max_share_lost:.1f}){rank}"
