"""Roadmaps: free of collisions, connected, repeatable; and errors that name the place."""

from __future__ import annotations

from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from data_files import map_file
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

    def test_grows_until_start_and_goal_connect(self) -> None:
        """A few vertices do not get around a maze; the roadmap says so by its size."""
        walls = [(2 * i, 0, 2 * i + 0.2, 8.5) if i % 2 else (2 * i, 1.5, 2 * i + 0.2, 10) for i in range(1, 10)]
        maze = World.from_boxes(walls, (0, 0, 20, 10))
        roadmap = build_roadmap(maze, (1, 5), (19, 5), num_vertices=50)
        assert roadmap.shortest_path() is not None
        assert len(roadmap.vertices) > 50

    @pytest.mark.parametrize("width", [0.702, 0.72, 0.8])
    def test_finds_doors_that_leave_millimetres(self, width: float) -> None:
        world = World.from_boxes([(20, 0, 20.2, 10 - width / 2), (20, 10 + width / 2, 20.2, 20)], (0, 0, 40, 20))
        for seed in range(3):
            assert build_roadmap(world, (2, 2), (38, 18), num_vertices=500, seed=seed).shortest_path() is not None

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
        with pytest.raises(PlanningError, match=r"too narrow; a radius of some 0.2[3-6] m would get through"):
            build_roadmap(world, (1, 1), (9, 1))
        assert build_roadmap(world, (1, 1), (9, 1), robot_radius=0.23).shortest_path() is not None

    def test_a_passage_just_too_narrow_to_tell_by_erosion_is_reported_when_the_roadmap_has_grown(self) -> None:
        world = World.from_boxes([(5, 0, 5.2, 4), (5, 4.695, 5.2, 8)], (0, 0, 10, 8))
        with pytest.raises(PlanningError, match="found none with 640 vertices: some passage is hardly wider"):
            build_roadmap(world, (1, 1), (9, 1), num_vertices=40)

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
