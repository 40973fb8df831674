"""Diverse paths: free, different, within the detour limit, a class each first; repeatable by seed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from data_files import data_file, map_file
from topobelief.candidates.distinct_paths import DistinctPaths
from topobelief.candidates.diverse_paths import diverse_paths
from topobelief.candidates.homotopy import Rays, shortest_paths_by_class
from topobelief.candidates.polyline import path_length
from topobelief.candidates.roadmap import Roadmap, build_roadmap
from topobelief.errors import InvalidInputError, PlanningError
from topobelief.io.floor_plan import read_walls, read_world
from topobelief.io.formats import read_pose_graph
from topobelief.world import World

START, GOAL = (1.0, 5.0), (19.0, 5.0)
PILLARS = [(6, 4, 7, 6), (12, 3.5, 13, 6.5)]


@pytest.fixture(scope="module")
def roadmap() -> Roadmap:
    return build_roadmap(World.from_boxes(PILLARS, (0, 0, 20, 10)), START, GOAL, num_vertices=400)


def words(roadmap: Roadmap, paths: list[np.ndarray]) -> list[tuple]:
    rays = Rays.of_obstacles(roadmap)
    return [rays.word(path) for path in paths]


def check(roadmap: Roadmap, paths: list[np.ndarray], start: tuple, goal: tuple, max_detour: float | None) -> None:
    """What holds for any paths: they are free, joined to start and goal, different, sorted and not too long."""
    lengths = [path_length(path) for path in paths]
    assert lengths == sorted(lengths)
    if max_detour is not None:
        assert lengths[-1] <= max_detour * lengths[0]
    for path in paths:
        assert path[0].tolist() == list(start)
        assert path[-1].tolist() == list(goal)
        assert roadmap.world.segments_free(path[:-1], path[1:], roadmap.robot_radius).all()
    assert len({path.tobytes() for path in paths}) == len(paths)


class TestPaths:
    @pytest.mark.parametrize("max_detour", [1.05, 1.3, 3.0, None])
    def test_are_free_different_and_within_the_limit(self, roadmap: Roadmap, max_detour: float | None) -> None:
        paths = diverse_paths(roadmap, START, GOAL, num_paths=20, max_detour=max_detour)
        check(roadmap, paths, START, GOAL, max_detour)
        assert len(paths) == 20

    def test_pass_two_pillars_on_all_sides(self, roadmap: Roadmap) -> None:
        """Two pillars in a row are passed in 2 x 2 ways; with one path for each, no other is made."""
        paths = diverse_paths(roadmap, START, GOAL, num_paths=4, max_detour=1.5)
        assert len(set(words(roadmap, paths))) == 4
        filled_up = diverse_paths(roadmap, START, GOAL, num_paths=12, max_detour=1.5)
        assert len(filled_up) == 12
        assert set(words(roadmap, filled_up)) == set(words(roadmap, paths))

    def test_are_as_many_as_asked_for_at_most(self, roadmap: Roadmap) -> None:
        for num_paths in (1, 3, 7):
            assert len(diverse_paths(roadmap, START, GOAL, num_paths=num_paths)) == num_paths

    def test_begin_with_the_shortest_which_is_no_longer_than_the_roadmaps(self, roadmap: Roadmap) -> None:
        shortest = roadmap.shortest_path()
        assert shortest is not None
        paths = diverse_paths(roadmap, START, GOAL)
        assert path_length(paths[0]) <= path_length(roadmap.vertices[shortest])
        straight = np.hypot(18, 0)
        assert straight < path_length(paths[0]) < 1.05 * straight

    def test_are_repeatable_by_seed(self, roadmap: Roadmap) -> None:
        first, again, other = (diverse_paths(roadmap, START, GOAL, seed=seed) for seed in (3, 3, 4))
        assert all((a == b).all() for a, b in zip(first, again, strict=True))
        assert any(a.shape != b.shape or (a != b).any() for a, b in zip(first, other, strict=True))

    def test_cut_corners_without_leaving_their_class(self, roadmap: Roadmap) -> None:
        """The paths of the classes are in the classes that the search found."""
        rays = Rays.of_obstacles(roadmap)
        found = shortest_paths_by_class(roadmap, rays, num_classes=4)
        paths = diverse_paths(roadmap, START, GOAL, num_paths=4, max_detour=None)
        assert {rays.word(roadmap.vertices[path]) for path in found} == set(words(roadmap, paths))

    def test_may_start_and_end_elsewhere(self, roadmap: Roadmap) -> None:
        start, goal = (2.0, 2.0), (10.0, 9.0)
        check(roadmap, diverse_paths(roadmap, (*start, 1.0), goal, num_paths=5), start, goal, 1.3)

    def test_where_there_is_one_narrow_way_it_is_the_only_one(self) -> None:
        """A corridor hardly wider than the robot: fewer paths than asked for come back."""
        world = World.from_boxes([], (0, 0, 30, 0.8))
        roadmap = build_roadmap(world, (1, 0.4), (29, 0.4), num_vertices=200)
        paths = diverse_paths(roadmap, (1, 0.4), (29, 0.4))
        assert len(paths) == 1
        assert path_length(paths[0]) == pytest.approx(28, rel=1e-3)

    def test_of_a_thousand_pillars_those_that_are_as_large_as_a_ball_make_classes(self) -> None:
        x, y = np.meshgrid(np.arange(2, 98, 3.0), np.arange(2, 98, 3.0))
        pillars = np.stack([x, y, x + 0.5, y + 0.5], axis=-1).reshape(-1, 4)
        block = [(30, 30, 60, 60)]
        keep = ~((pillars[:, :2] > 28) & (pillars[:, :2] < 61)).all(axis=1)
        world = World.from_boxes([*pillars[keep], *block], (0, 0, 100, 100))
        roadmap = build_roadmap(world, (1, 1), (99, 99), num_vertices=1500)
        paths = diverse_paths(roadmap, (1, 1), (99, 99), num_paths=10)
        check(roadmap, paths, (1, 1), (99, 99), 1.3)
        assert len(paths) == 10
        centre = Rays(np.array([[45.0, 45.0]]))
        assert len({centre.word(path) for path in paths}) == 2, "both sides of the block are taken"

    def test_that_fill_up_are_further_apart_than_a_sixteenth_of_a_ball_and_as_many_as_asked_for(self, roadmap: Roadmap) -> None:
        paths = diverse_paths(roadmap, START, GOAL, num_paths=150)
        check(roadmap, paths, START, GOAL, 1.3)
        assert len(paths) == 150
        assert len(set(words(roadmap, paths))) == 4
        distinct = DistinctPaths(roadmap.vertices[:20])
        for path in paths:
            assert not distinct.any_within(path, 0.04 / 16 * 18)
            distinct.add(path)

    def test_fill_up_where_balls_are_smaller_than_the_robot(self) -> None:
        """In a small room: 4 % of the way is 0.15 m."""
        world = World.from_boxes([(2, 1.5, 2.4, 1.9)], (0, 0, 5, 4))
        roadmap = build_roadmap(world, (0.6, 2), (4.4, 2), num_vertices=300)
        assert len(diverse_paths(roadmap, (0.6, 2), (4.4, 2), num_paths=20)) == 20

    @pytest.mark.parametrize("max_detour", [1.0, 1.0001])
    def test_are_few_where_the_limit_leaves_no_room(self, roadmap: Roadmap, max_detour: float) -> None:
        assert 1 <= len(diverse_paths(roadmap, START, GOAL, num_paths=20, max_detour=max_detour)) < 20

    def test_on_a_map_with_salt_are_as_wide_spread_as_on_the_clean_one(self, tmp_path: Path) -> None:
        """One cell in a thousand of the depot is occupied by noise: the classes of the specks take no path's place."""
        clean, start, goal = map_file("depot.yaml"), (12, 14.5), (1, 1)

        def spread(file: Path) -> float:
            lengths = [path_length(path) for path in diverse_paths(build_roadmap(read_world(file), start, goal), start, goal)]
            assert len(lengths) == 20
            return lengths[-1] - lengths[0]

        salted: list[float] = []
        for seed in range(3):
            image = np.array(Image.open(clean.with_suffix(".pgm")))
            image[np.random.default_rng(seed).random(image.shape) < 0.001] = 0
            Image.fromarray(image).save(tmp_path / "depot.pgm")
            (tmp_path / "depot.yaml").write_text(clean.read_text())
            salted.append(spread(tmp_path / "depot.yaml"))
        assert np.median(salted) > 0.9 * spread(clean) > 4.0

    def test_in_the_office_are_20_with_at_least_3_classes_within_2_5_times_the_shortest(self) -> None:
        office = read_walls(map_file("willow_walls.csv"), bounds=(7, -9, 29, 9.5))
        start, goal = (26, 8), (25, -2.95)
        for seed in range(2):
            roadmap = build_roadmap(office, start, goal, seed=seed)
            for max_detour in (1.3, 2.5, None):
                paths = diverse_paths(roadmap, start, goal, num_paths=20, max_detour=max_detour, seed=seed)
                check(roadmap, paths, start, goal, max_detour)
                assert len(paths) == 20
                assert path_length(paths[0]) < 12.8
                near = [path for path in paths if path_length(path) <= 2.5 * path_length(paths[0])]
                assert max_detour == 1.3 or len(set(words(roadmap, near))) >= 3

    def test_along_a_trajectory_lead_back_through_where_the_robot_has_been(self) -> None:
        graph = read_pose_graph(data_file("manhattan3500.g2o"))
        world = World.from_trajectory(graph)
        start, goal = graph.poses[-1], graph.poses[1000]
        roadmap = build_roadmap(world, start, goal)
        paths = diverse_paths(roadmap, start, goal, num_paths=5)
        check(roadmap, paths, tuple(start[:2]), tuple(goal[:2]), 1.3)
        assert len(paths) == 5


