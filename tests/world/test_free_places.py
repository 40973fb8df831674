"""The nearest free place is free, reachable where asked, and hardly farther than any other."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief.world import World
from topobelief.world.free_places import nearest_free_place

BOXES = [(2, 2, 4, 5), (6, 1, 9, 3), (5, 6, 9.5, 9)]
ROOM = World.from_boxes(BOXES, bounds=(0, 0, 10, 10))


@pytest.mark.parametrize("radius", [0.05, 0.35, 0.6])
def test_it_is_free_and_none_is_much_nearer(radius):
    """Against a lattice of a centimetre."""
    lattice = np.stack(np.meshgrid(np.arange(0, 10, 0.02), np.arange(0, 10, 0.02)), axis=-1).reshape(-1, 2)
    free = lattice[ROOM.clearance(lattice) > radius]
    for place in np.random.default_rng(3).uniform(-2, 12, (30, 2)):
        found = nearest_free_place(ROOM, place, radius)
        assert found is not None
        assert ROOM.clearance(found[None])[0] > radius
        assert found.tolist() == np.round(found, 2).tolist()
        least = np.linalg.norm(free - place, axis=1).min()
        assert np.linalg.norm(found - place) < least + 0.1 * radius + 0.03


def test_it_can_be_reached_where_asked():
    """Behind a wall lies a nearer place."""
    halves = World.from_boxes([(4.9, 0, 5.1, 10), (6, 4, 7, 6)], bounds=(0, 0, 10, 10))
    free = nearest_free_place(halves, (6.2, 5), 0.3)
    reachable = nearest_free_place(halves, (6.2, 5), 0.3, reachable_from=(2, 5))
    assert free is not None
    assert 5.1 < free[0] < 6
    assert reachable is not None
    assert reachable[0] < 4.9


def test_there_may_be_none():
    assert nearest_free_place(ROOM, (5, 5), 7.0) is None
    assert nearest_free_place(ROOM, (5, 5), 7.0, reachable_from=(1, 1)) is None
