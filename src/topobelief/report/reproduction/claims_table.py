"""The table of claims, for a terminal and for a page of documentation."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box
from rich.table import Table
from rich.text import Text

from topobelief.reproduction.claims import Claim

_SHARED = ("where", "holds if", "published")


def claims_table(claims: Sequence[Claim]) -> Table:
    """One line per claim and case."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for name in ("claim", "case", "measured", "held in", "holds"):
        table.add_column(name, overflow="fold", no_wrap=name in ("held in", "holds"))
    for claim in claims:
        verdict = Text("yes", style="bold green") if claim.holds else Text("no", style="bold red")
        table.add_row(Text(claim.claim), Text(claim.scope), Text(claim.measured), f"{claim.holding} of {claim.cases}", verdict)
    return table


def claims_markdown(claims: Sequence[Claim]) -> str:
    """One table per topic, in Markdown; what all of its lines share stands above it."""
    topics: dict[str, list[Claim]] = {}
    for claim in claims:
        topics.setdefault(claim.topic, []).append(claim)
    return "\n".join(_topic_markdown(topic, lines) for topic, lines in topics.items())


def _topic_markdown(topic: str, claims: Sequence[Claim]) -> str:
    columns = {
        "claim": [claim.claim for claim in claims],
        "where": [claim.where for claim in claims],
        "case": [claim.scope for claim in claims],
        "measured": [claim.measured for claim in claims],
        "holds if": [claim.threshold for claim in claims],
        "held in": [f"{claim.holding} of {claim.cases}" for claim in claims],
        "holds": ["yes" if claim.holds else "**no**" for claim in claims],
        "published": [claim.published for claim in claims],
    }
    shared = {name: cells[0] for name, cells in columns.items() if name in _SHARED and len(set(cells)) == 1}
    shown = {name: cells for name, cells in columns.items() if name not in shared}
    text = "; ".join(f"{name if name == 'holds if' else ''} {cell}".strip() for name, cell in shared.items() if cell)
    lines = [f"**{topic[:1].upper()}{topic[1:]}**" + (f" ({text})" if text else ""), ""]
    lines += ["| " + " | ".join(shown) + " |", "|" + "---|" * len(shown)]
    lines += ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in zip(*shown.values(), strict=True)]
    return "\n".join([*lines, ""])
