"""The search over a whole roadmap: on small ones with all simple walks evaluated, and what its result promises."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import topobelief as tb
from roadmap_walks import random_case
from small_roadmaps import OPEN, drive, simple_walks, small_roadmap, values_of
from topobelief.candidates.roadmap import Roadmap
from topobelief.errors import InvalidInputError, NotOptimizedWarning
from topobelief.search import anytime
from topobelief.search.evaluations import Evaluations
from topobelief.search.flows import FlowBound
from topobelief.search.local_search import LocalSearch, spread_vias
from topobelief.search.result import SearchResult
from topobelief.search.walk_bounds import spare_metres
from topobelief.search.walks import Walks

CLOSURES = tb.ClosureModel(radius=1.5, max_per_pose=2, probability=1.0, min_index_gap=3)


def scene(seed, *, num_vertices=11):
    rng = np.random.default_rng(seed)
    graph = drive(rng)
    return graph, small_roadmap(rng, graph, num_vertices=num_vertices)


def search(graph, roadmap, **options) -> SearchResult:
    """By local search alone unless a bound is asked for: a turn of several rounds puts no pose at a corner."""
    options = {"objective": "map", "closures": CLOSURES, "turn": 100.0, **options}
    return tb.search_roadmap(graph, roadmap, **options)


@pytest.fixture(scope="module")
def found():
    graph, roadmap = scene(3)
    return graph, roadmap, search(graph, roadmap, goal=roadmap.vertices[1], max_detour=2.0)


@pytest.mark.parametrize("objective", ["map", "error", "joint"])
def test_no_simple_walk_to_the_goal_is_better(objective):
    """Nearly always: here in each of these cases."""
    for seed in (1, 3):
        graph, roadmap = scene(seed)
        limit = 1.8 * roadmap.distances_to(1)[0]
        values = values_of(graph, roadmap, simple_walks(roadmap, limit, end=1), objective=objective, closures=CLOSURES)
        result = search(graph, roadmap, goal=roadmap.vertices[1], max_length=limit, objective=objective)
        assert result.value <= values.min() + 1e-9 * abs(values.min())


@pytest.mark.parametrize(("seed", "objective"), [(24, "map"), (100, "map"), (100, "joint"), (110, "per_pose")])
def test_no_walk_that_turns_back_again_and_again_is_better(seed, objective):
    """Where the leaders' neighbours and new starts lead nowhere, neighbours of other walks do."""
    case = random_case(seed)
    walks = case.walks()
    paths = [case.roadmap.vertices[walk] for walk in walks]
    rule = {"closures": case.rule, "world": case.world, "spacing": case.spacing, "information": case.information}
    values = tb.Planner(case.graph, objective=objective).entropies(tb.predict_actions(case.graph, paths, turn=None, **rule))
    values = values + case.cost_per_metre * np.array([case.length(walk) for walk in walks])
    result = search(
        case.graph,
        case.roadmap,
        goal=None if case.goal is None else case.roadmap.vertices[case.goal],
        max_length=case.max_length,
        return_to_start=case.return_to_start,
        cost_per_metre=case.cost_per_metre,
        objective=objective,
        **rule,
    )
    assert result.value <= values.min() + 1e-9 * abs(values.min())


def test_no_simple_walk_to_anywhere_is_better():
    for seed in (2, 4):
        graph, roadmap = scene(seed, num_vertices=7)
        values = values_of(graph, roadmap, simple_walks(roadmap, 4.0), objective="map", closures=CLOSURES)
        assert search(graph, roadmap, max_length=4.0).value <= values.min() + 1e-9 * abs(values.min())


@pytest.mark.parametrize("objective", ["map", "error"])
def test_the_bound_is_below_every_walk(objective):
    graph, roadmap = scene(5, num_vertices=8)
    limit = 1.5 * roadmap.distances_to(1)[0]
    values = values_of(graph, roadmap, simple_walks(roadmap, limit, end=1), objective=objective, closures=CLOSURES)
    result = search(graph, roadmap, goal=roadmap.vertices[1], max_length=limit, objective=objective, turn=None, deadline=2)
    assert result.lower_bound <= values.min() + 1e-9 * abs(values.min())
    assert result.lower_bound > -math.inf
    assert "every walk" in result.covers
    assert result.proven_optimal == (result.value - result.lower_bound <= 1e-9 * abs(result.value))


