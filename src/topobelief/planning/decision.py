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
}


@dataclass(frozen=True, slots=True)
class Candidate:
    """What a person wants to know of an action besides its entropy."""

    label: str
    num_new_poses: int
    num_closures: int
    length: float  # metres, of the path that the robot drives
    cost: float  # nats


@dataclass(frozen=True, eq=False)
class Decision(ReadOnlyArrays):
    """The outcome of `Planner.decide` over K actions.

    Attributes
    ----------
    best : int
        The chosen action: the first of the ranking, or the one of least J once evaluated.
    ranking : shape (K,), int
        All K actions, best signature first (signature - cost for spanning trees), compared to 32 binary digits; ties by index.
    signatures : shape (K,)
        Raw signatures.
    lower, upper : shape (K,)
        Bounds of the objective plus cost, nats, widened by their rounding errors; after an exact evaluation both are that
        value widened by its error. nan where not computed.
    entropies : shape (K,)
        Exact objective, cost excluded; nan where not evaluated.
    survivors : shape (number of survivors,), int
        Actions that may still be optimal, in ranking order; the first of the ranking is always among them.
    error_bound : float
        No action is better than the best by more than this, nats; inf where no bounds were asked for.
    margin_met : bool or None
        Whether the upper bound of the best lies below the margin; None where no margin was given.
    num_evaluations : int
        Exact evaluations made; actions that add the same poses and measurements share one.
    proven_optimal : bool
    candidates : tuple of Candidate
    objective, signature, bounds, determinant : str
        As given to the planner.
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
        unit = " per pose" if self.objective == "per_pose" else ""
        ruled_out = total - len(self.survivors)
        if self.margin_met is not None:
            sentences.append(
                f"Its upper bound, {self.upper[self.best]:.1f} nats, {'is below' if self.margin_met else 'misses'} the margin."
            )
        elif not self.proven_optimal and math.isfinite(self.error_bound):
            sentences.append(
                f"No candidate can be better by more than {_readable(self.error_bound)} nats{unit}; "
                f"{ruled_out} {'was' if ruled_out == 1 else 'were'} ruled out by bounds."
            )
        elif self.proven_optimal and total > 1:
            count, skipped = self.num_evaluations, int(np.isnan(self.entropies).sum())
            skipped = f"; bounds ruled out the other {skipped}" if count and skipped else ""
            evaluated = f"{count} exact evaluation{'s' if count > 1 else ''}" if count else "bounds alone"
            sentences.append(f"That is proven by {evaluated}{skipped}.")
        return " ".join(sentences)

    def _claim(self) -> str:
        if self.num_actions == 1:
            return "is the only candidate: there is nothing to choose from."
        by = _SIGNATURE_NAMES.get(self.signature, self.signature)
        if self.proven_optimal:
            return f"is optimal ({self.objective} entropy)."
        if self.num_evaluations:
            return f"has the least {self.objective} entropy of the {self.num_evaluations} evaluated."
        return f"is the best by {by}."

    def __str__(self) -> str:
        header = ("rank", "action", "signature", "lower", "upper", "exact", "poses", "closures", "length", "survives")
        surviving = set(self.survivors.tolist())
        rows: list[tuple[str, ...]] = [header]
        ranking: list[int] = self.ranking.tolist()
        for rank, action in enumerate(ranking, start=1):
            c = self.candidates[action]
            numbers = (self.signatures[action], self.lower[action], self.upper[action], self.entropies[action])
            rows.append(
                (
                    str(rank),
                    self.name(action),
                    *("-" if math.isnan(value) else f"{value:.2f}" for value in numbers),
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
                **columns,
            )
        except KeyError as error:
            raise InvalidInputError(f"expected a decision with the field {error}, got none") from None
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"expected a decision as to_dict writes it, got one with a bad value: {error}") from None


def _readable(nats: float) -> str:
    """Two digits below ten, whole nats above a hundred."""
    return f"{nats:.0f}" if nats >= 100 else f"{nats:.1f}" if nats >= 1 else f"{nats:.2g}"


def _from_json(value: float | None, *, unknown: float) -> float:
    return unknown if value is None else float(value)
