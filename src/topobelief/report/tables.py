"""Tables for a terminal: the candidates in ranking order, and named quantities."""

from __future__ import annotations

import math
from collections.abc import Iterable

from rich import box
from rich.table import Table
from rich.text import Text

from topobelief.planning.decision import Decision

_STANDINGS = {"yes": "bold green", "maybe": "", "no": "dim"}


def candidate_table(decision: Decision) -> Table:
    """One row an action, in ranking order, some 80 columns wide; exact values only where the decision needed them.

    The last column says whether an action is chosen, may be better still, or cannot be the best.
    """
    unit = "nats per pose" if decision.objective == "per_pose" else decision.unit
    table = Table(
        box=box.SIMPLE_HEAD,
        padding=(0, 1),
        collapse_padding=True,
        pad_edge=False,
        caption=f"lower, upper: bounds of the {decision.objective_in_words} in {unit}; the less, the better.\n"
        "Paths are numbered from 0.",
        caption_justify="left",
    )
    columns = ["signature", "lower", "upper"]
    columns += ["exact"] if decision.num_evaluations else []
    columns += ["cost"] if any(candidate.cost for candidate in decision.candidates) else []
    table.add_column("#", justify="right", no_wrap=True)
    table.add_column("action", no_wrap=True)
    for name in (*columns, "poses", "closures", "metres"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("best", no_wrap=True)
    surviving = set(decision.survivors.tolist())
    ranking: list[int] = decision.ranking.tolist()
    for rank, action in enumerate(ranking, start=1):
        candidate = decision.candidates[action]
        standing = "yes" if action == decision.best else "maybe" if action in surviving else "no"
        values = {
            "signature": decision.signatures[action],
            "lower": decision.lower[action],
            "upper": decision.upper[action],
            "exact": decision.entropies[action],
            "cost": candidate.cost,
        }
        table.add_row(
            str(rank),
            Text(decision.name(action)),  # not markup, whatever the label
            *(number(float(values[name])) for name in columns),
            str(candidate.num_new_poses),
            str(candidate.num_closures),
            f"{candidate.length:.1f}",
            standing,
            style=_STANDINGS[standing],
        )
    return table


def quantity_table(title: str, quantities: Iterable[tuple[str, str]]) -> Table:
    """Names on the left, values on the right."""
    table = Table(box=None, show_header=False, pad_edge=False, title=title, title_justify="left", title_style="bold")
    table.add_column(no_wrap=True, min_width=36)
    table.add_column(overflow="fold")
    for name, value in quantities:
        table.add_row(Text("  " + name), Text(value))
    return table


def number(value: float) -> str:
    """Two decimals, a dash where there is none."""
    return "–" if math.isnan(value) else f"{value:.2f}"