@pytest.mark.parametrize("engine", ["scratch", "incremental"])
@pytest.mark.parametrize("cost", [0.0, 0.7])
def test_the_value_is_what_the_planner_says_of_the_action_with_its_cost(engine, cost):
    graph, roadmap = scene(3)
    result = search(graph, roadmap, goal=roadmap.vertices[1], max_detour=2.0, cost_per_metre=cost)
    planner = tb.Planner(graph, objective="map", engine=engine)
    for way in (result.best, *result.alternatives, *result.on_front):
        assert planner.entropies([way.action])[0] + way.action.cost == pytest.approx(way.value, rel=1e-9)
        assert way.action.cost == pytest.approx(cost * way.length)
    assert result.value == result.best.value == min(way.value for way in (result.best, *result.alternatives))


def test_the_action_is_the_predicted_one(found):
    graph, _, result = found
    (expected,) = tb.predict_actions(graph, [result.path], closures=CLOSURES, turn=None)
    np.testing.assert_array_equal(result.action.edges, expected.edges)
    np.testing.assert_allclose(result.action.poses, expected.poses)


def test_ways_follow_edges_within_the_length_from_the_start_to_the_goal(found):
    _, roadmap, result = found
    edges = {tuple(edge) for edge in roadmap.edges.tolist()}
    places = {tuple(place): index for index, place in enumerate(roadmap.vertices.tolist())}
    for way in (result.best, *result.alternatives, *result.on_front):
        walk = [places[tuple(place)] for place in way.path.tolist()]
        assert walk[0] == 0
        assert walk[-1] == 1
        assert all(tuple(sorted(pair)) in edges for pair in itertools.pairwise(walk))
        assert way.length <= result.max_length * (1 + 1e-9)
        assert way.length == pytest.approx(np.linalg.norm(np.diff(way.path, axis=0), axis=1).sum())


def test_the_front_falls_as_lengths_grow_from_the_shortest_way_to_the_best(found):
    _, _, result = found
    lengths, values = result.front.T
    assert (np.diff(lengths) > 0).all()
    assert (np.diff(values) < 0).all()
    assert lengths[0] == pytest.approx(result.shortest.length)
    assert values[-1] == pytest.approx(result.value, rel=1e-9)
    assert [way.value for way in result.on_front] == pytest.approx(values.tolist())


def test_alternatives_come_best_first_and_are_no_more_than_asked_for():
    graph, roadmap = scene(3)
    result = search(graph, roadmap, goal=roadmap.vertices[1], max_detour=2.0, num_alternatives=2)
    values = [way.value for way in (result.best, *result.alternatives)]
    assert values == sorted(values)
    assert len(values) == 3


def test_a_longer_limit_never_worsens_the_value_when_the_earlier_result_is_given():
    graph, roadmap = scene(6, num_vertices=14)
    result = None
    for detour in (1.0, 1.3, 1.7, 2.2):
        longer = search(graph, roadmap, goal=roadmap.vertices[1], max_detour=detour, earlier=result)
        assert result is None or longer.value <= result.value
        result = longer


def test_without_a_goal_the_value_is_at_least_as_good_as_with_any():
    graph, roadmap = scene(8, num_vertices=7)
    free = search(graph, roadmap, max_length=4.0)
    for goal in range(1, 4):
        if roadmap.distances_to(goal)[0] <= 4.0:
            assert free.value <= search(graph, roadmap, goal=roadmap.vertices[goal], max_length=4.0).value + 1e-9


def test_a_trip_that_returns_ends_where_it_began():
    graph, roadmap = scene(3)
    result = search(graph, roadmap, max_length=6.0, return_to_start=True, max_evaluations=300)
    np.testing.assert_array_equal(result.path[0], result.path[-1])
    assert len(result.path) > 1
    assert result.length <= 6.0
    assert result.value < result.value_now


def test_a_cost_that_no_gain_is_worth_keeps_the_robot_where_it_is():
    graph, roadmap = scene(3)
    result = search(graph, roadmap, max_length=5.0, cost_per_metre=1e6)
    assert result.path.tolist() == [roadmap.vertices[0].tolist()]
    assert result.value == pytest.approx(result.value_now)
    assert "stay" in result.summary()


