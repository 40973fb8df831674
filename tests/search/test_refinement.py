"""Ways bettered off the vertices of a roadmap: never worse, within the length, free, and walks of the roadmap searched on."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import topobelief as tb
from topobelief.candidates.roadmap_graph import with_way
from topobelief.search import refinement
from topobelief.search.refinement import Refinement

CLOSURES = tb.ClosureModel(max_per_pose=1, probability=1.0)
HALL = tb.World.from_boxes([(4, 3, 6, 5)], bounds=(0, 0, 10, 8))
GOAL = (9.0, 7.0)


@pytest.fixture(scope="module")
def scene():
    """A drive along one wall of a hall with a pillar, and a coarse roadmap."""
    places = [(x, 1.0, 0) for x in range(1, 10)]
    graph = tb.PoseGraph(places, [(i, i + 1) for i in range(8)], None, np.diag([400.0, 400.0, 1600.0]))
    return graph, tb.build_roadmap(HALL, (9, 1), GOAL, num_vertices=40, robot_radius=0.3)


def search(scene, **options):
    graph, roadmap = scene
    asked = {"goal": GOAL, "max_detour": 2.5, "closures": CLOSURES, "world": HALL, "max_evaluations": 400, "refine": True}
    return tb.search_roadmap(graph, roadmap, **{**asked, **options})


def test_a_refined_way_is_better_free_within_the_length_and_what_the_planner_says(scene):
    graph, roadmap = scene
    plain, found = search(scene, refine=False), search(scene)
    assert found.value < 0.99 * plain.value
    assert found.length <= found.max_length * (1 + 1e-9)
    assert HALL.segments_free(found.path[:-1], found.path[1:], roadmap.robot_radius).all()
    np.testing.assert_array_equal(found.path[[0, -1]], [(9, 1), GOAL])
    assert tb.Planner(graph, objective="error").entropies([found.action])[0] == pytest.approx(found.value, rel=1e-9)
    assert found.lower_bound <= found.value
    assert found.front[-1, 1] == pytest.approx(found.value, rel=1e-9)
    assert found.num_evaluations <= 400 + 64


def test_the_same_seed_gives_the_same_way(scene):
    np.testing.assert_array_equal(search(scene).path, search(scene).path)


def test_an_earlier_refined_way_is_not_lost_with_a_longer_limit(scene):
    short = search(scene, max_detour=1.6)
    assert search(scene, max_detour=1.8, earlier=short, max_evaluations=2).value <= short.value * (1 + 1e-9)


def test_staying_has_no_waypoints_to_move(scene):
    _, roadmap = scene
    assert not Refinement(roadmap.vertices[:1], 1.0, roadmap, 5.0, rng=np.random.default_rng(0)).step(len)
    more, walk = with_way(roadmap, roadmap.vertices[:1])
    assert walk == (0,)
    np.testing.assert_array_equal(more.edges, roadmap.edges)


def test_ctrl_c_keeps_the_best_so_far(scene, monkeypatch):
    def interrupted(self, values_of):
        raise KeyboardInterrupt

    monkeypatch.setattr(Refinement, "step", interrupted)
    found = search(scene)
    assert found.stopped_by == "interrupt"
    assert found.value <= found.shortest.value


def test_a_refinement_rests_where_nothing_is_better(scene):
    _, roadmap = scene
    path = roadmap.vertices[roadmap.shortest_path()]
    refined = Refinement(path, 1.0, roadmap, 20.0, rng=np.random.default_rng(0))
    steps = 0
    while refined.step(lambda paths: np.full(len(paths), 1.0)):
        steps += 1
    assert steps == refinement._PATIENCE
    assert refined.path is path


def test_moves_of_different_waypoints_are_tried_together(scene):
    """The value is the sum of distances from a line, so a move towards it helps whatever the others do."""
    _, roadmap = scene
    path = np.array([(9, 1), (8, 1.5), (8, 3), (8, 5), (8, 6.5), (9, 7)])
    refined, moved = Refinement(path, 2.0, roadmap, 30.0, rng=np.random.default_rng(1)), []

    def values(paths):
        moved.append(int((paths[0] != refined.path).any(axis=1).sum()) if paths[0].shape == path.shape else 0)
        return np.array([np.abs(each[1:-1, 0] - 7.5).sum() + 10 * abs(len(each) - len(path)) for each in paths])

    while refined.step(values):
        pass
    assert refined.value < 0.2
    assert max(moved) > 1


def test_a_way_becomes_a_walk_of_the_roadmap(scene):
    _, roadmap = scene
    path = np.array([(9, 1), (8.1, 2.2), (8.1, 2.2), (8.3, 5.9), (9, 7)])
    more, walk = with_way(roadmap, path)
    np.testing.assert_allclose(more.vertices[list(walk)], path[[0, 1, 3, 4]])
    np.testing.assert_array_equal(more.vertices[: len(roadmap.vertices)], roadmap.vertices)
    edges = {tuple(edge) for edge in more.edges.tolist()}
    assert all(tuple(sorted(pair)) in edges for pair in itertools.pairwise(walk))
    assert {tuple(edge) for edge in roadmap.edges.tolist()} <= edges
