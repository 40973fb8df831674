"""Candidates by one rule are those of its parts, in one step or in two."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.diverse_paths import diverse_paths
from topobelief.candidates.polyline import path_length
from topobelief.candidates.predicted_factors import predict_actions
from topobelief.candidates.propose import CandidateRule, find_routes, predict_candidates, propose
from topobelief.candidates.roadmap import build_roadmap
from topobelief.candidates.start import find_start
from topobelief.errors import PlanningError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world import World

INFORMATION = np.diag([100.0, 100.0, 800.0])
GRAPH = PoseGraph([(float(x), 1.0, 0.0) for x in range(1, 12)], [(i, i + 1) for i in range(10)], None, INFORMATION)
WORLD = World.from_boxes([(3, 3, 5, 5), (8, 3, 9, 6)], bounds=(0, 0, 12, 9))
GOAL = (1.0, 7.0)
RULE = CandidateRule(
    num_paths=5,
    max_detour=2.0,
    num_vertices=120,
    robot_radius=0.3,
    seed=3,
    spacing=0.8,
    turn=0.5,
    closures=ClosureModel(1.5, 1.0, 3, max_per_pose=2, probability=0.3),
)


def same(found, other):
    return len(found) == len(other) and all(
        np.array_equal(one.poses, two.poses)
        and np.array_equal(one.edges, two.edges)
        and np.array_equal(one.information, two.information)
        and one.length == two.length
        for one, two in zip(found, other, strict=True)
    )


@pytest.fixture(scope="module")
def by_hand():
    start = GRAPH.positions[-1]
    roadmap = build_roadmap(WORLD, start, GOAL, num_vertices=120, robot_radius=0.3, seed=3)
    return diverse_paths(roadmap, start, GOAL, num_paths=5, max_detour=2.0, seed=3)


def test_every_number_of_the_rule_reaches_its_part(by_hand):
    found = propose(GRAPH, WORLD, GRAPH.positions[-1], GOAL, RULE)
    assert [path.tolist() for path in found.paths] == [path.tolist() for path in by_hand]
    expected = predict_actions(GRAPH, by_hand, spacing=0.8, turn=0.5, closures=RULE.closures, world=WORLD)
    assert same(found.actions, expected)
    assert found.lengths.tolist() == [path_length(path) for path in by_hand] == sorted(found.lengths)
    assert len(found.routes.roadmap.vertices) >= 120


def test_the_two_halves_are_the_whole(by_hand):
    routes = find_routes(WORLD, GRAPH.positions[-1], GOAL, RULE)
    for change in ({}, {"line_of_sight": False}, {"information": 4 * INFORMATION}):
        rule = dataclasses.replace(RULE, **change)
        whole = propose(GRAPH, WORLD, GRAPH.positions[-1], GOAL, rule)
        assert same(predict_candidates(GRAPH, WORLD, routes, rule).actions, whole.actions)
    assert whole.actions[0].information[0].tolist() == (4 * INFORMATION).tolist()


def test_line_of_sight_is_a_choice():
    def num_closures(line_of_sight):
        rule = dataclasses.replace(RULE, closures=ClosureModel.by_hand(closure_radius=6.0), line_of_sight=line_of_sight)
        return sum(action.num_closures for action in propose(GRAPH, WORLD, GRAPH.positions[-1], GOAL, rule).actions)

    assert num_closures(False) > num_closures(True)


def test_factors_join_the_pose_of_a_start_and_the_last_pose_from_a_place():
    start = find_start(GRAPH, 2)
    at_pose = propose(GRAPH, WORLD, start, GOAL, RULE)
    at_place = propose(GRAPH, WORLD, start.place, GOAL, RULE)
    assert [path.tolist() for path in at_pose.paths] == [path.tolist() for path in at_place.paths]
    assert {int(action.edges[0, 0]) for action in at_pose.actions} == {2}
    assert {int(action.edges[0, 0]) for action in at_place.actions} == {GRAPH.num_poses - 1}


def test_no_limit_of_detours():
    def longest(max_detour):
        rule = dataclasses.replace(RULE, num_paths=12, max_detour=max_detour)
        lengths = find_routes(WORLD, GRAPH.positions[-1], GOAL, rule).lengths
        return lengths.max() / lengths.min()

    assert longest(1.2) <= 1.2 < longest(None)


def test_a_goal_in_a_wall_is_refused():
    with pytest.raises(PlanningError, match="expected a goal with more clearance"):
        propose(GRAPH, WORLD, GRAPH.positions[-1], (4, 4), RULE)
