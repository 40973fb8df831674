"""The list of public benchmark graphs, for a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rich import box
from rich.table import Table
from rich.text import Text

from topobelief.io.datasets import Dataset


def dataset_table(found: Mapping[Dataset, Path | None]) -> Table:
    """A row a data set, with the place of its file, or the name that the file must have and where it is published."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("name", no_wrap=True)
    for heading in ("poses", "edges"):
        table.add_column(heading, justify="right", no_wrap=True)
    for heading in ("space", "what it is", "what to know", "file"):
        table.add_column(heading, overflow="fold")
    for dataset, path in found.items():
        file = str(path) if path is not None else _absent(dataset)
        row = (dataset.name, str(dataset.num_poses), str(dataset.num_edges), dataset.space, dataset.source, dataset.note, file)
        table.add_row(*map(Text, row))
    return table


def _absent(dataset: Dataset) -> str:
    return f"not here, can be fetched: {dataset.file}" if dataset.address else f"not here: {dataset.file}, see {dataset.home}"