def test_relabelling_the_roadmap_changes_nothing():
    graph, roadmap = scene(9)
    result = search(graph, roadmap, goal=roadmap.vertices[1], max_detour=1.8)
    order = np.r_[0, 1, 2 + np.random.default_rng(0).permutation(len(roadmap.vertices) - 2)]
    rank = np.argsort(order)
    edges = np.unique(np.sort(rank[roadmap.edges], axis=1), axis=0)
    relabelled = Roadmap(roadmap.world, roadmap.robot_radius, roadmap.region, roadmap.vertices[order], edges)
    again = search(graph, relabelled, goal=roadmap.vertices[1], max_detour=1.8)
    assert again.value == pytest.approx(result.value, rel=1e-9)
    np.testing.assert_allclose(again.path, result.path)


def test_the_same_seed_gives_the_same_result():
    graph, roadmap = scene(10)
    one, two = (search(graph, roadmap, goal=roadmap.vertices[1], max_detour=1.8, turn=None) for _ in range(2))
    np.testing.assert_array_equal(one.path, two.path)
    np.testing.assert_array_equal(one.front, two.front)
    assert one.lower_bound == two.lower_bound
    assert one.num_evaluations == two.num_evaluations


def test_where_nothing_is_seen_again_the_result_says_so():
    graph = tb.PoseGraph([[x, 0, 0] for x in range(4)], [(0, 1), (1, 2), (2, 3)], None, np.eye(3) * 100)
    vertices = np.array([(3, 0), (6, 0), (6, 2), (8, 1)], float)
    roadmap = Roadmap(OPEN, 0.1, OPEN.component((0, 0), 0.1), vertices, np.array([(0, 1), (0, 2), (1, 2), (1, 3), (2, 3)]))
    far = tb.ClosureModel(radius=0.5, probability=1.0)
    result = search(graph, roadmap, max_length=5.0, closures=far)
    assert not result.sees_map
    assert result.path.tolist() == [[3, 0]]
    assert result.summary().startswith("Nothing to gain within 5.0 m: no place in reach sees the map again.")
    to_goal = search(graph, roadmap, goal=(8, 1), closures=far, max_detour=1.0)
    assert to_goal.length == pytest.approx(to_goal.shortest.length)
    assert "Nothing to gain" in to_goal.summary()


def test_a_single_pose_has_no_error_to_lose():
    graph = tb.PoseGraph([[0.0, 0.0, 0.0]], np.zeros((0, 2), int), None, np.zeros((0, 3, 3)))
    vertices = np.array([[0.0, 0.0], [4.0, 0.0], [2.0, 1.0]])
    roadmap = Roadmap(OPEN, 0.1, OPEN.component((0.0, 0.0), 0.1), vertices, np.array([[0, 1], [0, 2], [1, 2]]))
    options = {"goal": (4, 0), "max_detour": 2.0, "objective": "error", "closures": CLOSURES, "information": np.eye(3)}
    found = tb.search_roadmap(graph, roadmap, **options)
    assert found.value == found.value_now == 0.0
    assert found.length == 4.0


def test_each_via_vertex_is_tried_alone_before_any_two():
    graph, roadmap = scene(6, num_vertices=20)
    walks = Walks(roadmap, 1, 8.0 + roadmap.distances_to(1)[0])
    planner = tb.Planner(graph, objective="map")
    evaluations = Evaluations(
        planner, lambda paths: tb.predict_actions(graph, paths, closures=CLOSURES, turn=None), roadmap.vertices, 0.0
    )
    candidates = spread_vias(walks, walks.in_reach, 60)
    local = LocalSearch(walks, evaluations, candidates, rng=np.random.default_rng(0))
    local.seed([walks.walk(())])
    alone = {walks.walk(()), *(walks.walk((via,)) for via in candidates.tolist())}
    assert len(alone) > 4
    while set(evaluations.objectives) != alone:
        assert local.step(2)
        assert set(evaluations.objectives) <= alone
    assert local.step(2)


