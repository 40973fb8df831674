"""Frozen rows of numbers and names as CSV, and back to the last bit."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from topobelief.errors import FileError
from topobelief.io.files import read_text, write_text

R = TypeVar("R")

_PARSERS: dict[type, Any] = {int: int, float: float, str: str, bool: {"True": True, "False": False}.__getitem__}


def csv_text(kind: type[R], rows: Sequence[R]) -> str:
    """A header with the names of the fields, then a line a row.

    Parameters
    ----------
    kind
        A dataclass whose fields are int, float, str or bool.
    rows
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(_names(kind))
    writer.writerows(asdict(row).values() for row in _as_any(rows))
    return stream.getvalue()


def write_rows(path: Path, kind: type[R], rows: Sequence[R]) -> None:
    """Write a whole file of rows, or nothing; its folder is made.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(path.parent, f"expected a folder to write to, got: {error.strerror}") from None
    write_text(path, csv_text(kind, rows))


def read_rows(path: Path, kind: type[R]) -> list[R]:
    """The rows that `write_rows` wrote.

    Raises
    ------
    FileError
        Names the line that is not such a row.
    """
    lines = list(csv.reader(io.StringIO(read_text(path))))
    names, types = _names(kind), get_type_hints(kind)
    if not lines or lines[0] != names:
        raise FileError(path, f"expected the columns {','.join(names)[:80]}…, got others; choose another --out", line=1)
    rows: list[R] = []
    for number, line in enumerate(lines[1:], start=2):
        try:
            rows.append(kind(**{name: _PARSERS[types[name]](text) for name, text in zip(names, line, strict=True)}))
        except (ValueError, KeyError):
            raise FileError(path, f"expected a row of {kind.__name__}, got {','.join(line)[:60]!r}", line=number) from None
    return rows


def _names(kind: type[Any]) -> list[str]:
    return [field.name for field in fields(kind)]


def _as_any(rows: Sequence[Any]) -> Sequence[Any]:
    return rows
