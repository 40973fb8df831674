"""Frozen rows of numbers and names: as CSV, and as values for JSON that come back to the last bit."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, fields
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast, get_type_hints

from topobelief.errors import FileError
from topobelief.io.files import write_text

R = TypeVar("R")


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
    writer.writerow(_types(kind))
    writer.writerows(asdict(row).values() for row in cast("Sequence[Any]", rows))
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


def json_rows(rows: Iterable[object]) -> list[dict[str, object]]:
    """Rows as JSON can hold them: numbers that are not finite become "nan", "inf" and "-inf"."""
    return [{name: _plain(parse(getattr(row, name))) for name, parse in _types(type(row)).items()} for row in rows]


def rows_of_json(kind: type[R], values: Iterable[dict[str, Any]]) -> list[R]:
    """The rows of which `json_rows` made these values.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True)
    ... class Distance:
    ...     name: str
    ...     metres: float
    >>> json_rows([Distance("a", float("inf"))])
    [{'name': 'a', 'metres': 'inf'}]
    >>> rows_of_json(Distance, [{"name": "a", "metres": "inf"}])
    [Distance(name='a', metres=inf)]
    """
    return [kind(**{name: parse(value[name]) for name, parse in _types(kind).items()}) for value in values]


@lru_cache
def _types(kind: type) -> dict[str, Callable[[Any], Any]]:
    """The fields and their types, which parse."""
    hints = get_type_hints(kind)
    return {field.name: hints[field.name] for field in fields(kind)}


def _plain(value: object) -> object:
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value