def test_where_no_other_place_is_within_the_length_staying_is_proven():
    graph, roadmap = scene(3)
    assert search(graph, roadmap, max_length=0.0).path.tolist() == [roadmap.vertices[0].tolist()]
    result = search(graph, roadmap, max_length=1e-3, turn=None)
    assert result.path.tolist() == [roadmap.vertices[0].tolist()]
    assert (result.stopped_by, result.proven_optimal, result.gap) == ("proof", True, 0.0)
    assert result.lower_bound == result.value == pytest.approx(result.value_now)
    assert result.summary().startswith("Nothing to gain within 0.0 m")


def test_a_deadline_of_no_time_gives_the_shortest_way():
    graph, roadmap = scene(3)
    result = search(graph, roadmap, goal=roadmap.vertices[1], max_detour=2.0, deadline=0.0)
    assert result.stopped_by == "deadline"
    assert result.length == pytest.approx(roadmap.distances_to(1)[0])


def test_an_interrupt_gives_the_best_so_far():
    graph, roadmap = scene(3)
    told = []

    def interrupt(progress):
        told.append(progress)
        if len(told) == 2:
            raise KeyboardInterrupt

    result = search(graph, roadmap, goal=roadmap.vertices[1], max_detour=2.0, on_progress=interrupt)
    assert result.stopped_by == "interrupt"
    assert result.value == pytest.approx(told[-1].value)
    assert told[-1].num_evaluations == result.num_evaluations


def test_a_gap_that_is_good_enough_stops_the_search():
    graph, roadmap = scene(3)
    result = search(graph, roadmap, goal=roadmap.vertices[1], max_detour=2.0, gap=1e6, turn=None)
    assert result.stopped_by in ("gap", "proof")
    assert result.gap <= 1e6


def test_a_goal_that_is_no_vertex_is_joined_to_the_roadmap():
    world = tb.World.from_boxes([], bounds=(-4, -4, 8, 8))
    graph = drive(np.random.default_rng(1), num_poses=4)
    roadmap = tb.build_roadmap(world, graph.poses[-1], (3, 3), num_vertices=30, robot_radius=0.2)
    result = search(graph, roadmap, goal=(2.5, 1.25, 0.3), world=None, max_evaluations=100)
    assert result.path[-1].tolist() == [2.5, 1.25]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "expected max_length for a trip without a goal"),
        ({"goal": (0.5, 0.5), "return_to_start": True, "max_length": 3.0}, "leave out the goal to return"),
        ({"max_length": -1.0}, "expected a finite max_length of at least 0 m, got -1"),
        ({"max_length": math.inf}, "expected a finite max_length"),
        ({"max_length": 1.0, "cost_per_metre": -1.0}, "cost_per_metre of at least 0"),
        ({"max_length": 1.0, "deadline": -1.0}, "deadline of at least 0 seconds"),
        ({"max_length": 1.0, "gap": -1.0}, "gap of at least 0"),
        ({"max_length": 1.0, "num_alternatives": -1}, "num_alternatives of at least 0"),
        ({"max_length": 1.0, "objective": "beauty"}, "objective"),
        ({"goal": (0.5, 0.5), "max_detour": 0.9}, "max_detour of at least 1"),
        ({"goal": (math.nan, 0.5)}, "expected a finite goal"),
    ],
)
def test_bad_input_is_named(options, message):
    graph, roadmap = scene(3)
    with pytest.raises(tb.TopobeliefError, match=message):
        search(graph, roadmap, **options)


def test_a_limit_below_the_shortest_way_is_refused_with_its_length():
    graph, roadmap = scene(3)
    shortest = roadmap.distances_to(1)[0]
    with pytest.raises(tb.TopobeliefError, match=f"max_length of at least {shortest:.2f} m, the shortest way to the goal"):
        search(graph, roadmap, goal=roadmap.vertices[1], max_length=0.9 * shortest)


def test_a_goal_in_a_wall_is_refused():
    world = tb.World.from_boxes([(1, 1, 2, 2)], bounds=(-4, -4, 8, 8))
    graph = drive(np.random.default_rng(1), num_poses=4)
    roadmap = tb.build_roadmap(world, graph.poses[-1], (3, 3), num_vertices=30, robot_radius=0.2)
    with pytest.raises(tb.TopobeliefError, match="expected a goal with more clearance"):
        search(graph, roadmap, goal=(1.5, 1.5))


