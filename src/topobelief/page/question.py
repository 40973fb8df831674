"""What is asked on the page, as a value: read from the JSON of a request, and refused where it makes no sense."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

from topobelief.errors import InvalidInputError
from topobelief.planning.registry import AUTO, BOUNDS, OBJECTIVES

MOST_CANDIDATES = 200
LONGEST = 1e5  # metres
CLOSURES = ("learned", "paper")


@dataclass(frozen=True, slots=True)
class Question:
    """A question of the page.

    Attributes
    ----------
    goal
        x and y in metres; None: anywhere.
    return_to_start
        Without a goal: whether a trip ends where it begins.
    max_length
        Metres; None with a goal: what the situation allows for a detour.
    objective
        As for `Planner`.
    closures
        "learned" or "paper".
    candidates
        How many diverse paths to compare; 0: search the whole roadmap.
    bounds
        The family by which candidates are compared.
    """

    goal: tuple[float, float] | None
    return_to_start: bool
    max_length: float | None
    objective: str
    closures: str
    candidates: int
    bounds: str

    @classmethod
    def read(cls, document: object) -> Question:
        """A question from JSON.

        Raises
        ------
        InvalidInputError
            Names the field that is missing or wrong.
        """
        if not isinstance(document, dict):
            raise InvalidInputError(f"expected a question as a JSON object, got {type(document).__name__}")
        fields = cast("Mapping[str, Any]", document)
        goal, length = _place(fields.get("goal")), fields.get("max_length")
        limit = None if length is None else _number(length, "max_length", 0.0, LONGEST)
        if goal is None and limit is None:
            raise InvalidInputError("expected max_length in metres for a trip without a goal, got none")
        candidates = _number(fields.get("candidates", 0), "candidates", 0, MOST_CANDIDATES)
        if candidates and goal is None:
            raise InvalidInputError("expected a goal for a comparison of candidates, got none; search the roadmap instead")
        return cls(
            goal,
            goal is None and fields.get("return") is True,
            limit,
            _one_of(fields.get("objective", "error"), "objective", tuple(OBJECTIVES)),
            _one_of(fields.get("closures", "learned"), "closures", CLOSURES),
            int(candidates),
            _one_of(fields.get("bounds", AUTO), "bounds", (AUTO, *BOUNDS)),
        )

    def document(self) -> dict[str, object]:
        """As `read` takes it."""
        return {
            "goal": None if self.goal is None else list(self.goal),
            "return": self.return_to_start,
            "max_length": self.max_length,
            "objective": self.objective,
            "closures": self.closures,
            "candidates": self.candidates,
            "bounds": self.bounds,
        }


def _place(value: object) -> tuple[float, float] | None:
    if value is None:
        return None
    numbers = cast("list[object]", value) if isinstance(value, list) else []
    if len(numbers) != 2:
        raise InvalidInputError(f"expected goal as [x, y] in metres, or null, got {value!r:.60}")
    x, y = (_number(number, "goal", -LONGEST * 100, LONGEST * 100) for number in numbers)
    return x, y


def _number(value: object, name: str, least: float, most: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
        raise InvalidInputError(f"expected {name} as a number from {least:g} to {most:g}, got {value!r:.60}")
    return float(value)


def _one_of(value: object, name: str, known: tuple[str, ...]) -> str:
    if not isinstance(value, str) or value not in known:
        raise InvalidInputError(f"expected {name} as one of {', '.join(known)}, got {value!r:.60}")
    return value
