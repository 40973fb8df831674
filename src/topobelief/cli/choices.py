"""Options whose choices are the planner's registry."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import typer


def one_of(names: Iterable[str]) -> Callable[[str | None], str | None]:
    """A callback that lets one of these names through, and None where none is given."""
    known = tuple(names)

    def checked(value: str | None) -> str | None:
        if value is not None and value not in known:
            raise typer.BadParameter(f"{value!r} is not one of {', '.join(map(repr, known))}.")
        return value

    return checked


def completed(names: Iterable[str]) -> Callable[[str], list[str]]:
    """What a shell may complete."""
    known = tuple(names)
    return lambda incomplete: [name for name in known if name.startswith(incomplete)]