def test_a_graph_far_from_its_estimate_is_pointed_out():
    poses = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
    measured = [[5, 0, 0], [1, 0, 0], [2, 0, 0]]
    graph = tb.PoseGraph(poses, [(0, 1), (1, 2), (0, 2)], measured, np.eye(3) * 1e4)
    roadmap = Roadmap(OPEN, 0.1, OPEN.component((0, 0), 0.1), np.array([(2, 0), (3, 0), (3, 1.0)]), np.array([(0, 1), (1, 2)]))
    with pytest.warns(NotOptimizedWarning):
        search(graph, roadmap, max_length=2.0)


def test_a_result_reads_well(found):
    _, _, result = found
    assert repr(result).startswith("SearchResult(")
    assert len(repr(result)) < 140
    assert str(result) == result.summary()
    assert "The best way found is" in result.summary()
    assert "<table>" in result._repr_html_()


def test_the_bound_covers_closures_with_a_noise_of_their_own():
    """A graph with many closures that are twenty times as exact as its odometry: predictions take each noise from its kind."""
    rng = np.random.default_rng(5)
    plain = drive(rng, num_poses=24)
    chain = [(i, i + 1) for i in range(23)]
    loops = [(i, i + 12) for i in range(12)]
    omega = np.diag([100.0, 100.0, 400.0])
    graph = tb.PoseGraph(plain.poses, chain + loops, None, np.stack([omega] * 23 + [20 * omega] * 12))
    roadmap = small_roadmap(rng, graph, num_vertices=8)
    limit = 1.5 * roadmap.distances_to(1)[0]
    values = values_of(graph, roadmap, simple_walks(roadmap, limit, end=1), objective="map", closures=CLOSURES)
    result = search(graph, roadmap, goal=roadmap.vertices[1], max_length=limit, turn=None, deadline=2)
    assert result.lower_bound <= values.min() + 1e-9 * abs(values.min())


def test_no_bound_is_begun_that_the_time_does_not_allow(monkeypatch):
    graph, roadmap = scene(5, num_vertices=8)
    options = {"goal": roadmap.vertices[1], "max_detour": 1.5, "turn": None, "max_evaluations": 20, "deadline": 100.0}
    assert math.isfinite(search(graph, roadmap, **options).lower_bound)
    monkeypatch.setattr("topobelief.search.roadmap_search._TO_MAKE_BOUND", 1e6)
    assert math.isinf(search(graph, roadmap, **options).lower_bound)


def test_the_first_bound_may_take_the_time_of_refinement():
    """By a clock that goes on by 0.01 s whenever it is read: search alone has time for few steps, and the bound comes after."""
    graph, roadmap = scene(5, num_vertices=8)
    ticks = itertools.count()
    options = {"goal": roadmap.vertices[1], "max_detour": 1.5, "turn": None, "refine": True, "deadline": 0.5}
    found = search(graph, roadmap, clock=lambda: next(ticks) / 100, **options)
    assert math.isfinite(found.lower_bound)
    assert found.seconds < 0.7


def test_a_search_stops_after_so_many_evaluations_or_when_nothing_more_than_enough_is_left():
    graph, roadmap = scene(5, num_vertices=11)
    options = {"max_length": 5.0, "turn": None}
    few = search(graph, roadmap, max_evaluations=70, **options)
    assert few.stopped_by in ("evaluations", "proof")
    assert few.num_evaluations < 400
    assert search(graph, roadmap, enough=1e6, **options).stopped_by == "enough"
    for wrong in ({"enough": -1.0}, {"max_evaluations": 0}):
        with pytest.raises(InvalidInputError, match=next(iter(wrong))):
            search(graph, roadmap, **options, **wrong)


def test_what_closures_among_the_own_poses_of_a_way_gain_is_told():
    """There and back: poses on the way back may see those on the way out. The value without them is that of the planner."""
    graph, roadmap = scene(3)
    closures = tb.ClosureModel(radius=1.5, max_per_pose=3, probability=1.0, min_index_gap=3)
    result = search(graph, roadmap, max_length=8.0, return_to_start=True, closures=closures)
    own = (result.action.edges >= graph.num_poses).all(axis=1) & (
        np.arange(len(result.action.edges)) >= len(result.action.poses)
    )
    assert own.any()
    kept = tb.Action(result.action.poses, result.action.edges[~own], result.action.information[~own])
    assert result.value_with_map_alone == pytest.approx(tb.Planner(graph, objective="map").entropies([kept])[0], rel=1e-9)
    assert result.own_closures_gain > 1e-3
    without = search(graph, roadmap, goal=roadmap.vertices[1], max_detour=1.0)
    assert without.own_closures_gain == 0.0


