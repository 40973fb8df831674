"""Beyond candidates, as a table: what the best of some paths gains, and what a search of the whole roadmap does."""

from __future__ import annotations

import math
from collections.abc import Sequence

from topobelief.reproduction.beyond_candidates import BeyondRow, BeyondSummary, beyond_summaries

OBJECTIVE_WORDS = {"error": "expected error", "map": "map entropy"}
_UNITS = {"error": "cm", "map": "nats"}


def beyond_cells(rows: Sequence[BeyondRow]) -> list[list[str]]:
    """A header, then a line for each method; a cell says median gain against staying, gap where it is known, and seconds."""
    found = {(each.objective, each.max_detour, each.method): each for each in beyond_summaries(rows)}
    cases = list(dict.fromkeys((objective, detour) for objective, detour, _ in found))
    header = ["found by", *(f"{OBJECTIVE_WORDS[name]}, detour {detour:g}" for name, detour in cases)]
    methods = list(dict.fromkeys(row.method for row in rows))
    shortest = ["the shortest path"]
    for name, detour in cases:
        each = found[name, detour, methods[0]]
        shortest.append(f"{each.shortest_gain:.2f} {_UNITS[name]}")
    lines = [[method, *(_cell(found[name, detour, method]) for name, detour in cases)] for method in methods]
    return [header, shortest, *lines]


def beyond_markdown(rows: Sequence[BeyondRow]) -> str:
    """The table in Markdown."""
    header, *lines = beyond_cells(rows)
    return "".join(f"| {' | '.join(line)} |\n" for line in (header, ["---"] * len(header), *lines))


def _cell(each: BeyondSummary) -> str:
    gap = "" if math.isnan(each.gap) else f", gap {each.gap:.2f}"
    return f"{each.gain:.2f} {_UNITS[each.objective]}{gap}; {each.length:.1f} m; {each.seconds:.1f} s"
