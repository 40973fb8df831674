"""Homotopy: words are invariants of deformation, and the search finds the shortest path of each class."""

from __future__ import annotations

from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import LineString

from topobelief.candidates.homotopy import Rays, count_classes, inverse, joined, shortest_paths_by_class
from topobelief.candidates.roadmap import Roadmap, build_roadmap
from topobelief.world import World

letters = st.lists(st.sampled_from([-3, -2, -1, 1, 2, 3]), max_size=8).map(tuple)
words = letters.map(lambda spelled: joined((), spelled))


class TestWords:
    @given(words, words, words)
    def test_form_a_group(self, a: tuple, b: tuple, c: tuple) -> None:
        assert joined(joined(a, b), c) == joined(a, joined(b, c))
        assert joined(a, ()) == a == joined((), a)
        assert joined(a, inverse(a)) == () == joined(inverse(a), a)

    @given(letters)
    def test_are_reduced(self, spelled: tuple) -> None:
        assert all(first != -second for first, second in pairwise(joined((), spelled)))


RAYS = Rays(np.array([[1.0, 0.0], [3.0, 2.0], [3.0, -1.0]]))


class TestRays:
    def test_spell_what_a_path_crosses_and_which_way(self) -> None:
        """Above an origin the ray is crossed, below it not; the two that coincide come left one first."""
        above, below = np.array([(0.0, 5.0), (5.0, 5.0)]), np.array([(0.0, -5.0), (5.0, -5.0)])
        assert RAYS.word(above) == (1, 2, 3)
        assert RAYS.word(above[::-1]) == (-3, -2, -1)
        assert RAYS.word(below) == ()
        assert RAYS.word(np.array([(0.0, 1.0), (5.0, 1.0)])) == (1, 3)

    def test_a_loop_around_one_obstacle_is_its_letter_and_around_none_is_nothing(self) -> None:
        around = np.array([(0, -1), (2, -1), (2, 1), (0, 1), (0, -1)])
        assert RAYS.word(around) == (-1,)
        assert RAYS.word(np.vstack([around, around])) == (-1, -1)
        assert RAYS.word(around - 5) == ()

    def test_a_waypoint_on_a_ray_is_passed_once(self) -> None:
        """A path that stops on a ray, or touches it and turns back, is spelled like its neighbours."""
        assert RAYS.word(np.array([(0.0, 1.0), (1.0, 1.0), (2.0, 1.0)])) == (1,)
        assert RAYS.word(np.array([(0.0, 1.0), (1.0, 1.0), (0.0, 1.5)])) == ()
        assert RAYS.word(np.array([(2.0, 1.0), (1.0, 1.0), (2.0, 1.5)])) == ()

    @given(st.lists(st.tuples(st.floats(-1, 5), st.floats(-3, 5)), min_size=3, max_size=6), st.integers(1, 3))
    def test_a_waypoint_may_be_left_out_if_no_origin_lies_in_the_triangle(self, points: list, index: int) -> None:
        """The elementary deformation of a polyline."""
        path = np.array(points)
        index = min(index, len(path) - 2)
        a, b, c = path[index - 1 : index + 2]
        sides = [np.cross([*(q - p), 0], np.pad(RAYS.origins - p, ((0, 0), (0, 1))))[:, 2] for p, q in ((a, b), (b, c), (c, a))]
        outside = (np.min(sides, axis=0) < -1e-6) & (np.max(sides, axis=0) > 1e-6)
        if outside.all():
            assert RAYS.word(path) == RAYS.word(np.delete(path, index, axis=0))

    @given(st.lists(st.tuples(st.integers(-1, 5), st.integers(-3, 5)), min_size=2, max_size=6))
    def test_the_word_of_the_way_back_is_the_inverse(self, points: list) -> None:
        """Also with waypoints on rays, which integers make."""
        path = np.array(points, dtype=float)
        assert RAYS.word(path[::-1]) == inverse(RAYS.word(path))

    def test_stand_on_the_largest_obstacles_that_a_path_can_get_around(self) -> None:
        boxes = [(4, 4, 6, 6), (10, 4, 10.4, 4.4), (28, 18, 29, 19), (0, 14, 8, 15)]
        roadmap = build_roadmap(World.from_boxes(boxes, (0, 0, 30, 20)), (1, 5), (14, 5), num_vertices=50)
        assert len(Rays.of_obstacles(roadmap).origins) == 3, "the wall at the fence is none"
        near = Rays.of_obstacles(roadmap, max_length=20)
        assert len(near.origins) == 2
        assert (near.origins[0] >= 4).all()
        assert (near.origins[0] <= 6).all(), "the largest comes first"
        assert len(Rays.of_obstacles(roadmap, max_length=20, min_size=2.0).origins) == 1
        assert len(Rays.of_obstacles(roadmap, max_rays=2).origins) == 2
        assert len(Rays.of_obstacles(build_roadmap(World.from_boxes([], (0, 0, 9, 9)), (1, 1), (8, 8), 20)).origins) == 0


