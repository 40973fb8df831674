"""A study's summary for a terminal: one line per strategy, under a line for each session, objective and noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

from rich import box
from rich.table import Table
from rich.text import Text

from topobelief.planning.registry import unit_of
from topobelief.planning.units import cell, shown_unit
from topobelief.study.summary import Summary

_COLUMNS = ("best", "95 %", "loss", "90 % below", "rank", "exact", "ms", "seeds", "failed")


def summary_table(found: Sequence[Summary]) -> Table:
    """Shares with their intervals, losses in the unit of the objective, times as medians."""
    table = Table(
        box=box.SIMPLE_HEAD,
        padding=(0, 1),
        collapse_padding=True,
        pad_edge=False,
        caption="best: how often the choice loses at most 1e-6 of the objective, with its interval; loss: mean; rank: median "
        "of Spearman's correlation; exact: mean number of exact evaluations; ms: median time of the decision",
        caption_justify="left",
    )
    table.add_column("strategy", no_wrap=True)
    for name in _COLUMNS:
        table.add_column(name, justify="right", no_wrap=True)
    for (world, session, objective, xi), group in groupby(found, lambda one: (one.world, one.session, one.objective, one.xi)):
        table.add_row(Text(f"{session} in {world}, {objective} ({shown_unit(unit_of(objective))}), ξ = {xi:g}", style="bold"))
        for one in sorted(group, key=_rank):
            table.add_row(Text(f"  {one.strategy}"), *_cells(one), str(one.num_ok or "–"), str(one.num_failed or "–"))
    return table


def _rank(one: Summary) -> float:
    """The most often right first, those of which nothing is known last."""
    return -one.action_consistent.value if one.num_ok else math.inf


def _cells(one: Summary) -> tuple[str, ...]:
    if not one.num_ok:
        return ("–",) * 7
    share = one.action_consistent
    unit = unit_of(one.objective)
    return (
        f"{share.value:.0%}",
        f"{100 * share.low:.0f}–{100 * share.high:.0f}",
        cell(one.loss.mean, unit),
        cell(one.loss.high, unit),
        cell(one.spearman.median),
        f"{one.evaluations.mean:.1f}",
        f"{1e3 * one.seconds.median:.1f}",
    )
