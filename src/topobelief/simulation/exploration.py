"""Trips that improve the map, one after the other, until none is worth driving: what limits them, and how they ended."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass

from topobelief.candidates.propose import CandidateRule
from topobelief.candidates.roadmap import build_roadmap
from topobelief.errors import InvalidInputError, NotOptimizedWarning
from topobelief.graph.pose_graph import PoseGraph
from topobelief.optional import has_kernels, missing_packages
from topobelief.search.anytime import SearchProgress
from topobelief.search.result import SearchResult
from topobelief.simulation.ways import place_with_room, room_wanted
from topobelief.world import World

ENOUGH, UNDECIDED, TRIPS_DRIVEN, DRIVING = "enough", "undecided", "trips", "driving"
_NUM_ALTERNATIVES = 3
_FEW_EVALUATIONS = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class TripOptions:
    """Which trips are driven.

    Attributes
    ----------
    max_length
        Metres of a trip at most.
    return_to_start
        Whether each ends where it begins.
    enough
        Trips end when it is certain that none gains more than this, in the unit of the objective.
    max_trips
        Or when so many were driven.
    """

    max_length: float
    return_to_start: bool = False
    enough: float = 0.0
    max_trips: int = 10

    def __post_init__(self) -> None:
        if not 0 < self.max_length < math.inf:
            raise InvalidInputError(f"expected max_length as a finite number of metres above 0, got {self.max_length:g}")
        if not 0 <= self.enough < math.inf:
            raise InvalidInputError(f"expected a finite gain of at least 0 to be enough, got {self.enough:g}")
        if self.max_trips < 0:
            raise InvalidInputError(f"expected at least 0 trips, got {self.max_trips}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Exploration:
    """Where a run of trips stands, by the search for the next trip.

    Attributes
    ----------
    stopped_by
        "enough": no trip gains more than `TripOptions.enough`, which the lower bound proves; "undecided": none that was found
        does, but some might; "trips": the number of trips was reached; "interrupted"; "driving" while it goes on; else why the
        last trip ended, or why there is none.
    num_trips
        Driven so far.
    value_now, value, lower_bound
        The objective of the map as it is, after the best trip found, and what no trip undercuts; -inf where nothing is known.
    length
        Of the best trip found, metres.
    covers
        Which trips the lower bound covers.
    num_evaluations, seconds
        Of the search.
    """

    stopped_by: str
    num_trips: int
    value_now: float = math.nan
    value: float = math.nan
    lower_bound: float = -math.inf
    length: float = math.nan
    covers: str = ""
    num_evaluations: int = 0
    seconds: float = 0.0

    @staticmethod
    def of(found: SearchResult, trips: TripOptions, num_trips: int) -> Exploration:
        """What a search for the next trip says."""
        if found.stopped_by == "interrupt":
            reason = "interrupted"
        elif found.value_now - found.lower_bound <= trips.enough:
            reason = ENOUGH
        elif found.value_now - found.value <= trips.enough:
            reason = UNDECIDED
        else:
            reason = TRIPS_DRIVEN if num_trips >= trips.max_trips else DRIVING
        return Exploration(
            stopped_by=reason,
            num_trips=num_trips,
            value_now=found.value_now,
            value=found.value,
            lower_bound=found.lower_bound,
            length=found.length,
            covers=found.covers,
            num_evaluations=found.num_evaluations,
            seconds=found.seconds,
        )

    @property
    def gain(self) -> float:
        """Of the best trip found, in the unit of the objective."""
        return self.value_now - self.value

    @property
    def most(self) -> float:
        """No trip gains more than this; inf where nothing is known."""
        return self.value_now - self.lower_bound


def find_trip(
    belief: PoseGraph,
    world: World,
    rule: CandidateRule,
    trips: TripOptions,
    objective: str,
    *,
    chassis: float,
    position_error: float,
    on_progress: Callable[[SearchProgress], None] | None = None,
) -> SearchResult:
    """The best trip from where the robot believes to be, its last pose.

    Where a short search finds a trip that gains enough it is taken; else a long one tries to prove that there is none.
    New poses are counted by distance alone, as the lower bound does. Paths keep from walls as those to a goal do.

    Parameters
    ----------
    belief
    world
        As the robot knows it.
    rule
        Its `closures`, `spacing`, `information`, `line_of_sight`, `num_vertices`, `robot_radius` and `seed` count.
    trips
    objective
    chassis, position_error
        As for `ways.known_candidates`.
    on_progress

    Raises
    ------
    PlanningError
        Where the robot has no room to move.
    """
    if not has_kernels():
        raise missing_packages(["numba"], ["fast"])
    from topobelief.search.roadmap_search import search_roadmap

    radius = room_wanted(rule, chassis=chassis, position_error=position_error)
    start = place_with_room(world, belief.positions[-1], radius)
    roadmap = build_roadmap(world, start, None, rule.num_vertices, radius, rule.seed)

    def search(max_evaluations: int | None, earlier: SearchResult | None = None) -> SearchResult:
        return search_roadmap(
            belief,
            roadmap,
            max_length=trips.max_length,
            return_to_start=trips.return_to_start,
            objective=objective,
            closures=rule.closures,
            world=world if rule.line_of_sight else None,
            enough=trips.enough,
            num_alternatives=_NUM_ALTERNATIVES,
            spacing=rule.spacing,
            information=rule.information,
            seed=rule.seed,
            max_evaluations=max_evaluations,
            earlier=earlier,
            on_progress=on_progress,
        )

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotOptimizedWarning)  # the robot decides at the poses it drives by
        found = search(_FEW_EVALUATIONS)
        if found.stopped_by != "evaluations" or found.value_now - found.value > trips.enough:
            return found
        return search(None, found)