def test_the_bound_does_not_end_the_search_where_walks_may_close_loops_with_themselves(monkeypatch):
    """The bound counts closures with the map alone, and here meets the value before the best walk is found."""
    monkeypatch.setattr(anytime, "_WARM_UP", 8)
    case = random_case(78)
    rule = {"closures": case.rule, "world": case.world, "spacing": case.spacing, "information": case.information}
    walks = case.walks()
    actions = tb.predict_actions(case.graph, [case.roadmap.vertices[walk] for walk in walks], turn=None, **rule)
    values = tb.Planner(case.graph, objective="joint").entropies(actions)
    values += case.cost_per_metre * np.array([case.length(walk) for walk in walks])
    assert case.goal is None
    result = search(
        case.graph,
        case.roadmap,
        max_length=case.max_length,
        return_to_start=case.return_to_start,
        objective="joint",
        cost_per_metre=case.cost_per_metre,
        **rule | {"turn": None},
    )
    assert result.value == pytest.approx(values.min(), abs=1e-6)
    assert result.lower_bound == pytest.approx(result.value)
    assert result.any_sees_itself
    assert "loops that it would close with itself not counted" in result.summary()


def test_no_step_of_the_bound_is_begun_that_would_end_after_the_deadline(monkeypatch):
    """On a clock by which each step takes seven seconds."""
    now, step = [0.0], FlowBound.step

    def slow_step(self):
        now[0] += 7.0
        return step(self)

    monkeypatch.setattr(FlowBound, "step", slow_step)
    graph, roadmap = scene(3)
    options = {"goal": roadmap.vertices[1], "max_detour": 2.5, "objective": "error", "turn": None, "deadline": 20.0}
    result = search(graph, roadmap, clock=lambda: now[0], **options)
    assert result.stopped_by == "deadline"
    assert now[0] == 14.0
    assert math.isfinite(result.lower_bound)


@pytest.mark.parametrize("cost", [0.0, 0.001])
def test_the_front_has_bounds_that_fall_and_stay_below_it(cost):
    graph, roadmap = scene(3)
    options = {"goal": roadmap.vertices[1], "max_detour": 2.5, "turn": None, "cost_per_metre": cost, "objective": "error"}
    result = search(graph, roadmap, max_evaluations=300, **options)
    metres, bounds = result.front_bounds.T
    assert (np.diff(metres) > 0).all()
    assert (np.diff(bounds) <= 0).all()
    assert metres[-1] == pytest.approx(result.max_length)
    assert all(result.bound_within(length) <= value for length, value in result.front)
    assert len(np.unique(bounds)) > 3
    if not cost:
        assert bounds[-1] >= result.lower_bound
    limit = float(result.front[len(result.front) // 2, 0])
    walks = simple_walks(roadmap, limit, end=1)
    values = values_of(graph, roadmap, walks, objective="error", closures=CLOSURES)
    assert result.bound_within(limit) <= values.min() + 1e-9 * abs(values.min())
    assert search(graph, roadmap, **(options | {"turn": 100.0}), max_evaluations=100).front_bounds.shape == (0, 2)


def test_what_the_shortest_walk_through_each_edge_leaves_of_the_limit():
    _, roadmap = scene(3)
    spare = spare_metres(roadmap, 0, 1, 30.0).reshape(2, -1)
    for edge, (a, b) in enumerate(roadmap.edges.tolist()):
        for way, (source, target) in enumerate([(a, b), (b, a)]):
            length = roadmap.distances_to(source)[0] + roadmap.lengths[edge] + roadmap.distances_to(1)[target]
            assert spare[way, edge] == pytest.approx(30.0 - length)
    assert spare.max() == pytest.approx(30.0 - roadmap.distances_to(1)[0])
    assert (spare_metres(roadmap, 0, None, 30.0) >= spare.ravel()).all()
