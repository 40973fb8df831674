"""How numbers of an objective are shown: metres as centimetres, everything else as it is."""

from __future__ import annotations

import math

_SHOWN = {"m": ("cm", 100.0)}  # unit of the numbers -> (unit shown, how many of it)
UNKNOWN = "–"
"""What stands where there is no number."""


def shown_unit(unit: str) -> str:
    """The unit in which numbers of a unit are shown.

    Examples
    --------
    >>> shown_unit("m"), shown_unit("nats per pose")
    ('cm', 'nats per pose')
    """
    return _SHOWN.get(unit, (unit, 1.0))[0]


def shown_factor(unit: str) -> float:
    """What numbers of a unit are multiplied by where they are shown."""
    return _SHOWN.get(unit, (unit, 1.0))[1]


def cell(value: float, unit: str = "") -> str:
    """A number in a table, in the unit shown: two decimals, a dash where there is none.

    Examples
    --------
    >>> cell(0.1234, "m"), cell(-2.0, "nats"), cell(math.nan)
    ('12.34', '-2.00', '–')
    """
    return UNKNOWN if math.isnan(value) else f"{value * shown_factor(unit):.2f}"


def quantity(value: float, unit: str) -> str:
    """A positive number in a sentence, with its unit: two digits below ten, whole numbers above a hundred.

    Examples
    --------
    >>> quantity(0.0321, "m"), quantity(0.4567, "nats"), quantity(123.4, "nats per pose")
    ('3.2 cm', '0.46 nats', '123 nats per pose')
    """
    shown = value * shown_factor(unit)
    digits = f"{shown:.0f}" if shown >= 100 else f"{shown:.1f}" if shown >= 1 else f"{shown:.2g}"
    return f"{digits} {shown_unit(unit)}"
