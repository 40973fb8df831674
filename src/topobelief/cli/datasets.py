"""`topobelief datasets`: public benchmark graphs, where their files are on this machine, and fetching them."""

from __future__ import annotations

from typing import Annotated

import typer


def datasets(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            help="Print the path of this one's file and nothing else; fetch it first if it is not here.",
            show_default="all",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """List public benchmark graphs and where their files are, or fetch one."""
    from dataclasses import asdict

    from topobelief.cli.console import Reporter
    from topobelief.io.datasets import DATASETS, find_dataset, folders
    from topobelief.io.fetching import fetch_dataset
    from topobelief.report.dataset_table import dataset_table

    reporter = Reporter(as_json=as_json)
    if name is not None:
        with reporter.stage("fetching") as show:
            path = str(fetch_dataset(name, on_progress=show))
        reporter.say(path)
        reporter.answer(asdict(DATASETS[name]) | {"path": path})
        return
    found = {dataset: find_dataset(dataset) for dataset in DATASETS.values()}
    reporter.say(dataset_table(found))
    reporter.say(
        "`topobelief datasets NAME` fetches a file that can be fetched. Others may be put into "
        + " or ".join(map(str, folders()))
        + "."
    )
    listed = [asdict(dataset) | {"path": None if path is None else str(path)} for dataset, path in found.items()]
    reporter.answer({"datasets": listed, "folders": [str(folder) for folder in folders()]})
