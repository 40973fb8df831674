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


def closures_in_words(number: int, expected: float, noun: str = "closure") -> str:
    """How many closures there may be, and how many are expected where these are fewer than nineteen in twenty.

    Examples
    --------
    >>> closures_in_words(12, 12.0), closures_in_words(40, 2.3)
    ('12 closures', '2.3 of 40 possible closures')
    """
    if expected >= 0.95 * number:
        return counted(number, noun)
    return f"{expected:.1f} of {counted(number, f'possible {noun}')}"
