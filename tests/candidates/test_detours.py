"""Detours: shortest paths around balls, as an unhurried search finds them."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief.candidates.detours import Balls, DetourSearch
from topobelief.candidates.polyline import path_length
from topobelief.candidates.roadmap import Roadmap, build_roadmap
from topobelief.geometry.segments import distances_to_segments
from topobelief.world import World

START, GOAL = (1.0, 5.0), (19.0, 5.0)


@pytest.fixture(scope="module")
def roadmap() -> Roadmap:
    return build_roadmap(World.from_boxes([(6, 4, 7, 6), (12, 3.5, 13, 6.5)], (0, 0, 20, 10)), START, GOAL, num_vertices=200)


@pytest.mark.parametrize("max_detour", [1.2, np.inf])
def test_a_detour_is_the_shortest_path_on_the_edges_that_avoid_its_balls(roadmap: Roadmap, max_detour: float) -> None:
    shortest = roadmap.shortest_path()
    assert shortest is not None
    max_length = max_detour * path_length(roadmap.vertices[shortest])
    search = DetourSearch(roadmap, [shortest], max_length, rng=np.random.default_rng(0))
    starts, ends = roadmap.vertices[roadmap.edges].transpose(1, 0, 2)
    found = [detour for detour in (search.vary(radius) for radius in np.repeat([0.8, 0.3], 60)) if detour is not None]
    for detour in found:
        apart = distances_to_segments(detour.balls.centres[:, None], starts, ends)
        blocked = (apart <= detour.balls.radii[:, None]).any(axis=0)
        expected = roadmap.shortest_path(blocked=blocked, max_length=max_length)
        assert expected is not None
        length = path_length(roadmap.vertices[detour.path])
        assert length == pytest.approx(path_length(roadmap.vertices[expected]))
        assert length <= max_length
        assert detour.least_excess == pytest.approx(length - path_length(roadmap.vertices[shortest]))
    assert len(found) > 20
    assert max(len(detour.balls.radii) for detour in found) > 2


def test_where_every_ball_leaves_no_way_all_attempts_fail() -> None:
    roadmap = build_roadmap(World.from_boxes([], (0, 0, 30, 0.8)), (1, 0.4), (29, 0.4), num_vertices=50)
    path = roadmap.shortest_path()
    assert path is not None
    search = DetourSearch(roadmap, [path], np.inf, rng=np.random.default_rng(0))
    assert [search.vary(1.0) for _ in range(20)] == [None] * 20


def test_without_balls_everything_is_clear() -> None:
    segments = np.array([[(0.0, 0.0), (1.0, 0.0)], [(0.0, 3.0), (1.0, 3.0)]])
    assert Balls.none().clear_of(segments[:, 0], segments[:, 1]).tolist() == [True, True]
    assert Balls.none().and_one(np.array([0.5, 1.0]), 1.5).clear_of(segments[:, 0], segments[:, 1]).tolist() == [False, True]
