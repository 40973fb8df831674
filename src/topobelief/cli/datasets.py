"""`topobelief datasets`: public benchmark graphs, and where their files are on this machine."""

from __future__ import annotations

from typing import Annotated

import typer


def datasets(
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", help="Print the path of this one's file and nothing else.", show_default="all"),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """List public benchmark graphs, and where their files are; nothing is fetched."""
    from dataclasses import asdict

    from topobelief.cli.console import Reporter
    from topobelief.io.datasets import DATASETS, dataset_path, find_dataset, folders
    from topobelief.report.dataset_table import dataset_table

    reporter = Reporter(as_json=as_json)
    if name is not None:
        path = str(dataset_path(name))
        reporter.say(path)
        reporter.answer(asdict(DATASETS[name]) | {"path": path})
        return
    found = {dataset: find_dataset(dataset) for dataset in DATASETS.values()}
    reporter.say(dataset_table(found))
    reporter.say("Files that are not there may be put into " + " or ".join(map(str, folders())) + ".")
    listed = [asdict(dataset) | {"path": None if path is None else str(path)} for dataset, path in found.items()]
    reporter.answer({"datasets": listed, "folders": [str(folder) for folder in folders()]})
