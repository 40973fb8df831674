"""Signatures, bounds and exact values of a batch of actions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.bounds.options import BoundOptions
from topobelief.errors import IllConditionedError
from topobelief.forms.of_graph import GraphForms
from topobelief.forms.protocol import Forms
from topobelief.graph.action import Action
from topobelief.linalg.estimate import Estimate
from topobelief.objectives.objective import Objective
from topobelief.planning.engine import Engine
from topobelief.planning.registry import ALL_OBJECTIVES, FAMILIES, FOCUSED, SIGNATURE_UNITS, SIGNATURES, chosen
from topobelief.signatures.options import SignatureOptions

_may_overflow = np.errstate(over="ignore", divide="ignore", invalid="ignore")  # what is not finite is refused


@dataclass(frozen=True, slots=True)
class Criteria:
    """The criteria by which actions are judged, by name (see `registry`); parameters as for `topobelief.Planner`."""

    objective: str = "joint"
    signature: str = "spanning_trees"
    bounds: str = "fischer"
    options: BoundOptions = field(default_factory=BoundOptions)
    normalized: bool = False
    held: tuple[int, ...] = ()  # of the objective "focused"

    @property
    def objective_itself(self) -> Objective:
        """What the objective's name stands for."""
        found = chosen(ALL_OBJECTIVES, self.objective)
        return found(self.held) if self.objective == FOCUSED else found

    @property
    def families(self) -> Mapping[str, str]:
        """Families of bounds that the objective has, each with its place."""
        return FAMILIES[self.objective_itself.argument]

    @property
    def signature_estimates_objective(self) -> bool:
        """Whether the signature has the objective's unit, so that costs can be taken from it."""
        return SIGNATURE_UNITS.get(self.signature) == self.objective_itself.unit.partition(" ")[0]  # nats per pose are nats

    @property
    def needs_inverses(self) -> bool:
        """Whether the objective or the signature is a trace of an inverse: from scratch, hundreds of solutions an action."""
        return "m" in (self.objective_itself.unit, SIGNATURE_UNITS.get(self.signature))


class Batch:
    """Quantities of some actions, each computed when it is first asked for; forms that they share are computed once.

    Parameters
    ----------
    engine
    criteria
    actions
        Checked against the engine's graph.
    numbers
        What errors call them by. Default: their places.
    """

    def __init__(
        self, engine: Engine, criteria: Criteria, actions: Sequence[Action], numbers: Sequence[int] | None = None
    ) -> None:
        self._engine, self._criteria, self._actions = engine, criteria, actions
        self._numbers = range(len(actions)) if numbers is None else numbers
        self._groups = engine.groups(actions)
        self._alone: dict[int, GraphForms] = {}

    def signatures(self) -> Estimate[FloatArray]:
        """Raw signatures; the larger, the better."""
        signature = chosen(SIGNATURES, self._criteria.signature)
        options = SignatureOptions(self._criteria.objective_itself.trees, self._criteria.normalized)
        return Estimate(*self._evaluated(lambda forms: _pair(signature(forms, options))))

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """LB and UB of the objective, cost excluded, widened by their rounding errors; each of shape (K,).

        Raises
        ------
        IllConditionedError
            Names the first action of which double precision cannot give a bound.
        """
        family, options = chosen(self._criteria.families, self._criteria.bounds), self._criteria.options

        def widened(forms: Forms[Any]) -> tuple[Any, Any]:
            lower, upper = self._criteria.objective_itself.bounds(family, options, forms)
            return lower.value - lower.error, upper.value + upper.error

        return self._evaluated(widened)

    def entropies(self, which: Sequence[int] | None = None) -> Estimate[FloatArray]:
        """The exact objective, cost excluded.

        Parameters
        ----------
        which
            Places of the actions that are wanted; nothing is computed for the others. Default: all.

        Raises
        ------
        IllConditionedError
            Names the first action of which double precision cannot give it.
        """
        if which is None:
            return self._exact
        places = list(which)
        if self.knows_entropies:
            return Estimate(self._exact.value[places], self._exact.error[places])
        actions, numbers = [self._actions[place] for place in places], [self._numbers[place] for place in places]
        return Batch(self._engine, self._criteria, actions, numbers).entropies()

    @property
    def knows_entropies(self) -> bool:
        """Whether exact values cost nothing more, since bounds took the same increments."""
        known = self._criteria.objective_itself.known
        places = {place for places, forms in self._groups if known(forms) for place in places.tolist()}
        places.update(place for place, forms in self._alone.items() if known(forms))
        return len(places) == len(self._actions)

    @cached_property
    def _exact(self) -> Estimate[FloatArray]:
        return Estimate(*self._evaluated(lambda forms: _pair(self._criteria.objective_itself.exact(forms))))

    @_may_overflow
    def _evaluated(self, quantity: Callable[[Forms[Any]], tuple[Any, Any]]) -> tuple[FloatArray, FloatArray]:
        """Two numbers of each action; from scratch those that the engine cannot give."""
        results = np.full((2, len(self._actions)), np.nan)
        for places, forms in self._groups:
            results[:, places] = np.reshape(self._named(int(places[0]), quantity, forms), (2, -1))
        missing: list[int] = np.flatnonzero(~np.isfinite(results).all(axis=0)).tolist()
        for place in missing:
            results[:, place] = self._named(place, quantity, self._alone_forms(place))
        first, second = results
        return first, second

    def _alone_forms(self, place: int) -> GraphForms:
        if place not in self._alone:
            self._alone[place] = self._engine.from_scratch(self._actions[place])
        return self._alone[place]

    def _named(self, place: int, quantity: Callable[[Forms[Any]], tuple[Any, Any]], forms: Forms[Any]) -> tuple[Any, Any]:
        """The quantity of some forms; an error of rounding says which action is to blame."""
        try:
            return quantity(forms)
        except IllConditionedError as error:
            label = f" ({self._actions[place].label!r})" if self._actions[place].label else ""
            what = f"action {self._numbers[place]}{label}: {error.what}"
            raise IllConditionedError(what, error.error_estimate, unit=error.unit) from None


def _pair(estimate: Estimate[Any]) -> tuple[Any, Any]:
    return estimate.value, estimate.error
