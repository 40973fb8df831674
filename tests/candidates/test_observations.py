"""Predicted observations of landmarks: who is seen, how surely and how well, and what that does to predicted actions."""

from __future__ import annotations

import math

import numpy as np
import pytest

import topobelief as tb
from topobelief.candidates.observations import ObservationModel, learn_observations, observations_from
from topobelief.errors import InvalidInputError

HERE = [0.0, 0.0, 0.0]


def graph_of(landmarks, *, seen=(), poses=((0, 0, 0), (1, 0, 0)), information=None):
    """A short drive along x, landmarks at places, and which pose has seen which of them."""
    n, rows = len(poses), [[x, y, 0.0] for x, y in landmarks]
    chain = [(i, i + 1) for i in range(n - 1)]
    edges = [*chain, *((pose, n + landmark) for pose, landmark in seen)]
    kinds = ["pose"] * n + ["landmark"] * len(rows)
    omega = np.diag([100.0, 100.0, 400.0]) if information is None else information
    return tb.PoseGraph([*poses, *rows], edges, None, omega, kinds)


def seen_by(graph, poses, **rule):
    found = observations_from(graph, np.array(poses, dtype=float), ObservationModel(sigma=0.1, **rule))
    return [tuple(pair) for pair in (found - [0, graph.num_poses]).tolist()]


def test_what_is_near_enough_is_seen_nearest_first():
    graph = graph_of([(3, 0), (1, 1), (-2, 0), (9, 0)])
    assert seen_by(graph, [HERE], max_range=5, max_per_pose=None) == [(0, 0), (0, 1), (0, 2)]
    assert seen_by(graph, [HERE, [9, 0, 0]], max_range=5, max_per_pose=2) == [(0, 1), (0, 2), (1, 3)]


def test_what_is_behind_is_not_in_the_field_of_view():
    graph = graph_of([(3, 0), (1, 1), (-2, 0), (0, -1)])
    assert seen_by(graph, [HERE], max_range=5, max_per_pose=None, field_of_view=math.pi / 2 + 0.01) == [(0, 0), (0, 1)]
    assert seen_by(graph, [[0, 0, math.pi]], max_range=5, max_per_pose=None, field_of_view=1.0) == [(0, 2)]


def test_walls_hide_landmarks():
    graph = graph_of([(3, 0), (0, 3)])
    world = tb.World.from_boxes([(1, -1, 2, 1)], bounds=(-5, -5, 5, 5))
    model = ObservationModel(max_range=5, sigma=0.1, max_per_pose=None)
    assert observations_from(graph, np.array([HERE]), model, world=world).tolist() == [[0, 3]]


def test_a_model_is_learned_from_the_graph():
    """Every second pose has seen the two nearest landmarks, a metre or so to its left: two a pose, half of the time."""
    poses = [(i, 0, 0) for i in range(40)]
    landmarks = [(i + 0.5, 1.0) for i in range(-1, 41)]
    seen = [(i, i + side) for i in range(0, 40, 2) for side in (0, 1)]
    graph = graph_of(landmarks, seen=seen, poses=poses, information=np.diag([25.0, 25.0, 400.0]))
    model = learn_observations(graph)
    assert model.max_range == pytest.approx(math.hypot(0.5, 1), rel=1e-5)
    assert model.field_of_view == pytest.approx(2 * math.atan2(1, -0.5), rel=1e-5)
    assert (model.max_per_pose, model.num_observed) == (2, 40)
    assert model.sigma == pytest.approx(0.2)
    assert model.probability == pytest.approx((1 + 40) / (2 + 80))
    assert learn_observations(graph_of([])) is None
    stated = learn_observations(graph, max_range=0.1, max_per_pose=7)
    assert (stated.max_range, stated.max_per_pose, stated.sigma) == (0.1, 7, model.sigma)
    assert stated.probability == 1 / 2  # nothing is that near
    assert learn_observations(graph, probability=0.3).probability == 0.3


