"""Solutions and traces of an inverse: by a sparse factor, with strong rows apart, and by QR."""

from __future__ import annotations

import numpy as np
import pytest

from graphs import Noise, random_pose_graph
from topobelief.forms.prior_factors import PriorFactors
from topobelief.geometry import SE2_GROUP, SE3_GROUP
from topobelief.graph.alignment import Alignment
from topobelief.graph.fisher import fisher_rows
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg import inverse
from topobelief.linalg.inverse import InverseSolver
from topobelief.linalg.selected_inverse import inverse_diagonal, projected_trace
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


@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP])
@pytest.mark.parametrize("strong", [1.0, 1e9])
def test_diagonal_blocks_of_the_inverse_are_those_of_its_solutions(group, strong):
    """On a graph with much fill, and with a strong row, whose nodes come last."""
    rng = np.random.default_rng(1)
    graph = random_pose_graph(rng, Noise(group, "full", 1.0, 0.1, 1.0), 90, 120)
    information = graph.information.copy()
    information[7] *= strong
    graph = PoseGraph(graph.poses, graph.edges, None, information)
    factor, kappa = PriorFactors(graph, 9).factor("joint", 0.0), group.tangent_dim
    every = np.arange(90)
    columns = np.eye(90 * kappa).reshape(90, kappa, -1)
    expected = solutions(factor, every, columns).values.reshape(90, kappa, 90, kappa)[every, :, every]
    found = inverse_diagonal(factor, every)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(inverse_diagonal(factor, every[40:50]), found[40:50], rtol=1e-12)
    projection = Alignment.of(graph.positions, 50).projection
    trace = inverse_trace(factor, projection.nodes, projection.columns(kappa))
    assert projected_trace(factor, projection).value == pytest.approx(trace.value, rel=1e-9)


def test_a_projection_that_cancels_almost_everything_is_solved_for():
    """A map that turns and moves as a whole, far from the pose that is held: what is left of it is small."""
    graph = ring(60, 1.0)
    free = np.concatenate([graph.poses, graph.poses[:1] + np.array([1e5, 0, 0])])
    information = np.concatenate([graph.information, [1e-11 * np.diag([1.0, 1.0, 1e5])]])
    graph = PoseGraph(free, [*graph.edges.tolist(), (60, 0)], None, information)
    factor = PriorFactors(graph, 60).factor("joint", 0.0)
    projection = Alignment.of(graph.positions[:60], 60).projection
    expected = inverse_trace(factor, projection.nodes, projection.columns(3))
    found = projected_trace(factor, projection)
    assert found.value == pytest.approx(expected.value, abs=found.error + expected.error)
    assert found.error <= max(expected.error, 1e-3 * expected.value)


def test_what_double_precision_cannot_solve_has_an_infinite_error():
    poses = 1e6 * np.random.default_rng(0).normal(size=(1300, 3))
    edges = [(i, i + 1) for i in range(1299)] + [(0, 700)]
    graph = PoseGraph(poses, edges, None, np.diag([1e8, 1e8, 1e-8]))
    found = InverseSolver(graph.edges, 1300, 0).solve(fisher_rows(graph).joint(), np.ones((1300, 3, 1)))
    assert not found.trace.error <= 0.01 * abs(found.trace.value)
