"""The one table of a decision: its columns and cells as text, for every place that shows them.

`Decision.__str__` sets it in plain text, `Decision._repr_html_` in HTML, and `topobelief.report.tables` on a terminal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Literal

from topobelief.planning.registry import SIGNATURE_UNITS
from topobelief.planning.units import cell, shown_unit
from topobelief.wording import counted

if TYPE_CHECKING:
    from topobelief.planning.decision import Decision

Standing = Literal["yes", "maybe", "no"]
"""Whether an action is the best: chosen, may be better than the chosen one, or cannot be the best."""

_HTML_ROWS = 30
_MUTED = {"no": ' style="opacity: 0.55"', "yes": ' style="font-weight: bold"', "maybe": ""}


@dataclass(frozen=True, slots=True)
class Column:
    """A name, and whether it holds text, which is aligned to the left."""

    name: str
    is_text: bool = False


@dataclass(frozen=True, slots=True)
class Row:
    """The cells of an action, in the order of the columns, and how it stands."""

    cells: tuple[str, ...]
    standing: Standing


@dataclass(frozen=True, slots=True)
class DecisionTable:
    """Rows in ranking order, and what their numbers mean."""

    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...]


def decision_table(decision: Decision) -> DecisionTable:
    """The actions in ranking order; exact values and costs only where there are any."""
    unit = decision.unit
    values = {
        "signature": [cell(value, SIGNATURE_UNITS.get(decision.signature, "")) for value in decision.signatures],
        "lower": [cell(value, unit) for value in decision.lower],
        "upper": [cell(value, unit) for value in decision.upper],
    }
    if decision.num_evaluations:
        values["exact"] = [cell(value, unit) for value in decision.entropies]
    if any(candidate.cost for candidate in decision.candidates):
        values["cost"] = [cell(candidate.cost, unit) for candidate in decision.candidates]
    values["poses"] = [str(candidate.num_new_poses) for candidate in decision.candidates]
    values["closures"] = [_number(each.num_closures, each.expected_closures) for each in decision.candidates]
    if any(candidate.num_observations for candidate in decision.candidates):
        values["observations"] = [_number(each.num_observations, each.expected_observations) for each in decision.candidates]
    values["metres"] = [f"{candidate.length:.1f}" for candidate in decision.candidates]
    columns = (Column("#"), Column("action", is_text=True), *map(Column, values), Column("best", is_text=True))
    surviving = set(decision.survivors.tolist())
    rows: list[Row] = []
    ranking: list[int] = decision.ranking.tolist()
    for rank, action in enumerate(ranking, start=1):
        standing: Standing = "yes" if action == decision.best else "maybe" if action in surviving else "no"
        shown = (texts[action] for texts in values.values())
        rows.append(Row((str(rank), decision.name(action), *shown, standing), standing))
    plus_cost = " plus cost" if "cost" in values else ""
    notes = (
        f"lower, upper: bounds of the {decision.quantity}{plus_cost} in {shown_unit(unit)}; the less, the better.",
        *(["observations: of landmarks, expected."] if "observations" in values else []),
        "Paths are numbered from 0.",
    )
    return DecisionTable(columns, tuple(rows), notes)


def _number(certain: int, expected: float) -> str:
    return str(certain) if math.isnan(expected) else f"{expected:.1f}"


def as_text(table: DecisionTable) -> str:
    """Columns as wide as they need."""
    lines = [tuple(column.name for column in table.columns), *(row.cells for row in table.rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    aligned = [
        "  ".join(
            text.ljust(width) if column.is_text else text.rjust(width)
            for text, width, column in zip(line, widths, table.columns, strict=True)
        ).rstrip()
        for line in lines
    ]
    return "\n".join([*aligned, "", *table.notes])


def as_html(table: DecisionTable, sentence: str) -> str:
    """A sentence and the table beneath, for a notebook; takes colours and fonts from the page.

    Of a long table the first rows and that of the best action are shown.
    """

    def line(tag: str, cells: tuple[str, ...], look: str = "") -> str:
        aligned = (
            f'<{tag} style="padding: 0.1em 0.6em; text-align: {"left" if column.is_text else "right"}">{escape(text)}</{tag}>'
            for text, column in zip(cells, table.columns, strict=True)
        )
        return f"<tr{look}>{''.join(aligned)}</tr>"

    head = line("th", tuple(column.name for column in table.columns))
    shown = [*table.rows[:_HTML_ROWS], *(row for row in table.rows[_HTML_ROWS:] if row.standing == "yes")]
    body = "\n".join(line("td", row.cells, _MUTED[row.standing]) for row in shown)
    left_out = len(table.rows) - len(shown)
    more = [f"{counted(left_out, 'more action')} in print(decision)."] if left_out else []
    notes = "<br>".join(map(escape, [*more, *table.notes]))
    return (
        f"<p>{escape(sentence)}</p>\n<table>\n<thead>{head}</thead>\n<tbody>\n{body}\n</tbody>\n</table>\n"
        f"<p><small>{notes}</small></p>"
    )
