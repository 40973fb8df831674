"""Ways from where a robot stands, also too close to a wall, and walls that turn up in them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from topobelief.candidates.propose import CandidateRule
from topobelief.errors import PlanningError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.simulation.scenario import Goal
from topobelief.simulation.ways import known_candidates, place_with_room, stands_in_the_way
from topobelief.world import World

RULE = CandidateRule(num_vertices=150)
SURE = {"chassis": 0.25, "position_error": 0.0}


def candidate_paths(world, here, goal, rule, *, chassis, position_error, seed):
    """Paths of a robot that knows nothing but where it is."""
    belief = PoseGraph([here], np.zeros((0, 2), dtype=np.int64), None, np.eye(3))
    rule = replace(rule, seed=seed, information=np.eye(3))
    found = known_candidates(belief, world, goal, rule, chassis=chassis, position_error=position_error)
    led = np.linalg.norm(found.paths[0][0] - here[:2])  # from the pose to where paths begin
    assert np.array([action.length for action in found.actions]) == pytest.approx(found.lengths + led)
    return found.paths


@pytest.fixture(scope="module")
def room() -> World:
    return World.from_boxes([(3, 3, 5, 5)], bounds=(0, 0, 8, 8))


def test_a_robot_in_the_open_starts_where_it_is(room):
    paths = candidate_paths(room, np.array([1.0, 1.0, 0.0]), Goal((7, 7), 4), RULE, **SURE, seed=0)
    assert 1 < len(paths) <= 4
    for path in paths:
        assert path[0].tolist() == [1, 1]
        assert path[-1].tolist() == [7, 7]


def test_a_robot_by_a_wall_steps_away_first(room):
    here = np.array([0.1, 4.0])
    place = place_with_room(room, here, 0.35)
    assert room.clearance([place])[0] > 0.35
    assert 0.25 < np.linalg.norm(place - here) < 0.4
    (path, *_) = candidate_paths(room, np.array([*here, 0.0]), Goal((7, 7)), RULE, **SURE, seed=0)
    assert path[0].tolist() == place.tolist()


def test_a_robot_far_from_any_room_stays(room):
    here = np.array([-4.0, 4.0])
    assert place_with_room(room, here, 0.35).tolist() == here.tolist()


def test_a_tight_goal_is_planned_for_what_fits(room):
    (path, *_) = candidate_paths(room, np.array([1.0, 1.0, 0.0]), Goal((7.7, 7.7), 2), RULE, **SURE, seed=0)
    assert path[-1].tolist() == [7.7, 7.7]
    with pytest.raises(PlanningError, match="in an obstacle"):
        candidate_paths(room, np.array([1.0, 1.0, 0.0]), Goal((4, 4), 2), RULE, **SURE, seed=0)


def test_paths_keep_more_than_the_chassis_and_the_error_of_the_position(room):
    """Whatever the rule says, a robot that errs and strays from its path does not touch."""
    tight = CandidateRule(num_vertices=150, robot_radius=0.25)
    for position_error in (0.0, 0.3):
        paths = candidate_paths(
            room, np.array([1.0, 1.0, 0.0]), Goal((7, 7), 4), tight, chassis=0.25, position_error=position_error, seed=0
        )
        points = np.concatenate(
            [start + np.linspace(0, 1, 50)[:, None] * (end - start) for p in paths for start, end in pairwise(p)]
        )
        assert room.clearance(points).min() > 0.25 + position_error + 0.06


def test_a_goal_without_room_for_the_error_of_the_position_is_out_of_reach(room):
    here, goal = np.array([1.0, 1.0, 0.0]), Goal((7.7, 7.7), 2)
    (path, *_) = candidate_paths(room, here, goal, RULE, chassis=0.25, position_error=0.03, seed=0)
    assert path[-1].tolist() == [7.7, 7.7]
    with pytest.raises(PlanningError, match=r"room for the chassis of 0.25 m and a position error of 0.10 m"):
        candidate_paths(room, here, goal, RULE, chassis=0.25, position_error=0.1, seed=0)


def test_what_stands_in_the_way_is_near_and_ahead():
    path = np.array([(0, 0), (1, 0), (1, 3)], dtype=float)

    def blocked(*point: float) -> bool:
        return stands_in_the_way(np.array([point]), path, radius=0.25, ahead=1.5)

    assert blocked(0.5, 0.2)
    assert not blocked(0.5, 0.3)
    assert blocked(1.2, 0.4)
    assert blocked(1.0, 0.7)
    assert not blocked(1.0, 0.8)  # too far ahead
    assert not stands_in_the_way(np.zeros((0, 2)), path, radius=0.25, ahead=1.5)
    assert not stands_in_the_way(path, path[:1], radius=0.25, ahead=1.5)