class TestSpecks:
    def test_make_no_class_however_many_and_obstacles_do(self) -> None:
        """A map full of specks and one pillar: the specks stand in nobody's way, and take no ray from the pillar."""
        x, y = np.meshgrid(np.arange(2, 28, 1.5), np.arange(2, 18, 1.5))
        specks = np.stack([x, y, x + 0.1, y + 0.05], axis=-1).reshape(-1, 4)
        specks = specks[~((specks[:, :2] > 8) & (specks[:, :2] < 12)).all(axis=1)]
        world = World.from_boxes([*specks, (9.5, 9.5, 10.0, 10.0)], (0, 0, 30, 20))
        roadmap = build_roadmap(world, (1, 1), (29, 19), num_vertices=300)
        (origin,) = Rays.of_obstacles(roadmap, max_rays=3).origins
        assert np.abs(origin - 9.75).max() < 0.7
        assert len(Rays.of_obstacles(roadmap, specks=True).origins) > 150

    @pytest.mark.parametrize(("length", "count"), [(0.6, 0), (1.2, 0), (1.8, 1), (6.0, 1)])
    def test_that_the_robot_cannot_pass_between_are_a_fence_if_long_enough(self, length: float, count: int) -> None:
        x = np.arange(0, length + 0.01, 0.6)
        posts = np.stack([x + 5, np.full_like(x, 5), x + 5.05, np.full_like(x, 5.05)], axis=1)
        roadmap = build_roadmap(World.from_boxes(posts, (0, 0, 16, 10)), (8, 1), (8, 9), num_vertices=100)
        assert len(Rays.of_obstacles(roadmap).origins) == count

    def test_are_smaller_for_a_smaller_robot(self) -> None:
        world = World.from_boxes([(5, 5, 5.2, 5.2)], (0, 0, 10, 10))
        counts = [len(Rays.of_obstacles(build_roadmap(world, (1, 1), (9, 9), 50, radius)).origins) for radius in (0.35, 0.25)]
        assert counts == [0, 1]


class TestCount:
    def test_is_of_all_classes_however_many_obstacles_there_are(self) -> None:
        """60 pillars in a row and a path above each of them, below the others: a class each."""
        x = 2.0 * np.arange(60) + 2
        pillars = np.stack([x, np.full_like(x, 4.5), x + 0.5, np.full_like(x, 5.5)], axis=1)
        roadmap = build_roadmap(World.from_boxes(pillars, (0, 0, 123, 10)), (0.5, 2), (122, 2), num_vertices=200)
        paths = [np.array([(0.5, 2), (a - 0.6, 2), (a - 0.6, 8), (a + 1.1, 8), (a + 1.1, 2), (122, 2)]) for a in x]
        assert count_classes(roadmap, paths) == (60, True)
        assert count_classes(roadmap, [*paths, *paths[:7]]) == (60, True)
        assert count_classes(roadmap, paths[:1]) == (1, True)

    def test_is_a_lower_bound_where_only_specks_part_some_paths(self) -> None:
        world = World.from_boxes([(4.5, 4, 5.5, 6), (5, 8, 5.05, 8.05)], (0, 0, 10, 10))
        roadmap = build_roadmap(world, (1, 5), (9, 5), num_vertices=100)
        below, above, far_above = (np.array([(1, 5), (5, y), (9, 5)]) for y in (2.0, 7.0, 9.5))
        assert count_classes(roadmap, [below, above]) == (2, True)
        assert count_classes(roadmap, [below, above, far_above]) == (2, False)


