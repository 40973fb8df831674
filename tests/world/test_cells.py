"""Occupancy grids: cells are the squares that they are, wherever the grid lies."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from topobelief.errors import InvalidMapError
from topobelief.world import World

grids = arrays(np.bool_, st.tuples(st.integers(1, 7), st.integers(1, 7))).filter(lambda cells: cells.any())


@given(grids)
def test_a_place_is_free_exactly_if_its_cell_is(cells: np.ndarray) -> None:
    rows, columns = np.indices(cells.shape)
    centres = np.stack([columns.ravel() + 0.5, rows.ravel() + 0.5], axis=1) * 0.25
    world = World.from_cells(cells, 0.25)
    assert world.contains(centres).tolist() == cells.ravel().tolist()
    assert world.free.area == pytest.approx(cells.sum() * 0.25**2)


@given(grids)
def test_clearance_is_the_distance_to_the_nearest_square_that_is_not_free(cells: np.ndarray) -> None:
    padded = np.pad(cells, 1)
    row, column = np.nonzero(~padded)
    low = np.stack([column - 1.0, row - 1.0], axis=1)
    points = np.random.default_rng(0).uniform((0, 0), cells.shape[::-1], size=(30, 2))
    outside = np.maximum(np.maximum(low - points[:, None], points[:, None] - low - 1), 0)
    expected = np.linalg.norm(outside, axis=2).min(axis=1)
    np.testing.assert_allclose(np.maximum(World.from_cells(cells, 1.0).clearance(points), 0), expected, atol=1e-12)


@given(grids, st.floats(-7, 7), st.floats(-50, 50), st.floats(-50, 50), st.floats(0.01, 2))
def test_the_origin_moves_the_grid_as_a_rigid_body(
    cells: np.ndarray, yaw: float, x: float, y: float, resolution: float
) -> None:
    points = np.random.default_rng(0).uniform(-1, 8, size=(20, 2)) * resolution
    rotation = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    still = World.from_cells(cells, resolution)
    moved = World.from_cells(cells, resolution, (x, y, yaw))
    np.testing.assert_allclose(moved.clearance(points @ rotation.T + (x, y)), still.clearance(points), atol=1e-9)


def test_bounds_are_those_of_the_whole_grid_unknown_margin_and_all() -> None:
    cells = np.zeros((10, 20), dtype=bool)
    cells[4:6, 4:6] = True
    assert World.from_cells(cells, 0.5, (1, 2, 0)).bounds == (1, 2, 11, 7)


def test_cells_that_touch_at_a_corner_only_do_not_connect() -> None:
    world = World.from_cells(np.array([[True, False], [False, True]]), 1.0)
    assert not world.visible([(0.5, 0.5)], [(1.5, 1.5)])[0]
    assert len(world.free.geoms) == 2


def test_obstacles_that_touch_at_a_corner_only_do_not_let_sight_through() -> None:
    world = World.from_cells(np.array([[True, False], [False, True]])[::-1], 1.0)
    assert not world.visible([(0.5, 1.5)], [(1.5, 0.5)])[0]


@pytest.mark.parametrize(
    ("cells", "resolution", "origin", "message"),
    [
        (np.ones((2, 2)), 1.0, (0, 0, 0), "boolean cells .* got float64"),
        (np.ones(4, dtype=bool), 1.0, (0, 0, 0), r"shape \(rows, columns\)"),
        (np.ones((0, 4), dtype=bool), 1.0, (0, 0, 0), r"of \(0, 4\)"),
        (np.ones((2, 2), dtype=bool), 0.0, (0, 0, 0), "resolution above 0 m, got 0"),
        (np.ones((2, 2), dtype=bool), np.nan, (0, 0, 0), "resolution above 0 m, got nan"),
        (np.ones((2, 2), dtype=bool), 1.0, (0, 0), "origin"),
        (np.ones((2, 2), dtype=bool), 1.0, (0, 0, np.nan), "finite origin"),
        (np.zeros((2, 2), dtype=bool), 1.0, (0, 0, 0), "free space, got none"),
    ],
)
def test_refuses_what_is_not_a_grid(cells: np.ndarray, resolution: float, origin: tuple, message: str) -> None:
    with pytest.raises(InvalidMapError, match=message):
        World.from_cells(cells, resolution, origin)


def test_noise_is_refused_before_its_polygons_are_made(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("topobelief.world.cells._MOST_RUNS", 100)
    board = np.indices((20, 20)).sum(axis=0) % 2 == 0
    with pytest.raises(InvalidMapError, match=r"at most 100 straight pieces in each direction, got \d+; this looks like noise"):
        World.from_cells(board, 0.1)
