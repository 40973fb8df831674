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
from topobelief.planning.decision_table import as_html, as_text, decision_table
from topobelief.planning.registry import ALL_OBJECTIVES, SIGNATURE_WORDS, chosen
from topobelief.planning.units import quantity, shown_factor, shown_unit
from topobelief.wording import closures_in_words

SCHEMA = "topobelief.decision/2"


@dataclass(frozen=True, slots=True)
class Candidate:
    """What a person wants to know of an action besides its entropy."""

    label: str
    num_new_poses: int
    num_closures: int
    length: float  # metres, of the path that the robot drives
    cost: float  # in the unit of the objective
    expected_closures: float = math.nan  # by their probabilities; nan: all are certain
    num_observations: int = 0  # of landmarks
    expected_observations: float = math.nan

    def closures(self, noun: str = "closure") -> str:
        """How many closures it has, and how many are expected, in words: "6.9 of 87 possible closures"."""
        certain = math.isnan(self.expected_closures)
        return closures_in_words(self.num_closures, float(self.num_closures) if certain else self.expected_closures, noun)

    def observations(self) -> str:
        """The same of observations of landmarks, to be added: ", 20.4 of 52 possible observations"; nothing without any."""
        if not self.num_observations:
            return ""
        expected = float(self.num_observations) if math.isnan(self.expected_observations) else self.expected_observations
        return f", {closures_in_words(self.num_observations, expected, 'observation')}"


@dataclass(frozen=True, eq=False, repr=False)
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
    exact_bounds : bool
        Whether the exact values of all actions were computed in place of bounds, because they cost no more.
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
    exact_bounds: bool = False

    def __post_init__(self) -> None:
        for name in ("signatures", "lower", "upper", "entropies"):
            object.__setattr__(self, name, frozen_floats(getattr(self, name), name=name))
        for name in ("ranking", "survivors"):
            object.__setattr__(self, name, frozen_ints(getattr(self, name), name=name))

    @property
    def num_actions(self) -> int:
        """K."""
        return len(self.candidates)

    @property
    def unit(self) -> str:
        """Of the objective, its bounds, costs and `error_bound`: "nats", "nats per pose" or "m"."""
        return chosen(ALL_OBJECTIVES, self.objective).unit

    @property
    def quantity(self) -> str:
        """What is minimised, in words: "map entropy"."""
        return chosen(ALL_OBJECTIVES, self.objective).quantity

    @property
    def description(self) -> str:
        """What is minimised, where there is room: "entropy of the poses that exist now, after the action"."""
        return chosen(ALL_OBJECTIVES, self.objective).description

    def name(self, action: int) -> str:
        """What to call an action: its label, else its index."""
        return self.candidates[action].label or f"action {action}"

    def summary(self) -> str:
        """The decision in a few sentences."""
        candidate, total = self.candidates[self.best], self.num_actions
        poses = f"{candidate.num_new_poses} new poses, " if candidate.num_new_poses else ""
        first = self.name(self.best)
        of_total = f" of {total}" if total > 1 else ""
        facts = f"{candidate.length:.1f} m, {poses}{candidate.closures('loop closure')}{candidate.observations()}"
        sentences = [f"{first[:1].upper()}{first[1:]}{of_total} ({facts}) {self._claim()}"]
        ruled_out = total - len(self.survivors)
        if self.margin_met is not None:
            upper = f"{self.upper[self.best] * shown_factor(self.unit):.1f} {shown_unit(self.unit)}"
            sentences.append(f"Its upper bound, {upper}, {'is below' if self.margin_met else 'misses'} the margin.")
        elif not self.proven_optimal and math.isfinite(self.error_bound):
            sentences.append(
                f"No candidate can be better by more than {quantity(self.error_bound, self.unit)}; "
                f"{ruled_out} {'was' if ruled_out == 1 else 'were'} ruled out by bounds."
            )
        elif self.exact_bounds and not np.isnan(self.entropies).any() and total > 1:
            sentences.append(f"The exact values of all {total} were computed, since they cost no more than bounds.")
        elif self.proven_optimal and total > 1:
            count, skipped = self.num_evaluations, int(np.isnan(self.entropies).sum())
            skipped = f"; bounds ruled out the other {skipped}" if count and skipped else ""
            bounds = "bounds, which here are the exact values" if self.exact_bounds else "bounds alone"
            evaluated = f"{count} exact evaluation{'s' if count > 1 else ''}" if count else bounds
            sentences.append(f"That is proven by {evaluated}{skipped}.")
        return " ".join(sentences)

    def _claim(self) -> str:
        if self.num_actions == 1:
            return "is the only candidate: there is nothing to choose from."
        if self.proven_optimal:
            return f"is optimal ({self.quantity})."
        if self.num_evaluations:
            return f"has the least {self.quantity} of the {self.num_evaluations} evaluated."
        return f"is the best by {SIGNATURE_WORDS.get(self.signature, self.signature)}."

    def __repr__(self) -> str:
        """The choice and what is known of it; `str` is the table."""
        if self.proven_optimal or math.isinf(self.error_bound):
            known = "proven optimal" if self.proven_optimal else "without bounds"
        else:
            known = f"at most {quantity(self.error_bound, self.unit)} from the best"
        return f"Decision({self.name(self.best)} of {self.num_actions}, {known})"

    def __str__(self) -> str:
        return f"{self.summary()}\n\n{as_text(decision_table(self))}"

    def _repr_html_(self) -> str:
        return as_html(decision_table(self), self.summary())

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
            "exact_bounds": self.exact_bounds,
            "ranking": self.ranking.tolist(),
            "survivors": self.survivors.tolist(),
            "actions": [
                {
                    "index": index,
                    "label": candidate.label,
                    "num_new_poses": candidate.num_new_poses,
                    "num_closures": candidate.num_closures,
                    "length": candidate.length,
                    "expected_closures": without_nan(candidate.expected_closures),
                    "num_observations": candidate.num_observations,
                    "expected_observations": without_nan(candidate.expected_observations),
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
                Candidate(
                    a["label"],
                    a["num_new_poses"],
                    a["num_closures"],
                    a["length"],
                    a["cost"],
                    _from_json(a.get("expected_closures"), unknown=math.nan),
                    a.get("num_observations", 0),
                    _from_json(a.get("expected_observations"), unknown=math.nan),
                )
                for a in actions
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
                exact_bounds=bool(data.get("exact_bounds", False)),
                **columns,
            )
        except KeyError as error:
            raise InvalidInputError(f"expected a decision with the field {error}, got none") from None
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"expected a decision as to_dict writes it, got one with a bad value: {error}") from None


def _from_json(value: float | None, *, unknown: float) -> float:
    return unknown if value is None else float(value)