def lattice(columns: int, rows: int, seed: int) -> Roadmap:
    """A lattice of streets with crooked corners, from the lower left to the upper right one."""
    rng = np.random.default_rng(seed)
    number = np.arange(columns * rows).reshape(rows, columns)
    last = number[-1, -1]
    relabel = np.arange(columns * rows)
    relabel[[1, last]] = relabel[[last, 1]]
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    vertices = (np.stack([x.ravel(), y.ravel()], axis=1) + rng.uniform(-0.2, 0.2, (columns * rows, 2)))[relabel]
    streets = np.concatenate(
        [
            np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], axis=1),
            np.stack([number[:-1].ravel(), number[1:].ravel()], axis=1),
        ]
    )
    edges = np.unique(np.sort(relabel[streets], axis=1), axis=0)
    world = World.from_boxes([], (-1, -1, columns, rows))
    return Roadmap(world, 0.1, world.component((0, 0), 0.1), vertices, edges)


class TestSearch:
    @pytest.mark.parametrize("seed", range(4))
    def test_finds_the_shortest_classes_that_enumeration_finds(self, seed: int) -> None:
        """All simple paths of a lattice of streets around 6 blocks, by networkx, against the search."""
        roadmap = lattice(4, 3, seed)
        rays = Rays(np.array([(0.5, 0.5), (1.5, 0.5), (2.5, 0.5), (0.5, 1.5), (1.5, 1.5), (2.5, 1.5)]))
        graph = nx.Graph(roadmap.edges.tolist())
        lengths: dict[tuple, float] = {}
        for path in nx.all_simple_paths(graph, 0, 1):
            places = roadmap.vertices[path]
            length = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
            word = rays.word(places)
            lengths[word] = min(length, lengths.get(word, np.inf))
        found = shortest_paths_by_class(roadmap, rays, num_classes=12)
        found_words = [rays.word(roadmap.vertices[path]) for path in found]
        found_lengths = [np.linalg.norm(np.diff(roadmap.vertices[path], axis=0), axis=1).sum() for path in found]
        assert len(set(found_words)) == len(found) == 12
        np.testing.assert_allclose(found_lengths, sorted(lengths.values())[:12])
        np.testing.assert_allclose(found_lengths, [lengths[word] for word in found_words])

    def test_the_first_path_is_the_shortest_and_the_others_follow_by_length(self) -> None:
        boxes = [(4, 4, 6, 6), (4, 8, 6, 10), (4, 12, 6, 14)]
        roadmap = build_roadmap(World.from_boxes(boxes, (0, 0, 10, 20)), (1, 5), (9, 6), num_vertices=300)
        found = shortest_paths_by_class(roadmap, Rays.of_obstacles(roadmap), num_classes=4)
        lengths = [np.linalg.norm(np.diff(roadmap.vertices[path], axis=0), axis=1).sum() for path in found]
        assert found[0] == roadmap.shortest_path()
        assert lengths == sorted(lengths)
        assert len(found) == 4, "below all, above one, two, and all three"

    def test_no_class_is_longer_than_the_limit(self) -> None:
        boxes = [(4, 4, 6, 6), (4, 8, 6, 18)]
        roadmap = build_roadmap(World.from_boxes(boxes, (0, 0, 10, 20)), (1, 5), (9, 5), num_vertices=300)
        rays = Rays.of_obstacles(roadmap)
        everything = shortest_paths_by_class(roadmap, rays, num_classes=9)
        assert len(shortest_paths_by_class(roadmap, rays, num_classes=9, max_length=12)) == 2 < len(everything)

    def test_paths_that_cross_themselves_are_left_out_so_that_the_search_ends(self) -> None:
        """One pillar has two sides and infinitely many windings, of which few fit into the room as spirals."""
        roadmap = build_roadmap(World.from_boxes([(4, 4, 6, 6)], (0, 0, 10, 10)), (1, 5), (9, 5), num_vertices=200)
        rays = Rays.of_obstacles(roadmap)
        found = shortest_paths_by_class(roadmap, rays, num_classes=50)
        assert {rays.word(roadmap.vertices[path]) for path in found[:2]} == {(), (1,)}
        assert len(found) < 10
        assert all(LineString(roadmap.vertices[path]).is_simple for path in found)

    def test_without_obstacles_there_is_one_class(self) -> None:
        roadmap = build_roadmap(World.from_boxes([], (0, 0, 10, 10)), (1, 5), (9, 5), num_vertices=50)
        found = shortest_paths_by_class(roadmap, Rays.of_obstacles(roadmap), num_classes=5)
        assert found == [roadmap.shortest_path()]
