"""The rows of a study as a Parquet dataset: a folder of files that is complete at every moment.

Files hold up to `ROWS_PER_FILE` rows. A new row goes into the last file that has room, which is written anew beside its place
and takes it at once: so a row is there or not, never twice and never in half, files stay few, and nothing is left to merge.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from topobelief.errors import FileError
from topobelief.io.files import atomic_file
from topobelief.optional import load
from topobelief.runs.attempt import Finished
from topobelief.study.rows import COLUMNS, KEY, UNREPEATABLE, ColumnType
from topobelief.study.session import Row
from topobelief.study.tasks import Task

ROWS_PER_FILE = 128

Table = Any
"""A pyarrow.Table, which has no types."""


class Dataset:
    """Rows in a folder, which is made with the first one.

    Parameters
    ----------
    folder
        Its `rows` holds the Parquet files and nothing else.

    Raises
    ------
    FileError
        If a file in it is not of a study, or a row is there twice.
    InvalidInputError
        If pyarrow is not installed.
    """

    def __init__(self, folder: Path) -> None:
        self._arrow = load("pyarrow", "study")
        self._folder = folder / "rows"
        self._files: dict[Path, list[Row]] = {}  # those with room
        self._status: dict[str, str] = {}
        self._task_of: dict[tuple[object, ...], str] = {}
        paths = sorted(self._folder.glob("[!.]*.parquet")) if self._folder.is_dir() else []
        self._next = 1 + max((int(path.stem.rpartition("-")[2]) for path in paths if path.stem[-6:].isdecimal()), default=-1)
        for path in paths:
            table = _read(path, self._arrow)
            for row in table.select(["task", "status", *KEY]).to_pylist():
                self._know(row, path)
            if table.num_rows < ROWS_PER_FILE:
                self._files[path] = table.to_pylist()

    def __len__(self) -> int:
        return len(self._status)

    def __contains__(self, task: str, /) -> bool:
        return task in self._status

    def failed(self, tasks: Iterable[str], /) -> int:
        """How many of the tasks have a row that says that they failed."""
        return sum(self._status.get(task) == "failed" for task in tasks)

    def require_no_other(self, tasks: Iterable[Task]) -> None:
        """Check that rows of the same combinations are rows of the same tasks.

        Raises
        ------
        FileError
            Where a row comes from another map, session or rule of the same name.
        """
        for task in tasks:
            stored = self._task_of.get(tuple(task.labels[name] for name in KEY))
            if stored not in (None, task.id):
                what = f"{task.session.name} in {task.world_name}"
                raise FileError(
                    self._folder,
                    f"expected rows of this study, got one of another map, session or rule for {what}; choose another --out",
                )

    def add(self, finished: Finished[Task, Row], /) -> None:
        """Write its row.

        Raises
        ------
        FileError
            If it cannot be written, or its task has a row.
        """
        row = row_of(finished)
        path = next(iter(self._files), self._folder / f"part-{self._next:06}.parquet")
        self._know(row, path)
        self._write(path, [*self._files.get(path, []), row])

    def drop_failed(self) -> None:
        """Forget the rows of tasks that failed, so that they are played again."""
        for path in sorted(self._folder.glob("[!.]*.parquet")):
            rows: list[Row] = _read(path, self._arrow).to_pylist()
            kept = [row for row in rows if row["status"] != "failed"]
            if len(kept) < len(rows):
                self._write(path, kept)
        for task in [task for task, status in self._status.items() if status == "failed"]:
            del self._status[task]
        self._task_of = {key: task for key, task in self._task_of.items() if task in self._status}

    def clear_remains(self) -> None:
        """Remove what a killed run was writing; only where no other run writes."""
        for path in self._folder.glob(".*.parquet"):
            path.unlink(missing_ok=True)

    def _know(self, row: Row, path: Path) -> None:
        task = str(row["task"])
        if task in self._status:
            raise FileError(path, f"expected one row a task, got a second one of {task}")
        self._status[task] = str(row["status"])
        self._task_of[tuple(row[name] for name in KEY)] = task

    def _write(self, path: Path, rows: list[Row]) -> None:
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(self._folder, f"expected a folder to write to, got: {error.strerror}") from None
        table = self._arrow.Table.from_pylist(rows, schema=_schema(self._arrow))
        with atomic_file(path) as temporary:
            load("pyarrow.parquet", "study").write_table(table, temporary)
        self._next = max(self._next, 1 + int(path.stem.rpartition("-")[2]))
        if len(rows) < ROWS_PER_FILE:
            self._files[path] = rows
        else:
            self._files.pop(path, None)


def row_of(finished: Finished[Task, Row]) -> Row:
    """All columns, null where there is nothing to say."""
    task, outcome = finished.task, finished.outcome
    row = dict.fromkeys(COLUMNS) | {"task": task.id, **task.labels, **(outcome.result or {})}
    return row | {"status": "failed" if finished.failed else "ok", "error": outcome.error, "attempts": finished.attempts}


def read_table(folder: Path) -> Table:
    """All rows, sorted by their combination, whatever the order in which they came.

    Raises
    ------
    FileError
        If the folder holds no study.
    """
    arrow = load("pyarrow", "study")
    paths = sorted((folder / "rows").glob("[!.]*.parquet"))
    if not paths:
        raise FileError(folder, "expected the folder of a study, got one without rows/*.parquet")
    table = arrow.concat_tables([_read(path, arrow) for path in paths])
    return table.sort_by([(name, "ascending") for name in (*KEY, "task")])


def repeatable(table: Table) -> Table:
    """The columns that are the same in every run of the same study."""
    return table.drop_columns(list(UNREPEATABLE))


def _read(path: Path, arrow: Any) -> Table:
    try:
        table = load("pyarrow.parquet", "study").read_table(path, partitioning=None)
    except (OSError, arrow.ArrowInvalid) as error:
        raise FileError(path, f"expected a Parquet file, got: {' '.join(str(error).split())}") from None
    if not table.schema.equals(_schema(arrow)):
        raise FileError(path, "expected the columns of a study by this version, got others; choose another folder")
    return table


def _schema(arrow: Any) -> Any:
    types: dict[ColumnType, Any] = {
        "text": arrow.string(),
        "whole": arrow.int64(),
        "number": arrow.float64(),
        "flag": arrow.bool_(),
        "numbers": arrow.list_(arrow.float64()),
    }
    return arrow.schema([(name, types[kind]) for name, kind in COLUMNS.items()])
