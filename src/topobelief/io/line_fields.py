"""Fields of a line of text as whole ids and numbers."""

from __future__ import annotations

from topobelief.errors import FileError
from topobelief.io.files import StrPath

_ID_LIMIT = 2**63  # ids are kept as signed 64-bit integers


def parsed_fields(
    path: StrPath, tag: str, fields: list[str], num_ids: int, line: str, number: int
) -> tuple[list[int], list[float]]:
    """Ids and the numbers after them.

    Parameters
    ----------
    path
    tag
        Of the line.
    fields
        What stands after it.
    num_ids
        How many of them are ids.
    line, number
        The line itself and its number, for errors.

    Raises
    ------
    FileError
        For what is no number, and for ids that are not whole, or out of range.
    """
    try:
        numbers = [float(text) for text in fields[num_ids:]]
        ids = _whole_numbers(fields[:num_ids])
        plain = line.isascii() and line.count("_") == tag.count("_")  # float takes other digits, and 1_000
    except ValueError:
        ids, numbers, plain = [], [], False
    if not plain and (wrong := next((text for text in fields if not _is_number(text)), None)) is not None:
        raise FileError(path, f"expected a number for {tag}, got {wrong[:40]!r}", line=number)
    if ids and (min(ids) < 0 or max(ids) >= _ID_LIMIT):
        wrong = next(text for text, value in zip(fields, ids, strict=False) if not 0 <= value < _ID_LIMIT)
        message = f"expected whole ids from 0 to 2^63 - 1 for {tag}, got {wrong[:40]}; renumber the poses"
        raise FileError(path, message, line=number)
    return ids, numbers


def _whole_numbers(texts: list[str]) -> list[int]:
    """The whole numbers that texts are; -1 in place of other numbers."""
    try:
        return [int(text) for text in texts]
    except ValueError:
        return [_whole_number(text) for text in texts]


def _whole_number(text: str) -> int:
    """As `_whole_numbers`, for one that may be written as 1e3 or 5.0."""
    try:
        return int(text)
    except ValueError:
        number = float(text)
        return int(number) if number.is_integer() else -1


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return text.isascii() and "_" not in text
