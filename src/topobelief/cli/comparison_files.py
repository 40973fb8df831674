"""What `topobelief simulate-compare` writes once its seeds are driven."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from topobelief.cli.plan_files import write_together
from topobelief.io.json_values import without_nan
from topobelief.io.row_files import csv_text
from topobelief.planning.registry import unit_of
from topobelief.report.canvas import save_figure
from topobelief.report.simulation_figures import draw_comparison
from topobelief.simulation.comparison import ComparedRun
from topobelief.simulation.strategy_comparison import Comparison


def document(found: Comparison) -> dict[str, object]:
    """For JSON; None stands for what is not a number."""
    return {
        "task": found.task.described(),
        "unit": unit_of(found.task.options.objective),
        "strategies": [without_nan(asdict(each)) for each in found.summaries],
        "runs": [without_nan(asdict(run)) for run in found.runs],
        "failed": [{"seed": seed, "error": error} for seed, error in found.failed.items()],
    }


def write(folder: Path, found: Comparison) -> None:
    """The runs, the summary and the picture."""
    figure = draw_comparison(found.runs, found.summaries, baseline=found.task.strategies[0])
    summary, runs = json.dumps(document(found), indent=2, allow_nan=False) + "\n", csv_text(ComparedRun, found.runs)
    write_together(
        folder,
        {
            "comparison.json": lambda path: path.write_text(summary, encoding="utf-8"),
            "comparison.csv": lambda path: path.write_text(runs, encoding="utf-8", newline=""),
            "comparison.png": lambda path: save_figure(figure, path),
        },
    )
