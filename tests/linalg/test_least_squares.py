"""Sparse least squares on graphs, against dense solutions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from graphs import connected_topologies
from topobelief.graph.topology import Topology
from topobelief.linalg.least_squares import LeastSquaresSolver


def _dense(topology: Topology, rows_i: NDArray, rows_j: NDArray, held: int) -> NDArray:
    """All rows on the variables of the free nodes."""
    m, r, b = rows_i.shape
    matrix = np.zeros((m, r, topology.num_nodes, b))
    for e, (i, j) in enumerate(topology.edges):
        matrix[e, :, i] += rows_i[e]
        matrix[e, :, j] += rows_j[e]
    return np.delete(matrix, held, axis=2).reshape(m * r, -1)


@given(topology=connected_topologies(min_nodes=2), block=st.integers(1, 3), columns=st.integers(1, 3), seed=st.integers(0, 999))
def test_it_is_the_dense_least_squares_solution(topology: Topology, block: int, columns: int, seed: int):
    """The minimiser and the decrease are those of a dense solver, again when the same solver gets other numbers."""
    rng = np.random.default_rng(seed)
    held = int(rng.integers(topology.num_nodes))
    solver = LeastSquaresSolver(topology.edges, topology.num_nodes, block, held)
    for _ in range(2):
        rows_j = rng.normal(size=(topology.num_edges, block + 1, block))
        rows_i = -rows_j + 0.1 * rng.normal(size=rows_j.shape)
        residuals = rng.normal(size=(topology.num_edges, block + 1, columns))
        x, decrease = solver.solve(rows_i, rows_j, residuals)
        matrix = _dense(topology, rows_i, rows_j, held)
        stacked = residuals.reshape(-1, columns)
        expected = np.linalg.lstsq(matrix, -stacked)[0]
        assert not x[held].any()
        tolerance = 1e-13 * np.linalg.cond(matrix) ** 2 * np.abs(expected).max()
        np.testing.assert_allclose(np.delete(x, held, axis=0).reshape(-1, columns), expected, rtol=0, atol=tolerance)
        left = np.sum((matrix @ expected + stacked) ** 2)
        assert decrease == pytest.approx(np.sum(stacked**2) - left, rel=1e-9, abs=1e-9)


def test_one_right_hand_side_needs_no_axis():
    """Springs of strength 1 and 3 to held nodes at 0 that want lengths 1 and 5: the middle is at 4."""
    edges = np.array([(0, 1), (2, 1)])
    root = np.sqrt([1.0, 3.0])[:, None, None]
    solver = LeastSquaresSolver(edges, 3, 1, np.array([0, 2]))
    x, decrease = solver.solve(-root, root, -root[:, :, 0] * np.array([[1.0], [5.0]]))
    np.testing.assert_allclose(x, [[0.0], [4.0], [0.0]])
    assert decrease == pytest.approx(1 + 3 * 25 - (3**2 + 3 * 1))


def test_nothing_free_is_solved_by_nothing():
    solver = LeastSquaresSolver(np.zeros((0, 2), dtype=np.int64), 1, 3, 0)
    x, decrease = solver.solve(np.zeros((0, 3, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)))
    assert (x.tolist(), decrease) == ([[0, 0, 0]], 0.0)


def test_a_singular_system_says_so():
    """A variable that no row touches leaves a zero pivot: no solution, and a decrease that is no number."""
    edges = np.array([(0, 1)])
    rows = np.array([[[1.0, 0.0]]])
    x, decrease = LeastSquaresSolver(edges, 2, 2, 0).solve(-rows, rows, np.ones((1, 1)))
    assert math.isnan(decrease)
    assert not x.any()