def test_landmarks_that_were_seen_where_the_world_shows_no_sight_are_seen_there_again():
    """Trees beside the region along the trajectory. Where most were seen along free lines, walls hide the others."""
    landmarks = [(i + 0.5, 3.0) for i in range(12)]
    graph = graph_of(landmarks, seen=[(i, i) for i in range(12)], poses=[(i, 0, 0) for i in range(12)])
    lane = tb.World.from_trajectory(graph, 1.0)
    model = learn_observations(graph, world=lane)
    assert not model.line_of_sight
    assert "in sight or not" in str(model)
    assert observations_from(graph, graph.poses[:1], model, world=lane).tolist() == [[0, 12]]
    walled = tb.World.from_boxes([(2.2, 1, 4.8, 2)], bounds=(-5, -5, 20, 5))
    model = learn_observations(graph, world=walled)
    assert model.line_of_sight
    assert observations_from(graph, graph.poses[3:4], model, world=walled).tolist() == []


def test_actions_observe_landmarks_with_their_expected_information():
    """A path past two landmarks: observations come last, new pose -> landmark, and new poses count behind the landmarks."""
    graph = graph_of([(2, 1), (4, 1)], seen=[(0, 0), (1, 1)])
    model = ObservationModel(max_range=1.5, sigma=0.5, probability=0.25)
    action = tb.predict_actions(graph, [[(1, 0), (4, 0)]], observations=model, closures=tb.ClosureModel(radius=0.1))[0]
    n = graph.num_nodes
    assert action.edges.tolist() == [[1, n], [n, n + 1], [n + 1, n + 2], [n, 2], [n + 1, 2], [n + 2, 3]]
    assert action.information[3] == pytest.approx(np.diag([1.0, 1.0, 0.0]))
    assert action.probabilities.tolist() == [1, 1, 1, 0.25, 0.25, 0.25]
    planner = tb.Planner(graph, objective="focused", focus=[2, 3])
    blind = tb.predict_actions(graph, [[(1, 0), (4, 0)]], observations=ObservationModel(0.1, 1.0), closures=tb.ClosureModel())
    seeing, stay = planner.entropies([action])[0], planner.entropies(blind)[0]
    assert seeing < stay


def test_observations_are_learned_unless_given():
    graph = graph_of([(2, 1), (6, 1)], seen=[(0, 0), (1, 0), (1, 1)])
    actions = tb.predict_actions(graph, [[(1, 0), (4, 0)]])
    expected = tb.predict_actions(graph, [[(1, 0), (4, 0)]], observations=tb.learn_observations(graph))
    assert actions[0].edges.tolist() == expected[0].edges.tolist()
    assert (actions[0].edges[:, 1] == 3).any()


def test_landmarks_are_no_places_to_close_loops_with_or_to_start_at():
    graph = graph_of([(4, 0.1), (2, 0.1)], seen=[(0, 0), (0, 1)])
    rule = tb.ClosureModel.by_hand(closure_radius=3.0, min_index_gap=2)
    action = tb.predict_actions(graph, [[(1, 0), (3, 0)]], closures=rule, observations=ObservationModel(0.01, 1.0))[0]
    assert not graph.is_landmark[action.edges[action.edges < graph.num_nodes]].any()
    assert tb.learn_closures(graph) == tb.learn_closures(graph.poses_alone)
    with pytest.raises(InvalidInputError, match="expected start as the index of a pose, got landmark 2"):
        tb.predict_actions(graph, [[(1, 0), (3, 0)]], start=2)


@pytest.mark.parametrize(
    ("rule", "message"),
    [
        ({"max_range": 0, "sigma": 1}, "expected max_range above 0, got 0"),
        ({"max_range": 1, "sigma": math.inf}, "expected sigma above 0, got inf"),
        ({"max_range": 1, "sigma": 1, "field_of_view": 90}, "at most 2 pi, got 90; angles are in radians"),
        ({"max_range": 1, "sigma": 1, "max_per_pose": 0}, "expected max_per_pose as a whole number of at least 1"),
        ({"max_range": 1, "sigma": 1, "probability": 0}, "expected probability above 0 and at most 1, got 0"),
    ],
)
def test_numbers_out_of_range_are_refused(rule, message):
    with pytest.raises(InvalidInputError, match=message):
        ObservationModel(**rule)
