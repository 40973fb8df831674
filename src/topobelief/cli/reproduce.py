"""`topobelief reproduce`: every table and figure of the paper, its claims one by one, and one page with all of it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def reproduce(
    graph_files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[GRAPH]...", help="Real pose graphs to include, .g2o or .toro."),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Few seeds and small graphs, for a first look: under two minutes.")
    ] = False,
    seed: Annotated[int, typer.Option(help="First random seed; all others follow from it.", min=0)] = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Folder for the report; an earlier run continues.",
            show_default="out/reproduction, with --quick out/reproduction-quick",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the claims as JSON and nothing else.")] = False,
) -> None:
    """Run the experiments of the paper, say for each claim whether it holds, and write one report.

    Killed at any moment, the same command continues where it stopped. Some two minutes with --quick, about half an hour
    without, on two cores with nothing else to do. Needs the extras fast, gtsam and page.
    """
    from topobelief.cli.console import Reporter
    from topobelief.cli.extras import require_extras

    require_extras("fast", "gtsam", "page")
    reporter = Reporter(as_json=as_json)
    with reporter.stage("start-up"):
        from topobelief.cli import reproduction_files
        from topobelief.cli.plan_files import checked_folder
        from topobelief.report.reproduction.claims_table import claims_table
        from topobelief.reproduction.plan import ReproductionPlan
        from topobelief.reproduction.run import reproduce as run
        from topobelief.runs.local_workers import LocalWorkers

    folder = out or Path("out") / ("reproduction-quick" if quick else "reproduction")
    checked_folder(folder)
    files = tuple(graph_files or ())
    plan = ReproductionPlan.for_a_first_look(seed=seed, files=files) if quick else ReproductionPlan(seed=seed, files=files)
    try:
        with reporter.run("measuring", "parts") as progress:  # one part at a time, since most are timed
            found = run(plan, folder, LocalWorkers(1, one_thread=False), on_progress=progress.update)
    except KeyboardInterrupt:
        reporter.say(f"What was measured is in {folder}; the same command continues.")
        raise
    with reporter.activity("drawing") as tell:
        reproduction_files.write(folder, found, tell)
    reporter.say(claims_table(found.claims))
    holding = sum(claim.holds for claim in found.claims)
    reporter.say(
        f"{holding} of {len(found.claims)} lines hold as written, over {plan.num_seeds} seeds.",
        f"Report: {folder / 'report.html'}; figures and numbers: {folder / 'figures'}, {folder / 'tables'}",
        f"Took {reporter.time_taken()}",
    )
    reporter.answer(reproduction_files.document(found))
