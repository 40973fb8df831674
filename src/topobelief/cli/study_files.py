"""What `topobelief study-report` writes: pictures, and every number of them as CSV or JSON."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Sequence
from pathlib import Path

from topobelief.cli.plan_files import write_together
from topobelief.report.canvas import save_figure
from topobelief.report.study_figures import FIGURES
from topobelief.study.summary import Summary, flat


def write(folder: Path, found: Sequence[Summary]) -> list[str]:
    """Draw and write everything, all or nothing; the names of the files.

    Raises
    ------
    FileError
        If the folder cannot be made or a file not be written.
    """
    writers: dict[str, Callable[[Path], object]] = {}
    for name, draw in FIGURES.items():
        figure = draw(found)
        for suffix in (".png", ".pdf"):
            writers[name + suffix] = lambda path, figure=figure: save_figure(figure, path)
    text = _csv(found)
    writers["summary.csv"] = lambda path: path.write_text(text, encoding="utf-8", newline="")
    write_together(folder, writers)
    return list(writers)


def document(found: Sequence[Summary]) -> dict[str, object]:
    """For JSON, where no value is null."""
    lines = [flat(summary) for summary in found]
    return {
        "groups": [
            {name: None if isinstance(value, float) and math.isnan(value) else value for name, value in line.items()}
            for line in lines
        ]
    }


def _csv(found: Sequence[Summary]) -> str:
    lines = [flat(summary) for summary in found]
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(lines[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return text.getvalue()
