"""What a search over a roadmap found: the best way, others, the front of length against value, and the certificate."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from topobelief.arrays import FloatArray, ReadOnlyArrays, frozen_floats
from topobelief.graph.action import Action
from topobelief.search.front import spread_on_front
from topobelief.wording import counted

_UNITS = {"error": "m", "per_pose": "nats per pose"}  # else nats


@dataclass(frozen=True, eq=False, slots=True)
class Way(ReadOnlyArrays):
    """One way through the roadmap.

    Attributes
    ----------
    path : shape (waypoints, dim)
        Metres, world frame; its waypoints are vertices of the roadmap, but for those of a way that was refined. One waypoint:
        the robot stays where it is.
    action : Action
        What driving it adds to the graph; its cost is that of its length.
    value : float
        Exact objective after the action, cost included; metres for "error", else nats.
    length : float
        Metres.
    """

    path: FloatArray
    action: Action
    value: float
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", frozen_floats(self.path, name="path"))


@dataclass(frozen=True, eq=False)
class SearchResult(ReadOnlyArrays):
    """The outcome of `search_roadmap`.

    Values are in the unit of the objective: metres for "error", else nats. The smaller, the better.

    Attributes
    ----------
    best : Way
        The best way found; `path`, `action`, `value` and `length` are its.
    alternatives : tuple of Way
        Other ways, best first, each more than a twentieth of the length limit from the others (Fréchet).
    on_front : tuple of Way
        The best way found at each length, by increasing length and decreasing objective.
    front : shape (F, 2)
        Metres and objective of the ways on the front, cost excluded: what each further metre buys. `cost_per_metre` picks one.
    front_bounds : shape (G, 2)
        Metres and a value: no walk of up to so many metres has a smaller objective, cost excluded. By increasing length and
        decreasing value; between two of the lengths the value of the longer one holds. Empty where nothing is known.
    lower_bound : float
        No walk of the class has a smaller value, cost included; -inf where nothing is known.
    covers : str
        Which walks the lower bound covers, and which bound it is; empty where there is none.
    bound_by : str
        "flows" or "windows", whichever bound is the larger; empty where there is none.
    value_with_map_alone : float
        Value of the best way if loop closures among its own new poses did not count, as the lower bound has it; at least
        `value`.
    proven_optimal : bool
        Whether the lower bound meets the value, to rounding.
    value_now : float
        The objective of the graph as it is.
    shortest : Way or None
        The shortest way to the goal; None without a goal.
    max_length : float
        Metres; the limit.
    sees_map : bool
        Whether any way that was evaluated would close a loop with the map.
    any_sees_itself : bool
        Whether any of them would close a loop between its own new poses; the lower bound counts no such loop, so local search
        goes on although the bound is met.
    num_evaluations : int
        Exact evaluations made.
    seconds : float
        Time taken.
    stopped_by : str
        "proof", "gap", "enough", "deadline", "evaluations", "interrupt", or "rest" where neither value nor bound improved any
        more; "progress" of a search that goes on.
    objective : str
    cost_per_metre : float
    metric : bool
        Whether values are those of the objective; else they are its signature's estimates of it.
    """

    best: Way
    alternatives: tuple[Way, ...]
    on_front: tuple[Way, ...]
    front: FloatArray
    front_bounds: FloatArray
    lower_bound: float
    covers: str
    bound_by: str
    value_with_map_alone: float
    proven_optimal: bool
    value_now: float
    shortest: Way | None
    max_length: float
    sees_map: bool
    any_sees_itself: bool
    num_evaluations: int
    seconds: float
    stopped_by: str
    objective: str
    cost_per_metre: float
    metric: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "front", frozen_floats(self.front, name="front"))
        object.__setattr__(self, "front_bounds", frozen_floats(self.front_bounds, name="front_bounds"))

    @property
    def path(self) -> FloatArray:
        """The best way found, shape (waypoints, dim), metres."""
        return self.best.path

    @property
    def action(self) -> Action:
        """What driving the best way adds to the graph."""
        return self.best.action

    @property
    def value(self) -> float:
        """Exact objective after the action, cost included."""
        return self.best.value

    @property
    def length(self) -> float:
        """Of the best way, metres."""
        return self.best.length

    @property
    def gap(self) -> float:
        """No walk of the class is better than the best way by more than this; inf where nothing is known."""
        return max(0.0, self.value - self.lower_bound)

    def bound_within(self, length: float) -> float:
        """No walk of up to a length has a smaller objective, cost excluded; -inf where nothing is known."""
        place = int(np.searchsorted(self.front_bounds[:, 0], length))
        return float(self.front_bounds[place, 1]) if place < len(self.front_bounds) else -math.inf

    @property
    def own_closures_gain(self) -> float:
        """By how much the loops that the best way closes with itself better its value; the certificate does not count such."""
        return max(0.0, self.value_with_map_alone - self.value)

    @property
    def unit(self) -> str:
        """Of values: "m", "nats" or "nats per pose"."""
        return _UNITS.get(self.objective, "nats")

    def summary(self) -> str:
        """The result in a few sentences."""
        return " ".join([self._what_was_found(), *self._comparison(), self._certificate()])

    def _what_was_found(self) -> str:
        if not self.sees_map:
            return f"Nothing to gain within {self.max_length:.1f} m: no place in reach sees the map again."
        if len(self.path) == 1:
            return f"No trip of up to {self.max_length:.1f} m that was found is worth its way: stay."
        closures = self.action.num_closures
        noun = "loop closure" if closures == 1 else "loop closures"
        after = said(self.best.value - self.best.action.cost, self.objective)
        now = said(self.value_now, self.objective)
        found = f"The best way found is {self.length:.1f} m long and closes {closures} {noun}"
        if seen := self.action.num_observations:
            found += f" and observes landmarks {counted(seen, 'time')}"
        return f"{found}: {self._name} {after}, now {now}."

    @property
    def _name(self) -> str:
        return _NAMES[self.objective] if self.metric else f"{_NAMES[self.objective]} by {_SIGNATURES[self.objective]}"

    def _comparison(self) -> list[str]:
        if self.shortest is None or self.shortest.length >= self.length:
            return []
        shortest = said(self.shortest.value - self.shortest.action.cost, self.objective)
        return [f"The shortest way, {self.shortest.length:.1f} m, leaves {shortest}."]

    def _certificate(self) -> str:
        if self.proven_optimal:
            return f"It is proven that no walk of the roadmap within the length is better{self._but_for_own_closures}."
        if math.isinf(self.lower_bound):
            return "Nothing is proven of other walks."
        gap = said(self.gap, self.objective)
        return f"No walk of the roadmap within the length is better by more than {gap}{self._but_for_own_closures}."

    @property
    def _but_for_own_closures(self) -> str:
        return ", loops that it would close with itself not counted" if self.any_sees_itself else ""

    def __str__(self) -> str:
        return self.summary()

    def __repr__(self) -> str:
        bound = "none" if math.isinf(self.lower_bound) else f"{self.lower_bound:.4g}"
        return (
            f"SearchResult({self.length:.1f} m, {self.action.num_closures} closures, "
            f"{self.objective} {self.value:.4g} {self.unit}, bound {bound}, {len(self.alternatives)} alternatives)"
        )

    def _repr_html_(self) -> str:
        """For notebooks: the summary, and the front as a table."""
        rows = "".join(
            f"<tr><td>{metres:.1f}</td><td>{said(value, self.objective)}</td></tr>"
            for metres, value in self.few_on_front(5).tolist()
        )
        head = f"<tr><th>up to (m)</th><th>{self._name}</th></tr>"
        return f"<p>{self.summary()}</p><table>{head}{rows}</table>"

    def few_on_front(self, count: int) -> FloatArray:
        """Some points of the front that are spread over its lengths, its ends among them; shape (at most count, 2)."""
        return self.front[self.few_places(count)]

    def few_places(self, count: int) -> list[int]:
        """Places of these points on the front."""
        return spread_on_front(self.front[:, 0], count).tolist()


_NAMES = {
    "error": "expected map error",
    "map": "entropy of the map",
    "joint": "joint entropy",
    "per_pose": "joint entropy per pose",
}


_SIGNATURES = {"error": "effective resistance", "map": "spanning trees", "joint": "spanning trees"}


def said(value: float, objective: str) -> str:
    """A value with its unit as a person reads it: a length for errors, nats for entropies.

    Examples
    --------
    >>> said(0.162, "error"), said(0.0029, "error"), said(12.34, "map")
    ('16.2 cm', '0.290 cm', '12.3 nats')
    """
    if objective == "error":
        return f"{100 * value:#.3g} cm" if abs(value) < 1 else f"{value:.2f} m"
    return f"{value:.1f} {_UNITS.get(objective, 'nats')}" if objective != "per_pose" else f"{value:.3f} nats per pose"
