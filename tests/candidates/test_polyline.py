"""Polylines: lengths, stations and distances."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import LineString, Point

from topobelief.candidates.polyline import (
    checked_path,
    path_length,
    path_poses,
    sampled,
    stations,
    subdivided,
)
from topobelief.errors import InvalidInputError
from topobelief.geometry.segments import distances_to_segments


def test_poses_of_a_path_head_as_they_came() -> None:
    """A repeated waypoint counts once."""
    poses = path_poses([(0, 0), (0, 0), (3, 0), (3, 1), (2, 1)])
    np.testing.assert_allclose(poses, [(0, 0, 0), (3, 0, 0), (3, 1, np.pi / 2), (2, 1, np.pi)])
    assert path_poses([(4, 5)]).tolist() == [[4, 5, 0]]


coordinates = st.integers(-20, 20).map(lambda value: value / 4)
paths = st.lists(st.tuples(coordinates, coordinates), min_size=2, max_size=8, unique=True).map(np.array)


@given(paths, st.floats(0, 1))
def test_a_station_lies_where_shapely_interpolates(path: np.ndarray, share: float) -> None:
    length = path_length(path)
    position = stations(path, np.array([share * length])).positions[0]
    expected = LineString(path).interpolate(share * length)
    assert length == pytest.approx(LineString(path).length)
    assert Point(position).distance(expected) < 1e-9


def test_heading_is_the_direction_of_travel_and_at_a_corner_of_the_leg_that_led_there() -> None:
    path = np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 3.0), (0.0, 3.0)])
    headings = stations(path, np.array([0.0, 1.0, 2.0, 2.5, 5.0, 6.0, 7.0])).headings
    np.testing.assert_allclose(headings, np.pi * np.array([0, 0, 0, 0.5, 0.5, 1, 1]))


@given(paths, st.integers(2, 30))
def test_samples_keep_the_ends_and_stand_at_equal_distances(path: np.ndarray, count: int) -> None:
    places = sampled(path, count)
    np.testing.assert_allclose(places[[0, -1]], path[[0, -1]], atol=1e-9)
    along = np.diff(np.linspace(0, path_length(path), count))
    assert (np.linalg.norm(np.diff(places, axis=0), axis=1) <= along + 1e-9).all()


@given(paths, st.integers(1, 5))
def test_a_subdivided_path_is_the_same_path_through_the_same_waypoints(path: np.ndarray, pieces: int) -> None:
    finer = subdivided(path, pieces)
    assert (finer[::pieces] == path).all()
    assert path_length(finer) == pytest.approx(path_length(path))
    legs = np.linalg.norm(np.diff(finer, axis=0), axis=1).reshape(-1, pieces)
    np.testing.assert_allclose(legs, np.broadcast_to(legs[:, :1], legs.shape))


@given(st.tuples(coordinates, coordinates), paths)
def test_distances_to_segments_agree_with_shapely(point: tuple[float, float], path: np.ndarray) -> None:
    distances = distances_to_segments(np.array(point), path[:-1], path[1:])
    expected = [LineString(path[i : i + 2]).distance(Point(point)) for i in range(len(path) - 1)]
    np.testing.assert_allclose(distances, expected, atol=1e-12)


def test_distances_of_several_points_to_several_segments_are_those_of_each_pair() -> None:
    points, starts, ends = np.random.default_rng(0).normal(size=(3, 4, 2))
    together = distances_to_segments(points[:, None], starts, ends)
    np.testing.assert_array_equal(together, [distances_to_segments(point, starts, ends) for point in points])
    assert distances_to_segments(points[:0, None], starts, ends).shape == (0, 4)


def test_a_segment_of_no_length_is_a_point() -> None:
    place = np.array([[1.0, 1.0]])
    assert distances_to_segments(np.array([4.0, 5.0]), place, place).tolist() == [5.0]


def test_repeated_waypoints_are_dropped() -> None:
    assert checked_path([(0, 0), (0, 0), (1, 0), (1, 0), (0, 0)]).tolist() == [[0, 0], [1, 0], [0, 0]]
    assert path_length([(3, 3)]) == 0


@pytest.mark.parametrize("path", [[], [(1, 2, 3, 4)], [(np.nan, 0)], [1, 2], "abc"])
def test_what_is_no_path_is_refused(path: object) -> None:
    with pytest.raises(InvalidInputError, match="expected path"):
        checked_path(path)
