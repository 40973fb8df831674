"""A decision: the chosen action, the ranking behind it, and the certificate of what another choice could gain."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from topobelief.arrays import FloatArray, IntArray, ReadOnlyArrays, frozen_floats, frozen_ints
from topobelief.errors import InvalidInputError
from topobelief.io.json_values import without_nan

SCHEMA = "topobelief.decision/2"

_SIGNATURE_NAMES = {
    "spanning_trees": "spanning trees",
    "von_neumann": "von Neumann entropy",
    "von_neumann_approx": "von Neumann entropy by degrees",
    "resistance": "effective resistance",
}


@dataclass(frozen=True, slots=True)
class Candidate:
    """What a person wants to know of an action besides its entropy."""

    label: str
    num_new_poses: int
    num_closures: int
    length: float  # metres, of the path that the robot drives
    cost: float  # in the objective's unit


@dataclass(frozen=True, eq=False)
class Decision(ReadOnlyArrays):
    """The outcome of `Planner.decide` over K actions.

    Attributes
    ----------
    best : int
        The chosen action: the first of the ranking, or the one of least J once evaluated.
    ranking : shape (K,), int
        All K actions, best signature first (signature - cost where the signature has the objective's unit: spanning trees for
        entropies, resistance for the expected error), compared to 32 binary digits; ties by index.
    signatures : shape (K,)
        Raw signatures.
    lower, upper : shape (K,)
        Bounds of the objective plus cost, in `unit`, widened by their rounding errors; after an exact evaluation both are that
        value widened by its error. nan where not computed.
    entropies : shape (K,)
        Exact objective, cost excluded; nan where not evaluated.
    survivors : shape (number of survivors,), int
        Actions that may still be optimal, in ranking order; the first of the ranking is always among them.
    error_bound : float
        No action is better than the best by more than this, in `unit`; inf where no bounds were asked for.
    margin_met : bool or None
        Whether the upper bound of the best lies below the margin; None where no margin was given.
    num_evaluations : int
        Exact evaluations made; actions that add the same poses and measurements share one.
    proven_optimal : bool
    candidates : tuple of Candidate
    objective, signature, bounds, determinant : str
        As given to the planner.
    unit : str
        Of the objective, its bounds, costs and margins: "nats", or "m" for the expected error.
    """

    best: int
    ranking: IntArray
    signatures: FloatArray
    lower: FloatArray
    upper: FloatArray
    entropies: FloatArray
    survivors: IntArray
    error_bound: float
    margin_met: bool | None
    num_evaluations: int
    proven_optimal: bool
    candidates: tuple[Candidate, ...]
    objective: str
    signature: str
    bounds: str
    determinant: str
    unit: str = "nats"

    def __post_init__(self) -> None:
        for name in ("signatures", "lower", "upper", "entropies"):
            object.__setattr__(self, name, frozen_floats(getattr(self, name), name=name))
        for name in ("ranking", "survivors"):
            object.__setattr__(self, name, frozen_ints(getattr(self, name), name=name))

    @property
    def num_actions(self) -> int:
        """K."""
        return len(self.candidates)

    def name(self, action: int) -> str:
        """What to call an action: its label, else its index."""
        return self.candidates[action].label or f"action {action}"

    def summary(self) -> str:
        """The decision in a few sentences."""
        candidate, total = self.candidates[self.best], self.num_actions
        poses = f"{candidate.num_new_poses} new poses, " if candidate.num_new_poses else ""
        first = self.name(self.best)
        of_total = f" of {total}" if total > 1 else ""
        sentences = [
            f"{first[:1].upper()}{first[1:]}{of_total} ({candidate.length:.1f} m, {poses}"
            f"{candidate.num_closures} loop closures) {self._claim()}"
        ]
        ruled_out = total - len(self.survivors)
        if self.margin_met is not None:
            sentences.append(
                f"Its upper bound, {_value(self.upper[self.best], self.unit)}, "
                f"{'is below' if self.margin_met else 'misses'} the margin."
            )
        elif not self.proven_optimal and math.isfinite(self.error_bound):
            sentences.append(
                f"No candidate can be better by more than {_readable(self.error_bound, self.unit)}"
                f"{' per pose' if self.objective == 'per_pose' else ''}; "
                f"{ruled_out} {'was' if ruled_out == 1 else 'were'} ruled out by bounds."
            )
        elif self.proven_optimal and total > 1:
            count, spared = self.num_evaluations, int(np.isnan(self.entropies).sum())
            spared = f"; bounds ruled out the other {spared}" if count and spared else ""
            evaluated = f"{count} exact evaluation{'s' if count > 1 else ''}" if count else "bounds alone"
            sentences.append(f"That is proven by {evaluated}{spared}.")
        return " ".join(sentences)

    @property
    def objective_in_words(self) -> str:
        """ "map entropy", "expected error of the map" and the like."""
        return "expected error of the map" if self.unit == "m" else f"{self.objective} entropy"

    def _claim(self) -> str:
        if self.num_actions == 1:
            return "is the only candidate: there is nothing to choose from."
        by = _SIGNATURE_NAMES.get(self.signature, self.signature)
        if self.proven_optimal:
            return f"is optimal ({self.objective_in_words})."
        if self.num_evaluations:
            return f"has the least {self.objective_in_words} of the {self.num_evaluations} evaluated."
        return f"is the best by {by}."

    def __str__(self) -> str:
        """Summary and table; an expected error in centimetres there."""
        scale, unit = (100.0, " (cm)") if self.unit == "m" else (1.0, "")
        signature = 100.0 if self.signature == "resistance" else 1.0
        numbers = (*(f"{name}{unit}" for name in ("lower", "upper", "exact")), "poses", "closures", "length", "survives")
        header = ("rank", "action", "signature (cm)" if signature > 1 else "signature", *numbers)
        surviving = set(self.survivors.tolist())
        rows: list[tuple[str, ...]] = [header]
        ranking: list[int] = self.ranking.tolist()
        for rank, action in enumerate(ranking, start=1):
            c = self.candidates[action]
            known = (scale * array[action] for array in (self.lower, self.upper, self.entropies))
            values = (signature * self.signatures[action], *known)
            rows.append(
                (
                    str(rank),
                    self.name(action),
                    *("-" if math.isnan(value) else f"{value:.2f}" for value in values),
                    str(c.num_new_poses),
                    str(c.num_closures),
                    f"{c.length:.1f}",
                    "best" if action == self.best else "yes" if action in surviving else "no",
                )
            )
        widths = [max(len(row[column]) for row in rows) for column in range(len(header))]
        lines = ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
        return "\n".join([self.summary(), "", *lines])

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON. What is not known (nan, or an infinite bound) is None; actions come by index."""
        return {
            "schema": SCHEMA,
            "best": self.best,
            "objective": self.objective,
            "signature": self.signature,
            "bounds": self.bounds,
            "determinant": self.determinant,
            "unit": self.unit,
            "error_bound": without_nan(self.error_bound),
            "margin_met": self.margin_met,
            "num_evaluations": self.num_evaluations,
            "proven_optimal": self.proven_optimal,
            "ranking": self.ranking.tolist(),
            "survivors": self.survivors.tolist(),
            "actions": [
                {
                    "index": index,
                    "label": candidate.label,
                    "num_new_poses": candidate.num_new_poses,
                    "num_closures": candidate.num_closures,
                    "length": candidate.length,
                    "cost": candidate.cost,
                    "signature": without_nan(self.signatures[index]),
                    "lower": without_nan(self.lower[index]),
                    "upper": without_nan(self.upper[index]),
                    "entropy": without_nan(self.entropies[index]),
                }
                for index, candidate in enumerate(self.candidates)
            ],
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Decision:
        """The decision that `to_dict` described.

        Raises
        ------
        InvalidInputError
            Where the schema is another one or a field is missing.
        """
        schema = data.get("schema") if isinstance(data, Mapping) else data  # pyright: ignore[reportUnnecessaryIsInstance]
        if schema != SCHEMA:
            raise InvalidInputError(f'expected a decision of schema "{SCHEMA}", got {schema!r}')
        try:
            actions: Sequence[Mapping[str, Any]] = data["actions"]
            columns = {
                name: np.array([_from_json(action[key], unknown=math.nan) for action in actions])
                for name, key in (
                    ("signatures", "signature"),
                    ("lower", "lower"),
                    ("upper", "upper"),
                    ("entropies", "entropy"),
                )
            }
            candidates = tuple(
                Candidate(a["label"], a["num_new_poses"], a["num_closures"], a["length"], a["cost"]) for a in actions
            )
            return cls(
                best=data["best"],
                ranking=np.array(data["ranking"], dtype=np.int64),
                survivors=np.array(data["survivors"], dtype=np.int64),
                error_bound=_from_json(data["error_bound"], unknown=math.inf),
                margin_met=data["margin_met"],
                num_evaluations=data["num_evaluations"],
                proven_optimal=data["proven_optimal"],
                candidates=candidates,
                objective=data["objective"],
                signature=data["signature"],
                bounds=data["bounds"],
                determinant=data["determinant"],
                unit=data.get("unit", "nats"),
                **columns,
            )
        except KeyError as error:
            raise InvalidInputError(f"expected a decision with the field {error}, got none") from None
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"expected a decision as to_dict writes it, got one with a bad value: {error}") from None


def _readable(value: float, unit: str) -> str:
    """Two digits below ten, whole numbers above a hundred; lengths below a metre in centimetres."""
    if unit == "m" and value < 1:
        value, unit = 100 * value, "cm"
    number = f"{value:.0f}" if value >= 100 else f"{value:.1f}" if value >= 1 else f"{value:.2g}"
    return f"{number} {unit}"


def _value(value: float, unit: str) -> str:
    """With one decimal; lengths in centimetres."""
    return f"{100 * value:.1f} cm" if unit == "m" else f"{value:.1f} {unit}"


def _from_json(value: float | None, *, unknown: float) -> float:
    return unknown if value is None else float(value)
