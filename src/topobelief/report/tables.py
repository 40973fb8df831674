"""Tables for a terminal: the candidates in ranking order, and named quantities."""

from __future__ import annotations

from collections.abc import Iterable

from rich import box
from rich.table import Table
from rich.text import Text

from topobelief.planning.decision import Decision
from topobelief.planning.decision_table import decision_table

_STANDINGS = {"yes": "bold green", "maybe": "", "no": "dim"}


def candidate_table(decision: Decision) -> Table:
    """One row an action, in ranking order, some 80 columns wide; exact values only where the decision needed them.

    The last column says whether an action is chosen, may be better still, or cannot be the best.
    """
    described = decision_table(decision)
    table = Table(
        box=box.SIMPLE_HEAD,
        padding=(0, 1),
        collapse_padding=True,
        pad_edge=False,
        caption="\n".join(described.notes),
        caption_justify="left",
    )
    for column in described.columns:
        table.add_column(column.name, justify="left" if column.is_text else "right", no_wrap=True)
    for row in described.rows:
        table.add_row(*map(Text, row.cells), style=_STANDINGS[row.standing])  # not markup, whatever the label
    return table


def quantity_table(title: str, quantities: Iterable[tuple[str, str]]) -> Table:
    """Names on the left, values on the right."""
    table = Table(box=None, show_header=False, pad_edge=False, title=title, title_justify="left", title_style="bold")
    table.add_column(no_wrap=True, min_width=36)
    table.add_column(overflow="fold")
    for name, value in quantities:
        table.add_row(Text("  " + name), Text(value))
    return table
