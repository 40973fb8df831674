"""What `topobelief simulate-compare` leaves behind, and how it continues what is there."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from topobelief.cli.plan_files import write_together
from topobelief.errors import FileError
from topobelief.io.files import read_text, write_text
from topobelief.io.json_values import without_nan
from topobelief.report.canvas import save_figure
from topobelief.report.simulation_figures import draw_comparison
from topobelief.simulation.comparison import ComparedRun, summarised
from topobelief.simulation.strategy_comparison import ComparisonTask, played, read_runs, write_runs

_TASK_FILE, _RUNS_FILE = "task.json", "comparison.csv"


def compared(
    task: ComparisonTask, num_seeds: int, folder: Path, *, num_workers: int, on_progress: Callable[[int, int], None]
) -> list[ComparedRun]:
    """All runs of the seeds, those in the folder taken as they are; written after each seed.

    Raises
    ------
    FileError
        Where the folder holds another comparison.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _require_same(task, folder / _TASK_FILE)
    path = folder / _RUNS_FILE
    runs = [run for run in read_runs(path) if run.seed < num_seeds] if path.exists() else []
    done = {run.seed for run in runs}
    rest = [seed for seed in range(num_seeds) if seed not in done]
    on_progress(len(done), num_seeds)
    for found in played(task, rest, num_workers=num_workers):
        runs += found
        write_runs(path, runs)
        on_progress(num_seeds - len(rest) + len({run.seed for run in runs} - done), num_seeds)
    return sorted(runs, key=lambda run: (run.seed, task.strategies.index(run.strategy)))


def _require_same(task: ComparisonTask, path: Path) -> None:
    text = json.dumps(task.described(), indent=2) + "\n"
    if path.exists() and read_text(path) != text:
        raise FileError(path, "expected the same comparison to continue, got another one; choose another --out")
    write_text(path, text)


def document(task: ComparisonTask, runs: list[ComparedRun]) -> dict[str, object]:
    """For JSON; None stands for what is not a number."""
    found = summarised(runs, baseline=task.strategies[0])
    return {
        "task": task.described(),
        "strategies": [without_nan(asdict(each)) for each in found],
        "runs": [without_nan(asdict(run)) for run in runs],
    }


def write(folder: Path, task: ComparisonTask, runs: list[ComparedRun]) -> None:
    """The summary and the picture."""
    figure = draw_comparison(runs, baseline=task.strategies[0])
    text = json.dumps(document(task, runs), indent=2, allow_nan=False) + "\n"
    write_together(
        folder,
        {
            "comparison.json": lambda path: path.write_text(text, encoding="utf-8"),
            "comparison.png": lambda path: save_figure(figure, path),
        },
    )
