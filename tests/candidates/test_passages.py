"""Passages: a place in every gap that the robot fits through, whatever its width, linked with those of its neighbours."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Polygon, affinity, box

from topobelief.candidates.passages import Passages, find_passages
from topobelief.world import World

RADIUS = 0.35
START, GOAL = np.array([1.0, 1.0]), np.array([9.0, 7.0])


def wall_with_door(width: float) -> World:
    return World.from_boxes([(5, 0, 5.2, 4 - width / 2), (5, 4 + width / 2, 5.2, 8)], (0, 0, 10, 8))


def passages(world: World, start: np.ndarray = START, goal: np.ndarray = GOAL, radius: float = RADIUS) -> Passages:
    return find_passages(world, world.component(start, radius), np.array([start, goal]), radius)


def reached(found: Passages) -> np.ndarray:
    """Whether each place is linked with the start."""
    known = np.arange(len(found.places)) == 0
    for _ in found.places:
        for ends in (found.links, found.links[:, ::-1]):
            known[ends[known[ends[:, 0]], 1]] = True
    return known


@pytest.mark.parametrize("width", [0.701, 0.75, 1.0, 1.5, 4.0])
def test_a_door_of_any_width_has_a_place_on_the_way_from_start_to_goal(width: float) -> None:
    found = passages(wall_with_door(width))
    x, y = found.places.T
    assert ((np.abs(x - 5.1) <= 0.11) & (np.abs(y - 4) < width / 2 - RADIUS + 1e-9)).any()
    assert reached(found)[1]


@pytest.mark.parametrize("width", [0.65, 0.69, 0.7])
def test_a_door_that_the_robot_does_not_fit_through_has_no_link(width: float) -> None:
    assert not reached(passages(wall_with_door(width)))[1]


@settings(max_examples=20)
@given(st.integers(0, 179), st.floats(0.02, 1.0), st.floats(0.003, 2.0))
def test_a_door_in_a_wall_of_any_direction_is_passed(angle: int, thickness: float, spare: float) -> None:
    width = 2 * RADIUS + spare
    upright = [box(-thickness / 2, -30, thickness / 2, -width / 2), box(-thickness / 2, width / 2, thickness / 2, 30)]
    walls: list[Polygon] = [affinity.rotate(wall, angle, origin=(0, 0)) for wall in upright]
    across = 4 * np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    assert reached(passages(World.from_polygons(walls, (-8, -8, 8, 8)), across, -across))[1]


def test_links_pass_between_all_neighbours_in_a_grid_of_pillars_and_are_free() -> None:
    x, y = (each.ravel() for each in np.meshgrid([3.0, 6.0, 9.0], [3.0, 5.0, 7.0]))
    world = World.from_boxes(np.stack([x, y, x + 0.5, y + 0.5], axis=1), (0, 0, 12, 10))
    found = passages(world, START, np.array([11.0, 9.0]))
    ways = found.places[found.links]
    assert world.segments_free(ways[:, 0], ways[:, 1], RADIUS).all()
    assert reached(found).all()
    lines = [LineString(way) for way in ways]
    for a in np.stack([x, y], axis=1) + 0.25:
        for step in ((3, 0), (0, 2)):
            gap = LineString([a, a + step])
            assert any(line.intersects(gap) for line in lines) or (a + step > (10, 8)).any()


def test_dead_ends_have_none() -> None:
    alcoves = [(2, 4, 3, 10), (4, 4, 5, 10), (6, 4, 7, 10), (8, 4, 9, 10)]
    found = passages(World.from_boxes(alcoves, (0, 0, 10, 10)), START, np.array([9.0, 1.0]))
    assert reached(found)[1]
    assert (found.places[:, 1] < 4).all()


def test_in_an_empty_room_start_and_goal_are_linked() -> None:
    found = passages(World.from_boxes([], (0, 0, 10, 8)))
    assert found.places[:2].tolist() == [START.tolist(), GOAL.tolist()]
    assert reached(found).all()


def test_in_one_triangle_start_and_goal_are_linked_directly() -> None:
    found = passages(World.from_polygons([], (0, 0, 10, 8)), np.array([5.0, 1.0]), np.array([5.5, 1.1]))
    assert [0, 1] in found.links.tolist()
