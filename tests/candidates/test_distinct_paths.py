"""Distinct paths: the Fréchet distance is the table's, and the short cut by landmarks misses no path that is near."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from topobelief.candidates.distinct_paths import DistinctPaths, frechet_within
from topobelief.candidates.polyline import sampled

coordinates = st.integers(0, 6).map(float)
places = st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=12).map(np.array)


def frechet_distance(a: np.ndarray, b: np.ndarray) -> float:
    """The table of Eiter and Mannila, cell by cell."""
    table = np.full((len(a) + 1, len(b) + 1), np.inf)
    table[0, 0] = 0
    for i in range(len(a)):
        for j in range(len(b)):
            table[i + 1, j + 1] = max(np.hypot(*(a[i] - b[j])), min(table[i, j], table[i, j + 1], table[i + 1, j]))
    return table[-1, -1]


@given(places, places)
def test_the_frechet_distance_is_that_of_the_table(a: np.ndarray, b: np.ndarray) -> None:
    distance = frechet_distance(a, b)
    assert frechet_within(a, b, distance + 1e-9)
    assert not frechet_within(a, b, distance - 1e-9)


def test_a_way_walked_backwards_is_far_though_each_place_is_near() -> None:
    way = np.array([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)])
    assert not frechet_within(way, way[::-1], 1.9)
    assert frechet_within(way, way[::-1], 2.0)


@pytest.mark.parametrize("num_landmarks", [1, 5, 40])
def test_a_path_is_near_exactly_if_it_is_near_to_one_of_them(num_landmarks: int) -> None:
    rng = np.random.default_rng(0)
    distinct = DistinctPaths(rng.uniform(0, 10, (num_landmarks, 2)))
    added: list[np.ndarray] = []
    answers = set()
    for _ in range(60):
        path = np.vstack([(0, 0), rng.uniform((2, -1), (8, 3), (2, 2)), (10, 0)])
        near = any(frechet_within(sampled(path, 32), sampled(other, 32), 1.0) for other in added)
        assert distinct.any_within(path, 1.0) == near
        answers.add(near)
        distinct.add(path)
        added.append(path)
    assert answers == {True, False}
