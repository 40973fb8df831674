"""Roadmaps: free of collisions, connected, repeatable; and errors that name the place."""

from __future__ import annotations

import re
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from data_files import map_file
from topobelief.candidates.polyline import path_length
from topobelief.candidates.roadmap import Roadmap, build_roadmap
from topobelief.errors import InvalidInputError, PlanningError
from topobelief.io.floor_plan import read_walls
from topobelief.world import World

BOXES = np.array([(4.0, 0.0, 4.5, 7.0), (8.0, 3.0, 8.5, 10.0), (11.0, 4.0, 12.5, 5.5)])
BOUNDS = (0.0, 0.0, 15.0, 10.0)
START, GOAL = (1.0, 1.0), (14.0, 9.0)
RADIUS = 0.35


@pytest.fixture(scope="module")
def world() -> World:
    return World.from_boxes(BOXES, BOUNDS)


@pytest.fixture(scope="module")
def roadmap(world: World) -> Roadmap:
    return build_roadmap(world, START, GOAL, num_vertices=300)


def least_clearance(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Least distance to boxes and bounds of 300 points on each segment, by the formula for one box."""
    shares = np.linspace(0, 1, 300)[:, None, None]
    points = (1 - shares) * starts + shares * ends
    outside = np.maximum(np.maximum(BOXES[:, :2] - points[..., None, :], points[..., None, :] - BOXES[:, 2:]), 0)
    to_boxes = np.linalg.norm(outside, axis=-1).min(axis=-1)
    to_bounds = np.minimum(points - BOUNDS[:2], np.array(BOUNDS[2:]) - points).min(axis=-1)
    return np.minimum(to_boxes, to_bounds).min(axis=0)


class TestRoadmap:
    def test_begins_with_start_and_goal_and_has_the_vertices_asked_for(self, roadmap: Roadmap) -> None:
        assert roadmap.vertices[:2].tolist() == [list(START), list(GOAL)]
        assert len(roadmap.vertices) >= 300

    def test_keeps_the_robot_clear_on_every_edge(self, roadmap: Roadmap) -> None:
        a, b = roadmap.edges.T
        assert least_clearance(roadmap.vertices[a], roadmap.vertices[b]).min() > RADIUS

    def test_keeps_the_robot_clear_at_every_vertex(self, roadmap: Roadmap) -> None:
        assert least_clearance(roadmap.vertices, roadmap.vertices).min() > RADIUS

    def test_lists_each_edge_once_with_its_length(self, roadmap: Roadmap) -> None:
        a, b = roadmap.edges.T
        assert (a < b).all()
        assert len(np.unique(roadmap.edges, axis=0)) == len(roadmap.edges)
        np.testing.assert_allclose(roadmap.lengths, np.hypot(*(roadmap.vertices[b] - roadmap.vertices[a]).T))

    def test_is_repeatable_by_seed(self, world: World) -> None:
        again, other = (build_roadmap(world, START, GOAL, num_vertices=300, seed=seed) for seed in (5, 6))
        first = build_roadmap(World.from_boxes(BOXES, BOUNDS), START, GOAL, num_vertices=300, seed=5)
        assert (first.vertices == again.vertices).all()
        assert (first.edges == again.edges).all()
        assert not (first.vertices == other.vertices).all()

    def test_ignores_headings(self, world: World) -> None:
        turned = build_roadmap(world, (*START, 1.0), (*GOAL, -2.0), num_vertices=300)
        assert (turned.vertices == build_roadmap(world, START, GOAL, num_vertices=300).vertices).all()

    def test_finds_the_shortest_paths_that_networkx_finds(self, roadmap: Roadmap) -> None:
        """Also with edges blocked, and none where a path may not be that long."""
        rng = np.random.default_rng(0)
        for blocked in (np.zeros(len(roadmap.edges), dtype=bool), rng.random(len(roadmap.edges)) < 0.5):
            graph = nx.Graph()
            graph.add_weighted_edges_from(
                (int(a), int(b), float(length))
                for (a, b), length in zip(roadmap.edges[~blocked], roadmap.lengths[~blocked], strict=True)
            )
            expected = nx.shortest_path_length(graph, 0, 1, weight="weight")
            path = roadmap.shortest_path(blocked=blocked)
            assert path is not None
            assert sum(graph.edges[edge]["weight"] for edge in pairwise(path)) == pytest.approx(expected)
            assert roadmap.shortest_path(blocked=blocked, max_length=0.999 * expected) is None
        assert roadmap.shortest_path(blocked=np.ones(len(roadmap.edges), dtype=bool)) is None

    def test_may_be_of_no_more_edges_than_its_shortest_path(self, world: World) -> None:
        """Whose length is their sum, added in another order."""
        rng = np.random.default_rng(0)
        edges = np.array([(0, 2), (1, 99), *((i, i + 1) for i in range(2, 99))])
        for _ in range(20):
            x = np.sort(rng.uniform(0, 10, 100))
            vertices = np.stack([np.r_[x[0], x[-1], x[1:-1]], np.zeros(100)], axis=1)
            path = Roadmap(world, RADIUS, world.component(START, RADIUS), vertices, edges).shortest_path()
            assert path is not None
            assert len(path) == 100

    def test_gets_around_a_maze_with_few_vertices(self) -> None:
        walls = [(2 * i, 0, 2 * i + 0.2, 8.5) if i % 2 else (2 * i, 1.5, 2 * i + 0.2, 10) for i in range(1, 10)]
        roadmap = build_roadmap(World.from_boxes(walls, (0, 0, 20, 10)), (1, 5), (19, 5), num_vertices=2)
        path = roadmap.shortest_path()
        assert path is not None
        assert roadmap.lengths.sum() > 60
        assert len(roadmap.vertices) < 200

    @pytest.mark.parametrize("width", [0.702, 0.72, 0.8])
    def test_finds_doors_that_leave_millimetres(self, width: float) -> None:
        world = World.from_boxes([(20, 0, 20.2, 10 - width / 2), (20, 10 + width / 2, 20.2, 20)], (0, 0, 40, 20))
        for seed in range(3):
            assert build_roadmap(world, (2, 2), (38, 18), num_vertices=500, seed=seed).shortest_path() is not None

    @pytest.mark.parametrize("radius", [0.05, 0.25, 0.599])
    def test_leads_through_both_doors_of_a_large_map_at_every_radius(self, radius: float) -> None:
        """Two doors 1.2 m wide in a wall 150 m long: with either one closed there is a way through the other."""
        walls = [(0, 74.8, 60, 75.2), (61.2, 74.8, 90, 75.2), (91.2, 74.8, 150, 75.2)]
        world = World.from_boxes(walls, (0, 0, 150, 150))
        for seed in range(2):
            roadmap = build_roadmap(world, (75, 50), (75, 100), robot_radius=radius, seed=seed)
            (x_a, y_a), (x_b, y_b) = roadmap.vertices[roadmap.edges].transpose(1, 2, 0)
            through = (y_a < 75) != (y_b < 75)
            for closed in (x_a + x_b < 150, x_a + x_b > 150):
                path = roadmap.shortest_path(blocked=through & closed)
                assert path is not None
                assert path_length(roadmap.vertices[path]) < 1.03 * 2 * np.hypot(25, 14.4)

    @pytest.mark.parametrize("radius", [0.15, 0.35])
    def test_in_a_forest_is_grown_until_its_shortest_path_is_within_1_percent(self, radius: float) -> None:
        pillars = np.random.default_rng(0).uniform(1.5, 28.5, (150, 2))
        world = World.from_boxes(np.hstack([pillars - 0.25, pillars + 0.25]), (0, 0, 30, 30))
        start, goal = (0.7, 0.7), (29.3, 29.3)
        expected = shortest_by_visibility(world, pillars, 0.25, np.array([start, goal]), radius)
        for seed in range(2):
            roadmap = build_roadmap(world, start, goal, num_vertices=300, robot_radius=radius, seed=seed)
            path = roadmap.shortest_path()
            assert path is not None
            assert path_length(roadmap.vertices[path]) < 1.01 * expected

    @pytest.mark.parametrize(("scale", "radius"), [(1.0, 1e-4), (1.0, 1e-7), (1000.0, 0.35)])
    def test_is_no_larger_for_a_radius_far_below_the_size_of_the_world(self, world: World, scale: float, radius: float) -> None:
        """As in a map in millimetres with the radius in metres."""
        scaled = World.from_boxes(scale * BOXES, scale * np.array(BOUNDS))
        start, goal = scale * np.array(START), scale * np.array(GOAL)
        assert len(build_roadmap(scaled, start, goal, num_vertices=100, robot_radius=radius).vertices) == 100

    def test_takes_another_start_and_goal(self, roadmap: Roadmap) -> None:
        other = roadmap.between((1, 9), (10, 1))
        assert other.vertices[:2].tolist() == [[1, 9], [10, 1]]
        path = other.shortest_path()
        assert path is not None
        places = other.vertices[path]
        assert least_clearance(places[:-1], places[1:]).min() > RADIUS
        assert roadmap.between(START, (*GOAL, 0.5)) is roadmap

    def test_far_from_the_origin_is_the_same(self, world: World) -> None:
        """In coordinates as large as those of a national grid."""
        offset = np.array([4.5e5, 5.2e6])
        far = World.from_boxes(BOXES + np.tile(offset, 2), BOUNDS + np.tile(offset, 2))
        there = build_roadmap(far, START + offset, GOAL + offset, num_vertices=200)
        here = build_roadmap(world, START, GOAL, num_vertices=200)
        apart = np.linalg.norm(there.vertices[:, None] - offset - here.vertices, axis=2).min(axis=1)
        assert np.mean(apart < 1e-6) > 0.95, "all but places that touch to rounding"
        a, b = there.edges.T
        assert least_clearance(there.vertices[a] - offset, there.vertices[b] - offset).min() > RADIUS - 1e-9

    def test_is_built_where_the_robot_has_no_more_than_a_hair_of_room(self) -> None:
        corridor = World.from_boxes([], (0, 0, 10, 0.7 + 1e-7))
        assert build_roadmap(corridor, (1, 0.35 + 5e-8), (9, 0.35 + 5e-8), num_vertices=100).shortest_path() is not None

    def test_in_the_office_connects_the_papers_sessions(self) -> None:
        office = read_walls(map_file("willow_walls.csv"), bounds=(7, -9, 29, 9.5))
        for start, goal in (((20, 0), (26, 8)), ((26, 8), (25, -2.95))):
            for seed in range(3):
                roadmap = build_roadmap(office, start, goal, seed=seed)
                assert len(roadmap.vertices) == 1000
                assert roadmap.shortest_path() is not None


def shortest_by_visibility(world: World, pillars: np.ndarray, half: float, ends: np.ndarray, radius: float) -> float:
    """Length of the shortest path among square pillars for a disc, by all straight ways between points around their corners.

    With 4 points to a corner it is at most 2 % of the radius off at each; points too far for a way 8 % too long are left out.
    """
    angles = np.pi / 8 * np.arange(4) + np.pi / 16
    offset = 1.001 * radius / np.cos(np.pi / 16) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    signs = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)])
    around = (pillars[:, None, None] + signs[:, None] * (half + offset)).reshape(-1, 2)
    detour = np.linalg.norm(around[:, None] - ends, axis=2).sum(axis=1)
    around = around[detour < 1.08 * np.linalg.norm(ends[1] - ends[0])]
    places = np.concatenate([ends, around[world.segments_free(around, around, radius)]])
    a, b = np.triu_indices(len(places), k=1)
    near = np.linalg.norm(places[b] - places[a], axis=1) < 8
    a, b = a[near], b[near]
    free = world.segments_free(places[a], places[b], radius)
    edges = np.stack([a[free], b[free]], axis=1)
    path = Roadmap(world, radius, world.component(ends[0], radius), places, edges).shortest_path()
    assert path is not None
    return path_length(places[path])


@settings(max_examples=10)
@given(st.integers(0, 1000), st.floats(0.1, 0.6))
def test_every_edge_is_free_at_any_radius_and_seed(seed: int, radius: float) -> None:
    roadmap = build_roadmap(World.from_boxes(BOXES, BOUNDS), START, GOAL, num_vertices=60, robot_radius=radius, seed=seed)
    a, b = roadmap.edges.T
    assert least_clearance(roadmap.vertices[a], roadmap.vertices[b]).min() > radius


class TestErrors:
    @pytest.mark.parametrize(
        ("start", "goal", "message"),
        [
            ((4.2, 1), GOAL, r"start with more clearance .* 0.35 m, got \(4.2, 1\), in an obstacle or unknown space"),
            ((3.8, 1), GOAL, r"got \(3.8, 1\), 0.20 m from the nearest obstacle; choose"),
            (START, (12, 5), r"goal with more clearance .* got \(12, 5\), in an obstacle"),
            (START, (15.5, 5), r"goal on the map, x 0 to 15 and y 0 to 10, got \(15.5, 5\)"),
            ((1, -3), GOAL, r"start on the map, .* got \(1, -3\)"),
            (START, START, r"goal away from the start, got \(1, 1\)"),
        ],
    )
    def test_a_start_or_goal_that_will_not_do_is_named(
        self, world: World, roadmap: Roadmap, start: tuple, goal: tuple, message: str
    ) -> None:
        with pytest.raises(PlanningError, match=message):
            build_roadmap(world, start, goal)
        with pytest.raises(PlanningError, match=message):
            roadmap.between(start, goal)

    def test_a_goal_behind_a_wall_is_unreachable_for_any_robot(self) -> None:
        world = World.from_boxes([(5, 0, 5.2, 8)], (0, 0, 10, 8))
        with pytest.raises(PlanningError, match=r"from the start \(1, 1\), got \(9, 1\): walls separate them"):
            build_roadmap(world, (1, 1), (9, 1))

    def test_a_goal_behind_a_narrow_door_is_reachable_for_the_radius_that_the_error_names(self) -> None:
        world = World.from_boxes([(5, 0, 5.2, 4), (5, 4.5, 5.2, 8)], (0, 0, 10, 8))
        for radius in (0.255, 0.35, 0.8):
            named = radius_named(world, (1, 1), (9, 1), radius)
            assert 0.2495 < named < 0.25
            assert build_roadmap(world, (1, 1), (9, 1), robot_radius=named).shortest_path() is not None

    @pytest.mark.parametrize("radius", [0.25, 0.262, 0.28, 0.3])
    def test_the_radius_named_gets_through_a_diagonal_corridor_of_square_cells(self, radius: float) -> None:
        cells = 0.05 * (np.arange(200) + 0.5)
        x, y = np.meshgrid(cells, cells)
        free = (np.abs(0.8 * y - 0.6 * x - 1) < 0.26) | (np.hypot(x - 1, y - 2) < 0.6) | (np.hypot(x - 9, y - 8) < 0.6)
        world = World.from_cells(free, 0.05)
        named = radius_named(world, (1, 2), (9, 8), radius)
        assert 0.2 < named < radius
        assert build_roadmap(world, (1, 2), (9, 8), robot_radius=named).shortest_path() is not None

    @pytest.mark.parametrize("radius", [0.35, 0.5])
    def test_through_a_gap_of_two_radii_the_robot_does_not_fit(self, radius: float) -> None:
        world = World.from_boxes([(5, 0, 5.2, 4), (5, 4 + 2 * radius, 5.2, 8)], (0, 0, 10, 8))
        with pytest.raises(PlanningError, match="it does not fit through the passages"):
            build_roadmap(world, (1, 1), (9, 1), robot_radius=radius)
        assert 0.999 * radius < radius_named(world, (1, 1), (9, 1), radius) < radius

    def test_a_place_that_the_roadmap_does_not_reach_is_named(self) -> None:
        world = World.from_boxes([(5, 0, 5.2, 8)], (0, 0, 10, 8))
        roadmap = build_roadmap(world, (1, 1), (4, 7), num_vertices=50)
        with pytest.raises(PlanningError, match=r"join the roadmap, got \(1, 1\) and \(9, 1\)"):
            roadmap.between((1, 1), (9, 1))

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ({"start": (1, np.nan)}, "finite start"),
            ({"goal": (1,)}, "finite goal"),
            ({"robot_radius": 0.0}, "robot radius above 0"),
            ({"robot_radius": np.nan}, "robot radius above 0"),
            ({"num_vertices": 1}, "at least 2 vertices"),
        ],
    )
    def test_arguments_out_of_range_are_refused(self, world: World, arguments: dict, message: str) -> None:
        with pytest.raises(InvalidInputError, match=message):
            build_roadmap(**{"world": world, "start": START, "goal": GOAL} | arguments)


def radius_named(world: World, start: tuple, goal: tuple, radius: float) -> float:
    """The radius of which the error says that it would get through."""
    with pytest.raises(PlanningError) as caught:
        build_roadmap(world, start, goal, robot_radius=radius)
    (named,) = re.findall(r"a radius of (\S+) m would get through", str(caught.value))
    return float(named)


def test_without_a_goal_the_roadmap_reaches_all_over():
    world = World.from_boxes([(4, 0, 4.2, 7)], bounds=(0, 0, 20, 10))
    roadmap = build_roadmap(world, (1, 1), num_vertices=100, robot_radius=0.2)
    lengths = roadmap.distances_to(0)
    assert np.linalg.norm(roadmap.vertices[1] - (1, 1)) > 10
    assert np.isfinite(lengths).all()
    assert roadmap.vertices[:, 0].max() > 18
    with pytest.raises(PlanningError, match="expected a start"):
        build_roadmap(world, (4.1, 3), robot_radius=0.2)
