"""Trips after the goals: driven while they gain, ended by a certificate, by their number, or by a reason."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from simulation_records import made_record
from topobelief.candidates.propose import CandidateRule
from topobelief.errors import InvalidInputError
from topobelief.report.exploration_figure import draw_trips
from topobelief.report.simulation_tables import exploration_line, leg_line, trips_table
from topobelief.simulation.episode import Episode
from topobelief.simulation.exploration import Exploration, TripOptions
from topobelief.simulation.noise import InjectedNoise
from topobelief.simulation.record import INTERRUPTED, Record, RunOptions
from topobelief.simulation.results import run_document
from topobelief.simulation.scenario import Goal, Scenario
from topobelief.world import World

TRIPS = TripOptions(max_length=6.0, return_to_start=True, enough=0.002, max_trips=1)


@pytest.fixture(scope="module")
def room() -> Scenario:
    """A drive along two sides of a pillar."""
    world = World.from_boxes([(3, 3, 5, 5)], bounds=(0, 0, 8, 8))
    goals = (Goal((6.5, 1.5), 1), Goal((6.5, 6.5), 1))
    return Scenario("room", world, (1.5, 1.5, 0.0), goals, rule=CandidateRule(num_vertices=30))


def options(trips: TripOptions | None) -> RunOptions:
    return RunOptions(noise=InjectedNoise.of_ratio(0.35), trips=trips)


@pytest.fixture(scope="module")
def driven(room) -> Record:
    return Episode(room, options(TRIPS)).run()


def test_a_trip_is_driven_and_recorded_with_what_it_gained(driven):
    assert [(leg.goal, leg.trip) for leg in driven.legs] == [(1, 0), (2, 0), (0, 1)]
    leg, found = driven.legs[-1], driven.exploration
    assert driven.outcome == leg.outcome == "arrived"
    assert leg.planned <= 6.0
    assert leg.prior_value - leg.predicted_value > TRIPS.enough
    assert leg.achieved_value < leg.prior_value
    assert (found.stopped_by, found.num_trips) == ("trips", 1)
    assert found.lower_bound <= found.value <= found.value_now
    np.testing.assert_allclose(driven.deliberations[-1].paths[leg.chosen][-1], driven.deliberations[-1].paths[leg.chosen][0])
    assert run_document(driven)["exploration"]["gain"] == pytest.approx(found.gain)


def test_trips_go_on_from_an_earlier_run_until_none_gains_enough(room, driven):
    most = driven.exploration.most
    certain = replace(TRIPS, enough=1.01 * most, max_trips=5)
    record = Episode(room, options(certain), history=driven.history).run()
    found = record.exploration
    assert (found.stopped_by, found.num_trips, len(record.legs)) == ("enough", 1, 3)
    assert found.value_now - found.lower_bound <= certain.enough
    assert (
        "Enough after 1 trip: no trip of up to 6 m that returns improves the expected error of the map by more than"
        in exploration_line(record)
    )


def test_an_interrupt_during_the_search_ends_the_run_and_leaves_it_complete(room, driven):
    stopped = Episode(room, options(replace(TRIPS, max_trips=3)), history=driven.history).run(should_stop=lambda: True)
    assert stopped.outcome == stopped.exploration.stopped_by == INTERRUPTED
    assert len(stopped.truth) == stopped.graph.num_poses


def test_what_trips_cannot_be():
    for wrong, message in (
        ({"max_length": 0.0}, "metres above 0, got 0"),
        ({"max_length": math.inf}, "finite number"),
        ({"max_length": 1.0, "enough": -1.0}, "gain of at least 0"),
        ({"max_length": 1.0, "max_trips": -1}, "at least 0 trips"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            TripOptions(**wrong)


def test_every_end_is_told():
    """Values in centimetres; why no more trips were driven."""
    record = made_record()
    known = Exploration(stopped_by="trips", num_trips=2, value_now=0.10, value=0.08, lower_bound=0.07, length=7.0)
    improves = "trip of up to 6 m that returns improves the expected error of the map by"
    ends = {
        "trips": f"Stopped after 2 trips, as many as were allowed: the best {improves} 2.0 cm, none by more than 3.0 cm.",
        "enough": f"Enough after 2 trips: no {improves} more than 0.2 cm.",
        "undecided": f"Undecided after 2 trips: the best {improves} 2.0 cm, none by more than 3.0 cm, where 0.2 cm was asked "
        "for.",
        "contact: touched a wall": "Trips ended after 2 trips: contact: touched a wall",
    }
    for reason, told in ends.items():
        ended = replace(known, stopped_by=reason)
        assert exploration_line(replace(record, options=options(TRIPS), exploration=ended)) == told
    unreachable = Exploration(stopped_by="unreachable: no room", num_trips=0)
    assert exploration_line(replace(record, options=options(TRIPS), exploration=unreachable)).endswith("unreachable: no room")
    assert exploration_line(record) == ""


def test_trips_are_listed_and_drawn(driven):
    assert leg_line(driven.legs[-1]).startswith("trip 1: path ")
    assert trips_table(driven).row_count == 1
    figure = draw_trips(driven)
    assert figure.get_axes()[1].get_ylabel() == "map error (cm)"
