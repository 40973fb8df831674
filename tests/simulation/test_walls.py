"""Walls: the boundary of the free region, each with free space on its left."""

from __future__ import annotations

import numpy as np
import pytest
from shapely import Polygon

import topobelief as tb
from topobelief.simulation.walls import wall_segments

WORLDS = {
    "room": tb.World.from_boxes([], bounds=(0, 0, 4, 3)),
    "pillar": tb.World.from_boxes([(2, 2, 3, 3)], bounds=(0, 0, 6, 5)),
    "two rooms": tb.World.from_boxes([(2.9, -1, 3.1, 6)], bounds=(0, 0, 6, 5)),
    "clockwise": tb.World(Polygon([(0, 0), (0, 3), (4, 3), (4, 0)], [[(1, 1), (2, 1), (2, 2), (1, 2)]])),
    "cells": tb.World.from_cells([[True, True, True], [True, False, True], [False, True, True]], 0.5, (1.0, 2.0, 0.3)),
}


@pytest.mark.parametrize("name", WORLDS)
def test_free_space_lies_to_the_left_and_none_to_the_right(name: str) -> None:
    world = WORLDS[name]
    starts, ends = wall_segments(world)
    along = (ends - starts) / np.linalg.norm(ends - starts, axis=1, keepdims=True)
    left = 1e-6 * np.stack([-along[:, 1], along[:, 0]], axis=1)
    assert world.contains((starts + ends) / 2 + left).all()
    assert not world.contains((starts + ends) / 2 - left).any()


@pytest.mark.parametrize("name", WORLDS)
def test_walls_are_the_whole_boundary(name: str) -> None:
    starts, ends = wall_segments(WORLDS[name])
    assert np.linalg.norm(ends - starts, axis=1).sum() == pytest.approx(WORLDS[name].free.length)
