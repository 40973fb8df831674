"""Parts of ways that are seen from places."""

from unittest.mock import Mock

import numpy as np
import pytest

import topobelief as tb
from topobelief.world import sight
from topobelief.world.sight import seen_parts

WORLD = tb.World.from_boxes([(3, 3, 4, 7), (6, 1, 6.2, 5), (1, 8, 9, 8.3)], bounds=(0, 0, 10, 10))


def test_as_the_world_sees_it():
    """At random places along random ways: what is visible is in a part, and what is not is in none."""
    rng = np.random.default_rng(0)
    places, starts = rng.uniform(0, 10, (2, 3000, 2))
    ends = np.clip(starts + rng.normal(size=(3000, 2)), 0.01, 9.99)
    free = WORLD.segments_free(starts, ends, 0.0)
    places, starts, ends = places[free], starts[free], ends[free]
    parts = seen_parts(WORLD, places, starts, ends)
    for share in rng.uniform(size=10):
        within = np.zeros(len(places), dtype=bool)
        within[parts.which[(parts.lower <= share) & (share <= parts.upper)]] = True
        assert (within == WORLD.visible(places, starts + share * (ends - starts))).all()


def test_known_shadows():
    """A wall hides the middle of a way; from inside a wall nothing is seen; a place in line with the way sees all of it."""
    place = np.array([[2.0, 5.0], [3.5, 5.0], [5.0, 1.0]])
    starts, ends = np.array([[5.0, 1.0], [5, 1], [5, 2]]), np.array([[5.0, 9.0], [5, 9], [5, 7.5]])
    world = tb.World.from_boxes([(3, 4, 4, 6), (1, 9.5, 2, 9.6)], bounds=(0, 0, 10, 10))
    parts = seen_parts(world, place, starts, ends)
    assert parts.which.tolist() == [0, 0, 2]
    np.testing.assert_allclose(parts.lower, [0, 7 / 8, 0], atol=1e-8)
    np.testing.assert_allclose(parts.upper, [1 / 8, 1, 1], atol=1e-8)


def test_ways_are_looked_at_in_parts_and_what_a_check_raises_ends_it(monkeypatch):
    rng = np.random.default_rng(1)
    places, starts, ends = rng.uniform(0, 10, (3, 40, 2))
    at_once = seen_parts(WORLD, places, starts, ends)
    monkeypatch.setattr(sight, "_AT_ONCE", 7)
    for one, other in zip(at_once, seen_parts(WORLD, places, starts, ends), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)
    with pytest.raises(TimeoutError):
        seen_parts(WORLD, places, starts, ends, Mock(side_effect=[None, TimeoutError]))
