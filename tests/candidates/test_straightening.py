"""Straightening: never longer, free, in its class, clear of balls, and the same on second sight."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief.candidates.detours import Balls
from topobelief.candidates.homotopy import Rays, shortest_paths_by_class
from topobelief.candidates.polyline import path_length
from topobelief.candidates.roadmap import Roadmap
from topobelief.candidates.straightening import Straightening
from topobelief.world import World


@pytest.fixture(scope="module")
def roadmap() -> Roadmap:
    """A lattice about two obstacles, whose paths have corners to cut."""
    world, radius = World.from_boxes([(6, 4, 7, 6), (12, 3.5, 13, 6.5)], (0, 0, 20, 10)), 0.35
    lattice = np.stack(np.meshgrid(np.arange(0.7, 20, 0.8), np.arange(0.9, 9.5, 0.8)), axis=-1).reshape(-1, 2)
    vertices = np.concatenate([[(1.0, 5.0), (19.0, 5.0)], lattice[world.segments_free(lattice, lattice, radius)]])
    i, j = np.triu_indices(len(vertices), k=1)
    near = np.linalg.norm(vertices[i] - vertices[j], axis=1) < 1.2
    edges = np.stack([i[near], j[near]], axis=1)
    free = world.segments_free(vertices[edges[:, 0]], vertices[edges[:, 1]], radius)
    return Roadmap(world, radius, world.component((1, 5), radius), vertices, edges[free])


def test_both_ways_keep_the_class_and_shorten(roadmap: Roadmap) -> None:
    rays = Rays.of_obstacles(roadmap)
    straightening = Straightening(roadmap, rays)
    shortened = []
    for path in shortest_paths_by_class(roadmap, rays, num_classes=4):
        whole = roadmap.vertices[path]
        vertices = straightening.by_vertices(path)
        assert straightening.by_vertices(path) == vertices, "what is remembered is what was found out"
        assert set(vertices) <= set(path)
        by_vertices = roadmap.vertices[vertices]
        by_pieces = straightening.by_pieces(by_vertices)
        for result in (by_vertices, by_pieces):
            assert rays.word(result) == rays.word(whole)
            assert roadmap.world.segments_free(result[:-1], result[1:], roadmap.robot_radius).all()
        assert path_length(by_pieces) <= path_length(by_vertices) <= path_length(whole)
        shortened.append(path_length(whole) - path_length(by_pieces))
    assert min(shortened) > 0.05


def test_a_ball_is_not_cut_through(roadmap: Roadmap) -> None:
    """Around a ball in the open the straight way would be free, but is not clear of the ball."""
    world = World.from_boxes([], (0, 0, 10, 10))
    vertices = np.array([(1.0, 5.0), (9.0, 5.0), (3.0, 7.0), (5.0, 8.0), (7.0, 7.0)])
    edges = np.array([(0, 2), (2, 3), (3, 4), (1, 4)])
    roadmap = Roadmap(world, 0.3, world.component((1, 5), 0.3), vertices, edges)
    straightening = Straightening(roadmap, Rays(np.zeros((0, 2))))
    balls = Balls.none().and_one(np.array([5.0, 5.0]), 1.5)
    assert straightening.by_vertices([0, 2, 3, 4, 1]) == [0, 1]
    kept = straightening.by_vertices([0, 2, 3, 4, 1], balls)
    assert kept == [0, 2, 4, 1]
    around = straightening.by_pieces(vertices[kept], balls)
    assert balls.clear_of(around[:-1], around[1:]).all()
    assert 8.0 < path_length(around) < path_length(vertices[kept])
