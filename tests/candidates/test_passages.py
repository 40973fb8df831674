"""Narrow passages: a place in every one, and before and behind it."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief.candidates.passages import narrow_passages
from topobelief.world import World

RADIUS = 0.35


def wall_with_door(width: float) -> World:
    return World.from_boxes([(5, 0, 5.2, 4 - width / 2), (5, 4 + width / 2, 5.2, 8)], (0, 0, 10, 8))


@pytest.mark.parametrize("width", [0.701, 0.75, 0.9, 1.0])
def test_a_door_gets_places_in_the_middle_before_and_behind_that_see_each_other(width: float) -> None:
    world = wall_with_door(width)
    places = narrow_passages(world, RADIUS)
    count = len(places) // 3
    middle, ahead, behind = places[:count], places[count : 2 * count], places[2 * count :]
    door = (np.abs(middle[:, 0] - 5.1) <= 0.1) & (np.abs(middle[:, 1] - 4) < 1e-9)
    assert door.any()
    ways = world.segments_free(ahead, middle, RADIUS) & world.segments_free(middle, behind, RADIUS)
    assert (door & ways).any()
    first = int(np.argmax(door & ways))
    assert sorted([ahead[first, 0] < 5, behind[first, 0] < 5]) == [False, True]


def test_a_door_that_the_robot_does_not_fit_through_or_need_not_squeeze_through_gets_none() -> None:
    for width in (0.69, 1.5):
        places = narrow_passages(wall_with_door(width), RADIUS)
        assert not (np.linalg.norm(places - (5.1, 4), axis=1) < 0.3).any()


def test_there_is_at_most_one_to_a_square_of_the_radius() -> None:
    """In a corridor 40 m long and 0.8 m wide they stand a radius apart, not at every point of the outline."""
    world = World.from_boxes([], (0, 0, 40, 0.8))
    places = narrow_passages(world, RADIUS)
    middle = places[: len(places) // 3]
    assert 40 / RADIUS / 3 < len(middle) <= 3 * (40 / RADIUS + 1)
    assert len(np.unique(np.floor(middle / RADIUS), axis=0)) == len(middle)
