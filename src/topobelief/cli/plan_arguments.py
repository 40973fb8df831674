"""How the values of `topobelief plan`'s options are read from text, and refused."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import typer

from topobelief.errors import degrees_hint

_UNIFORM_STD = math.pi / math.sqrt(3)  # radians, of a heading of which nothing is known


@dataclass(frozen=True, slots=True)
class GivenPlace:
    """Where the robot is or shall be, as given: the id of a pose (12, or a symbol such as x3), or a place in metres."""

    pose_id: str | None = None
    place: tuple[float, ...] | None = None

    def __str__(self) -> str:
        return str(self.pose_id) if self.place is None else " ".join(f"{number:g}" for number in self.place)


def place(text: str) -> GivenPlace:
    """The id of a pose, or two or three numbers."""
    words = text.split()
    try:
        if len(words) == 1:
            if not re.fullmatch(r"-?\d+|[A-Za-z]{1,2}\d+", words[0]):
                raise ValueError
            return GivenPlace(pose_id=words[0])
        numbers = tuple(map(float, words))
        if len(numbers) in (2, 3) and all(map(math.isfinite, numbers)):
            return GivenPlace(place=numbers)
    except ValueError:
        pass
    raise typer.BadParameter(f"expected the id of a pose or X Y in metres, got {text!r}; in 3D give X Y Z.")


def corner(text: str) -> tuple[float, ...]:
    """Three numbers."""
    try:
        numbers = tuple(map(float, text.split()))
    except ValueError:
        numbers = ()
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise typer.BadParameter(f"expected three numbers X Y Z in metres, got {text!r}.")
    return numbers


def above_zero(value: float | None) -> float | None:
    """A finite number above 0."""
    if value is not None and not 0 < value < math.inf:
        raise typer.BadParameter(f"expected a number above 0, got {value:g}.")
    return value


def at_least_zero(value: float | None) -> float | None:
    """A finite number of at least 0."""
    if value is not None and not 0 <= value < math.inf:
        raise typer.BadParameter(f"expected a number of at least 0, got {value:g}.")
    return value


def angle(value: float | None) -> float | None:
    """Radians, at most pi."""
    return _radians(value, math.pi)


def field_of_view(value: float | None) -> float | None:
    """Radians, at most 2 pi."""
    return _radians(value, 2 * math.pi)


def probability(value: float | None) -> float | None:
    """Above 0 and at most 1."""
    if value is not None and not 0 < value <= 1:
        raise typer.BadParameter(f"expected a probability above 0 and at most 1, got {value:g}.")
    return value


def heading_noise(value: float | None) -> float | None:
    """Radians, at most those of a heading of which nothing is known."""
    return _radians(value, _UNIFORM_STD)


def _radians(value: float | None, largest: float) -> float | None:
    value = above_zero(value)
    if value is not None and value > largest:
        raise typer.BadParameter(f"expected at most {largest:.6g}, got {value:g}{degrees_hint(value)}.")
    return value


def detour(text: str) -> float:
    """The detour limit; infinite for "none" and 0."""
    try:
        limit = math.inf if text.lower() in ("none", "inf") else float(text)
    except ValueError:
        limit = math.nan
    if limit == 0:
        return math.inf
    if not limit >= 1:
        raise typer.BadParameter(f'expected a factor of at least 1, or "none", got {text!r}.')
    return limit
