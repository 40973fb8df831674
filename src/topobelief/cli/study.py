"""`topobelief study`: a grid of decisions, played on the cores of this machine or on a cluster; `study-report` draws them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from topobelief.cli.run_options import DEFAULT_TIMEOUT, RetryFailed, Timeout

if TYPE_CHECKING:
    from topobelief.runs.attempt import Executor


def study(
    specification_file: Annotated[Path, typer.Argument(metavar="SPEC", help="What to vary, .yaml.")],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Folder for the rows; an earlier study continues.", show_default="out/ and the name of SPEC"
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Number of processes on this machine.", show_default="one per core")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="A dask.distributed cluster, such as tcp://10.0.0.1:8786.")
    ] = None,
    timeout: Timeout = DEFAULT_TIMEOUT,
    retry_failed: RetryFailed = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the outcome as JSON and nothing else.")] = False,
) -> None:
    """Run a grid of worlds, sessions, noises, strategies, objectives and seeds.

    Each task's row lands whole in a Parquet dataset. Killed at any moment, the same command continues and repeats nothing.
    """
    if workers is not None and scheduler is not None:
        raise typer.BadParameter("expected one of --workers and --scheduler, got both.", param_hint="who plays")
    from topobelief.cli.console import Reporter

    reporter = Reporter(as_json=as_json)
    with reporter.stage("start-up"):
        from topobelief.cli.plan_files import checked_folder
        from topobelief.study.runner import run_study
        from topobelief.study.specification import read_specification
        from topobelief.study.tasks import tasks_of

    folder = out or Path("out") / specification_file.stem
    checked_folder(folder)
    with reporter.stage("reading"):
        tasks = tasks_of(read_specification(specification_file))
    executor = _executor(workers, scheduler, timeout or None)
    with reporter.run("playing", "tasks") as progress:
        outcome = run_study(tasks, folder, executor, retry_failed=retry_failed, on_progress=progress.update)
    earlier = outcome.num_tasks - outcome.num_done_now
    reporter.say(
        f"{folder}: {outcome.num_tasks} tasks, {outcome.num_done_now} of them now"
        + (f", {earlier} in earlier runs" if earlier else "")
    )
    if outcome.num_failed:
        first = f"; the first one now: {outcome.first_error}" if outcome.first_error else ""
        reporter.say(f"{outcome.num_failed} failed, see the column error{first}")
    reporter.say(f"Rows: {folder / 'rows'} (Parquet); table and pictures: topobelief study-report {folder}")
    reporter.answer(
        {
            "folder": str(folder),
            "num_tasks": outcome.num_tasks,
            "num_played": outcome.num_done_now,
            "num_failed": outcome.num_failed,
            "first_error": outcome.first_error,
        }
    )


def _executor(num_workers: int | None, scheduler: str | None, max_seconds: float | None) -> Executor:
    if scheduler is not None:
        from topobelief.runs.cluster import Cluster

        return Cluster(scheduler, max_seconds=max_seconds)
    from topobelief.runs.local_workers import LocalWorkers

    return LocalWorkers(num_workers, max_seconds=max_seconds)


def study_report(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Output of `topobelief study`, complete or not.")],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder for the pictures and summary.csv.", show_default="FOLDER/report"),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON and nothing else.")] = False,
) -> None:
    """Plot the results of a study: loss, ranking quality and time of each strategy."""
    from topobelief.cli.console import Reporter

    reporter = Reporter(as_json=as_json)
    with reporter.stage("start-up"):
        from topobelief.cli import study_files
        from topobelief.cli.plan_files import checked_folder
        from topobelief.report.study_tables import summary_table
        from topobelief.study.dataset import read_table
        from topobelief.study.summary import summaries

    target = out or folder / "report"
    with reporter.stage("reading"):
        found = summaries(read_table(folder))
    checked_folder(target)
    reporter.say(summary_table(found))
    with reporter.stage("pictures"):
        names = study_files.write(target, found)
    reporter.say(f"{target}: {', '.join(names)}")
    reporter.answer(study_files.document(found))
