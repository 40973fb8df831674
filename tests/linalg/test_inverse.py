"""Solutions and traces of an inverse: by a sparse factor, with strong rows apart, and by QR."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief.forms.prior_factors import PriorFactors
from topobelief.graph.fisher import fisher_rows
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg import inverse
from topobelief.linalg.inverse import InverseSolver
from topobelief.linalg.solutions import inverse_trace, solutions


def ring(num_poses: int, strong: float = 1.0) -> PoseGraph:
    angle = 2 * np.pi * np.arange(num_poses) / num_poses
    poses = np.column_stack([5 * np.cos(angle), 5 * np.sin(angle), angle])
    information = np.tile(np.diag([100.0, 100.0, 400.0]), (num_poses, 1, 1))
    information[3] *= strong
    return PoseGraph(poses, [(i, (i + 1) % num_poses) for i in range(num_poses)], None, information)


def dense_inverse(graph: PoseGraph, held: int) -> np.ndarray:
    """By QR, so that a strong row does not drown the others; shape (n, 3, n, 3)."""
    form, n, m = fisher_rows(graph).joint(), graph.num_poses, graph.num_edges
    rows = np.zeros((m, 3, n, 3))
    rows[np.arange(m), :, graph.edges[:, 0]], rows[np.arange(m), :, graph.edges[:, 1]] = form.rows_i, form.rows_j
    matrix = np.delete(rows, held, axis=2).reshape(3 * m, -1)
    triangle = np.linalg.qr(matrix[np.argsort(-np.abs(matrix).max(axis=1))], mode="r")
    root = np.linalg.inv(triangle)
    free = np.delete(np.arange(n), held)
    whole = np.zeros((n, 3, n, 3))
    whole[np.ix_(free, range(3), free, range(3))] = (root @ root.T).reshape(n - 1, 3, n - 1, 3)
    return whole


def some_columns(num_poses: int) -> np.ndarray:
    columns = np.random.default_rng(0).normal(size=(num_poses, 3, 5))
    columns[9] = 0.0
    return columns


@pytest.mark.parametrize("strong", [1.0, 1e4, 1e10, 1e13])
def test_strong_rows_and_qr_give_what_a_dense_inverse_gives(strong, monkeypatch):
    graph, columns = ring(12, strong), some_columns(12)
    form, expected = fisher_rows(graph).joint(), dense_inverse(graph, 9)
    solved = np.einsum("iajb,jbs->ias", expected, columns)
    for limit in (1200, 0):  # with QR and without
        monkeypatch.setattr(inverse, "_QR_SIZE", limit)
        found = InverseSolver(graph.edges, 12, 9).solve(form, columns)
        trace = float(np.sum(columns * solved))
        assert abs(found.trace.value - trace) <= found.trace.error + 1e-9 * trace
        assert found.trace.error <= 1e-2 * trace
        np.testing.assert_allclose(found.values, solved, rtol=0, atol=(1e-8 + found.relative_error) * np.abs(solved).max())


def test_compiled_solutions_are_the_same():
    graph, columns = ring(150), some_columns(150)
    columns = np.tile(columns, (1, 1, 30))  # more than one portion
    factor = PriorFactors(graph, 9).factor("joint", 0.0)
    found = solutions(factor, np.arange(150), columns)
    expected = InverseSolver(graph.edges, 150, 9).solve(fisher_rows(graph).joint(), columns)
    assert factor.tree.held == 9
    np.testing.assert_allclose(found.values, expected.values, rtol=0, atol=1e-9 * np.abs(expected.values).max())
    assert found.trace.value == pytest.approx(expected.trace.value, rel=1e-10)
    assert inverse_trace(factor, np.arange(150), columns).value == pytest.approx(found.trace.value, rel=1e-12)


def test_what_double_precision_cannot_solve_has_an_infinite_error():
    poses = 1e6 * np.random.default_rng(0).normal(size=(1300, 3))
    edges = [(i, i + 1) for i in range(1299)] + [(0, 700)]
    graph = PoseGraph(poses, edges, None, np.diag([1e8, 1e8, 1e-8]))
    found = InverseSolver(graph.edges, 1300, 0).solve(fisher_rows(graph).joint(), np.ones((1300, 3, 1)))
    assert not found.trace.error <= 0.01 * abs(found.trace.value)
