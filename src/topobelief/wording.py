"""Numbers with their nouns, for messages and short descriptions."""

from __future__ import annotations


def counted(count: int, noun: str, plural: str = "") -> str:
    """A count with its noun, which has an s from two on unless its plural is given.

    Examples
    --------
    >>> counted(1, "pose"), counted(0, "edge"), counted(2, "class", "classes")
    ('1 pose', '0 edges', '2 classes')
    """
    return f"{count} {noun if count == 1 else plural or noun + 's'}"
