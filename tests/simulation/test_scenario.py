"""Scenarios: every goal of theirs can be reached, and the corridors' three ways are as long as they should be."""

from __future__ import annotations

import numpy as np
import pytest
from shapely import Polygon

from topobelief.candidates.diverse_paths import diverse_paths
from topobelief.candidates.polyline import path_length, stations
from topobelief.candidates.propose import CandidateRule
from topobelief.candidates.roadmap import build_roadmap
from topobelief.errors import InvalidInputError
from topobelief.simulation.scenario import SCENARIO_NAMES, Goal, Scenario, named_scenario
from topobelief.world import World


@pytest.mark.parametrize("name", SCENARIO_NAMES)
def test_all_places_of_a_scenario_are_connected(name):
    scenario = named_scenario(name)
    radius = scenario.rule.robot_radius
    reached = Polygon(scenario.world.component(scenario.start[:2], radius))
    places = [*scenario.approach, *(goal.place for goal in scenario.goals)]
    assert scenario.world.clearance(places).min() > radius
    assert all(reached.distance(Polygon([place] * 3).centroid) < 1e-6 for place in places)


def test_the_office_has_the_sessions_of_the_paper():
    office = named_scenario("office")
    assert office.start[:2] == (20.0, 0.0)
    assert [(goal.place, goal.num_paths) for goal in office.goals] == [((26.0, 8.0), 9), ((25.0, -2.95), 20)]
    assert len(named_scenario("lab").goals) == 16


def test_the_corridors_offer_three_ways():
    """The unknown corridor, the known way back and the meander: some 42, 53 and 90 m, one of each homotopy class."""
    corridors = named_scenario("corridors")
    start, goal = corridors.approach[-1], corridors.goals[0]
    roadmap = build_roadmap(corridors.world, start, goal.place, corridors.rule.num_vertices, corridors.rule.robot_radius)
    paths = diverse_paths(roadmap, start, goal.place, goal.num_paths, corridors.rule.max_detour)
    np.testing.assert_allclose([path_length(path) for path in paths], [42, 53, 90], atol=3)
    through = [stations(path, np.array([path_length(path) / 2])).positions[0, 1] for path in paths]
    assert through[0] > 11
    assert through[1] < 1
    assert 1.4 < through[2] < 10.6


def test_a_scenario_without_room_is_refused():
    world = World.from_boxes([(4, 4, 6, 6)], bounds=(0, 0, 10, 10))
    Scenario("room", world, (2, 2, 0), (Goal((8, 8)),))
    with pytest.raises(InvalidInputError, match=r"at the goal 2 \(5, 5\), got a clearance of 0.00 m"):
        Scenario("room", world, (2, 2, 0), (Goal((8, 8)), Goal((5, 5))))
    with pytest.raises(InvalidInputError, match=r"at the start \(0.1, 2\), got a clearance of 0.10 m"):
        Scenario("room", world, (0.1, 2, 0), (Goal((8, 8)),))
    with pytest.raises(InvalidInputError, match="at least one goal"):
        Scenario("room", world, (2, 2, 0), ())


def test_paths_narrower_than_the_chassis_are_refused_and_tight_ones_cautioned_against():
    world = World.from_boxes([(4, 4, 6, 6)], bounds=(0, 0, 10, 10))

    def scenario(radius: float) -> Scenario:
        return Scenario("room", world, (2, 2, 0), (Goal((8, 8)),), rule=CandidateRule(robot_radius=radius))

    with pytest.raises(InvalidInputError, match=r"chassis of 0.25 m in radius, got a robot_radius of 0.15 m; raise it"):
        scenario(0.15)
    assert "0.05 m beside the chassis of 0.25 m" in (scenario(0.3).caution or "")
    assert scenario(0.25).caution is not None
    assert scenario(0.35).caution is None
    assert all(named_scenario(name).caution is None for name in SCENARIO_NAMES)


def test_an_unknown_name_is_refused():
    with pytest.raises(InvalidInputError, match="office"):
        named_scenario("ofice")
