"""What `topobelief reproduce` leaves behind besides its tables: figures as PNG and PDF, claims.md,
entropy_or_error.md, beyond_candidates.md, report.html."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from topobelief.cli.plan_files import write_together
from topobelief.io.files import write_text
from topobelief.report.canvas import save_figure
from topobelief.report.reproduction.beyond_table import beyond_markdown
from topobelief.report.reproduction.choice_table import choices_markdown
from topobelief.report.reproduction.claims_table import claims_markdown
from topobelief.report.reproduction.figures import figures_of
from topobelief.report.reproduction.page import command, page
from topobelief.reproduction.run import Reproduction

SCHEMA = "topobelief.claims/1"


def write(folder: Path, found: Reproduction, tell: Callable[[str], None]) -> None:
    """Draw everything and write the page last.

    Parameters
    ----------
    folder
        Where the tables are.
    found
    tell
        Called with what is drawn next.

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    figures = figures_of(found)
    pictures: dict[str, bytes] = {}
    for figure in figures:
        tell(figure.name)
        drawn = figure.draw()
        names = [f"{figure.name}.{suffix}" for suffix in ("png", "pdf")]
        write_together(folder / "figures", {name: lambda path, drawn=drawn: save_figure(drawn, path) for name in names})
        pictures[figure.name] = (folder / "figures" / names[0]).read_bytes()
    write_text(folder / "claims.md", claims_markdown(found.claims))
    write_text(folder / "entropy_or_error.md", choices_markdown(found.choices))
    write_text(folder / "beyond_candidates.md", beyond_markdown(found.beyond))
    tell("the page")
    tables = sorted(path.stem for path in (folder / "tables").glob("*.csv"))
    write_text(folder / "report.html", page(found, figures, pictures, tables))


def document(found: Reproduction) -> dict[str, object]:
    """The claims, and what they were measured with."""
    return {
        "schema": SCHEMA,
        "command": command(found),
        "plan": found.plan.to_dict(),
        "machine": found.machine,
        "claims": [asdict(claim) for claim in found.claims],
    }
