"""Walks by their via-vertices, and points of a front."""

import itertools

import numpy as np
import pytest
from scipy.spatial import Delaunay

from small_roadmaps import OPEN
from topobelief.candidates.roadmap import Roadmap
from topobelief.search.front import on_front, spread_on_front
from topobelief.search.local_search import spread_vias
from topobelief.search.walks import Walks


@pytest.fixture(scope="module")
def roadmap():
    vertices = np.random.default_rng(0).uniform(0, 10, (40, 2))
    triangles = Delaunay(vertices).simplices
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [0, 2]]])
    return Roadmap(OPEN, 0.1, OPEN.component((0, 0), 0.1), vertices, np.unique(np.sort(edges, axis=1), axis=0))


def test_a_walk_leads_along_edges_through_its_via_vertices_in_order(roadmap):
    walks = Walks(roadmap, 1, 100.0)
    walk = walks.walk((7, 20, 3))
    edges = set(map(tuple, roadmap.edges.tolist()))
    assert all(tuple(sorted(pair)) in edges for pair in itertools.pairwise(walk))
    assert walk[0] == 0
    assert walk[-1] == 1
    assert walk.index(7) <= walk.index(20)
    assert walks.length((7, 20, 3)) == pytest.approx(walks.lengths_along(walk)[-1])


@pytest.mark.parametrize("end", [None, 0, 1])
def test_the_via_vertices_of_a_walk_describe_it(roadmap, end):
    walks, rng = Walks(roadmap, end, 100.0), np.random.default_rng(1)
    for _ in range(20):
        walk = walks.walk(rng.integers(2, 40, 3).tolist())
        vias = walks.vias(walk)
        assert walks.walk(vias) == walk
        assert len(vias) <= 4 if end is None else 3


def test_a_shortest_way_needs_no_via_vertex(roadmap):
    walks = Walks(roadmap, 1, 100.0)
    assert walks.walk(()) == tuple(roadmap.shortest_path())
    assert walks.vias(walks.walk(())) == ()
    assert Walks(roadmap, 0, 1.0).walk(()) == (0,)
    assert Walks(roadmap, None, 1.0).walk(()) == (0,)


def test_in_reach_is_what_a_walk_within_the_length_passes(roadmap):
    limit = 1.2 * roadmap.distances_to(1)[0]
    through = roadmap.distances_to(0) + roadmap.distances_to(1)
    np.testing.assert_array_equal(Walks(roadmap, 1, limit).in_reach, through <= limit * (1 + 1e-9))
    np.testing.assert_array_equal(Walks(roadmap, None, 4.0).in_reach, roadmap.distances_to(0) <= 4.0)


def test_candidates_are_in_reach_and_the_useful_ones_come_first(roadmap):
    walks, useful = Walks(roadmap, None, 6.0), np.arange(40) % 3 == 0
    few, many = spread_vias(walks, useful, 5), spread_vias(walks, useful, 100)
    assert useful[few].all()
    assert len(set(few.tolist())) == 5
    assert sorted(many.tolist()) == np.flatnonzero(walks.in_reach).tolist()


def test_a_front_holds_what_nothing_shorter_is_as_good_as():
    rng = np.random.default_rng(2)
    lengths, values = rng.integers(0, 9, 50).astype(float), rng.integers(0, 9, 50).astype(float)
    front = on_front(lengths, values)
    for index in range(50):
        better = ((lengths <= lengths[index]) & (values < values[index])).any()
        better |= ((lengths < lengths[index]) & (values <= values[index])).any()
        same = any(lengths[k] == lengths[index] and values[k] == values[index] for k in front)
        assert same == (not better)
    assert (np.diff(lengths[front]) > 0).all()
    assert (np.diff(values[front]) < 0).all()


def test_points_spread_over_a_front_keep_its_ends():
    lengths = np.cumsum(np.random.default_rng(3).uniform(0.1, 1, 30))
    chosen = spread_on_front(lengths, 5)
    assert chosen[0] == 0
    assert chosen[-1] == 29
    assert len(chosen) <= 5
    assert spread_on_front(lengths[:3], 5).tolist() == [0, 1, 2]
