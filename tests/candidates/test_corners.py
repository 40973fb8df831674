"""Corners: shortest paths lead by way of them, along tangents."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief.candidates.corners import Corners, find_corners, tangents
from topobelief.candidates.polyline import path_length
from topobelief.candidates.roadmap import Roadmap
from topobelief.world import World

ENDS = np.array([[2.0, 5.0], [8.0, 5.0]])


def box_world() -> World:
    return World.from_boxes([(4, 4, 6, 6)], (0, 0, 10, 10))


@pytest.mark.parametrize("radius", [0.1, 0.35, 0.8])
def test_the_shortest_way_around_a_box_is_that_of_a_string_around_it(radius: float) -> None:
    """To a corner, about a disc around it, along the side of the box, about the next corner and on.

    Where it turns it keeps up to 0.2 of the radius more from the corner, and is as much longer as that adds to the arc.
    """
    world = box_world()
    region = world.component(ENDS[0], radius)
    corners = find_corners(world, region, ENDS, radius, 100)
    alone = np.repeat(ENDS[:, None], 2, axis=1)
    corners = Corners(np.concatenate([ENDS, corners.places]), np.concatenate([alone, corners.beside]))
    edges = tangents(world, corners, radius, range(1, 101))
    path = Roadmap(world, radius, region, corners.places, edges).shortest_path()
    assert path is not None
    to_corner = np.hypot(2, 1)
    tangent = np.sqrt(to_corner**2 - radius**2)
    turn = np.arctan2(1, 2) + np.arcsin(radius / to_corner)
    string = 2 * (tangent + radius * turn + 1)
    assert string < path_length(corners.places[path]) < string + 0.2 * radius * 2 * turn


def test_are_where_the_robot_fits_and_so_are_the_tangents() -> None:
    world, radius = box_world(), 0.35
    corners = find_corners(world, world.component(ENDS[0], radius), ENDS, radius, 100)
    assert len(corners.places) >= 8
    assert world.clearance(corners.places).min() > radius
    a, b = tangents(world, corners, radius, range(1, 9)).T
    assert len(a) > 0
    assert world.segments_free(corners.places[a], corners.places[b], radius).all()


def test_at_the_corners_of_a_room_there_are_none() -> None:
    room = World.from_boxes([], (0, 0, 10, 10))
    corners = find_corners(room, room.component(ENDS[0], 0.35), ENDS, 0.35, 100)
    assert len(corners.places) == 0
    assert tangents(room, corners, 0.35, range(1, 9)).shape == (0, 2)


def test_tangents_to_further_neighbours_add_to_those_to_near_ones() -> None:
    world, radius = box_world(), 0.35
    corners = find_corners(world, world.component(ENDS[0], radius), ENDS, radius, 100)
    near, further, both = (tangents(world, corners, radius, nearest) for nearest in (range(1, 4), range(4, 9), range(1, 9)))
    assert {*map(tuple, near.tolist())} | {*map(tuple, further.tolist())} == {*map(tuple, both.tolist())}


def test_of_too_many_those_nearest_to_the_way_are_kept() -> None:
    world = World.from_boxes([(4, 4, 6, 6), (1, 8, 2, 9), (8, 8, 9, 9)], (0, 0, 10, 10))
    corners = find_corners(world, world.component(ENDS[0], 0.35), ENDS, 0.35, 8)
    assert 0 < len(corners.places) <= 8
    assert (np.abs(corners.places - 5) < 1.6).all()
