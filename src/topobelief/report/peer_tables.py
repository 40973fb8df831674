"""The search over a roadmap beside its peers, as tables for a terminal."""

from __future__ import annotations

import math
from collections.abc import Iterable

from rich import box
from rich.table import Table

from topobelief.benchmark.search_comparison import ComparedPeers, PeerSummary
from topobelief.planning.registry import unit_of


def peer_tables(found: ComparedPeers) -> Iterable[Table | str]:
    """What was measured on, then one table a place and objective."""
    clock = "times are of the processor, all threads together" if found.comparison.cpu_time else "times are elapsed times"
    yield "; ".join(f"{name} {value}" for name, value in found.machine.items()) + f"; {clock}"
    summaries = found.summaries
    for place, objective in dict.fromkeys((each.place, each.objective) for each in summaries):
        yield peer_table([each for each in summaries if (each.place, each.objective) == (place, objective)])
    yield (
        "gain: below the value of the graph as it is. share: of the largest gain that any found. gap: to the best bound "
        "that any proved. own gap: to the bound proved by itself."
    )


def peer_table(rows: list[PeerSummary]) -> Table:
    """One line a peer."""
    first = rows[0]
    unit = unit_of(first.objective)
    scale, shown = (100.0, "cm") if unit == "m" else (1.0, unit)
    seeds = "1 seed" if first.num_seeds == 1 else f"medians of {first.num_seeds} seeds"
    title = f"{first.place}: {first.num_poses} poses, {first.way:.0f} m to the goal, {first.objective} ({shown}), {seeds}"
    table = Table(box=box.SIMPLE_HEAD, title=title, title_justify="left", pad_edge=False)
    for name in ("", "gain", "share", "gap", "own gap", "evaluations", "seconds"):
        table.add_column(name, justify="right" if name else "left")
    for row in rows:
        values = (_number(scale * row.gain), f"{100 * row.share:.1f} %", _number(scale * row.gap), _number(scale * row.own_gap))
        table.add_row(row.peer, *values, f"{row.num_evaluations:.0f}", f"{row.seconds:.2f}")
    return table


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:#.3g}".rstrip(".")