class TestErrors:
    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ({"num_paths": 0}, "at least 1 path, got 0"),
            ({"max_detour": 0.9}, "at least 1 times the shortest path, or None, got 0.9"),
            ({"max_detour": np.nan}, "detour limit .* got nan"),
            ({"ball_radius": 0.0}, "ball radius between 0 and 0.5"),
            ({"ball_radius": 0.5}, "ball radius between 0 and 0.5"),
            ({"max_rays": -1}, "max_rays of at least 0, got -1"),
        ],
    )
    def test_arguments_out_of_range_are_refused(self, roadmap: Roadmap, arguments: dict, message: str) -> None:
        with pytest.raises(InvalidInputError, match=message):
            diverse_paths(roadmap, START, GOAL, **arguments)

    def test_a_goal_in_a_pillar_is_named(self, roadmap: Roadmap) -> None:
        with pytest.raises(PlanningError, match=r"goal with more clearance .* got \(6.5, 5\), in an obstacle"):
            diverse_paths(roadmap, START, (6.5, 5))

    def test_a_roadmap_that_does_not_connect_is_refused(self, roadmap: Roadmap) -> None:
        loose = Roadmap(roadmap.world, 0.35, roadmap.region, roadmap.vertices, roadmap.edges[:0])
        with pytest.raises(PlanningError, match="build it with build_roadmap"):
            diverse_paths(loose, START, GOAL)
