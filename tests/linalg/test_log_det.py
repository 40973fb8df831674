"""Log-determinants of quadratic forms against dense ones, whatever is held, shifted, parallel or ill-conditioned."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from graphs import connected_topologies
from references import laplacian_log_det_exact
from topobelief.linalg import EdgeForm, Estimate, LogDetSolver, laplacian_form
from topobelief.linalg.block_pattern import BlockPattern

seeds = st.integers(0, 2**32 - 1)


@st.composite
def edge_forms(draw):
    """A connected graph, a form with dense random rows on it, and nodes that are held."""
    topology = draw(connected_topologies(min_nodes=2, max_nodes=8, max_extra=8))
    b = draw(st.integers(1, 6))
    rng = np.random.default_rng(draw(seeds))
    rows_i, rows_j = rng.normal(size=(2, topology.num_edges, b, b))
    rows_j += 3 * np.eye(b)
    held = rng.choice(topology.num_nodes, size=int(rng.integers(1, topology.num_nodes + 1)), replace=False)
    form = EdgeForm(topology.edges, rows_i, rows_j, np.linalg.norm(rows_i, axis=1), np.linalg.norm(rows_j, axis=1))
    return topology, form, held


def dense_rows(form, num_nodes, held):
    """All rows on the variables of the free nodes, from the definition."""
    m, r, b = form.rows_i.shape
    dense = np.zeros((m, r, num_nodes, b))
    for edge, (i, j) in enumerate(form.edges.tolist()):
        dense[edge, :, i] += form.rows_i[edge]
        dense[edge, :, j] += form.rows_j[edge]
    free = np.setdiff1d(np.arange(num_nodes), held)
    return dense[:, :, free].reshape(m * r, len(free) * b)


def dense_matrix(form, num_nodes, held):
    rows = dense_rows(form, num_nodes, held)
    return rows.T @ rows


@given(edge_forms(), st.sampled_from([0.0, 0.3, 1e4]))
def test_agrees_with_a_dense_determinant(drawn, shift):
    topology, form, held = drawn
    matrix = dense_matrix(form, topology.num_nodes, held)
    matrix += shift * np.eye(len(matrix))
    assume(len(matrix) == 0 or np.linalg.cond(matrix) < 1e9)
    found = LogDetSolver(form.edges, topology.num_nodes, held).log_det(form, shift=shift)
    expected = np.linalg.slogdet(matrix)[1]
    assert found.value == pytest.approx(expected, rel=1e-9, abs=1e-9 + found.error)
    assert 0 <= found.error < 1e-4


@given(edge_forms(), st.sampled_from([0.0, 0.3, 1e4]))
def test_hadamard_is_the_determinant_of_the_diagonal_blocks_and_an_upper_bound(drawn, shift):
    topology, form, held = drawn
    b = form.block_size
    matrix = dense_matrix(form, topology.num_nodes, held)
    matrix += shift * np.eye(len(matrix))
    assume(len(matrix) == 0 or np.linalg.cond(matrix) < 1e9)
    solver = LogDetSolver(form.edges, topology.num_nodes, held)
    found = solver.hadamard(form, shift=shift)
    blocks = [matrix[at : at + b, at : at + b] for at in range(0, len(matrix), b)]
    assert found.value == pytest.approx(sum(np.linalg.slogdet(block)[1] for block in blocks), rel=1e-9, abs=1e-9)
    assert found.value + found.error >= solver.log_det(form, shift=shift).value - 1e-9


@given(edge_forms())
def test_a_pattern_filled_is_the_gram_matrix_of_its_rows(drawn):
    topology, form, held = drawn
    free = np.ones(topology.num_nodes, dtype=bool)
    free[held] = False
    pattern = BlockPattern.build(form.edges, free, form.block_size)
    matrix = dense_matrix(form, topology.num_nodes, held)
    scale = 1 + np.abs(matrix).max(initial=0)
    assert np.allclose(pattern.upper(form).toarray(), np.triu(matrix), rtol=0, atol=1e-13 * scale)
    assert np.allclose(
        pattern.upper(form, shift=2.5).toarray(), np.triu(matrix) + 2.5 * np.eye(len(matrix)), rtol=0, atol=1e-13 * scale
    )
    assert np.allclose(pattern.dense_rows(form), dense_rows(form, topology.num_nodes, held), rtol=0, atol=0)
    values = np.random.default_rng(0).normal(size=(topology.num_edges, form.block_size, 3))
    expected = dense_rows(form, topology.num_nodes, held).T @ values.reshape(-1, 3)
    assert np.allclose(pattern.rows_transposed_times(form, values), expected, rtol=0, atol=1e-12 * scale)


@given(edge_forms(), seeds)
def test_a_reused_solver_forgets_the_last_form(drawn, seed):
    """Ordering and symbolic factor are reused; numbers are not, not even after a form with a shift, zeros or a breakdown."""
    topology, form, held = drawn
    rng = np.random.default_rng(seed)
    zero = np.zeros_like(form.rows_i)
    others = [
        EdgeForm(form.edges, 10 * rng.normal(size=form.rows_i.shape), form.rows_j, form.magnitude_i, form.magnitude_j),
        EdgeForm(form.edges, zero, form.rows_j, form.magnitude_i, form.magnitude_j),  # a node no edge ends at: singular
        laplacian_form(form.edges, rng.uniform(0.1, 10, topology.num_edges), multiplicity=2),
    ]
    solver = LogDetSolver(form.edges, topology.num_nodes, held)
    for shift in (0.0, 7.0):
        for other in (*others, form, form):
            reused = solver.log_det(other, shift=shift)
            fresh = LogDetSolver(form.edges, topology.num_nodes, held).log_det(other, shift=shift)
            if math.isinf(fresh.error):
                assert math.isinf(reused.error)
            else:
                assert reused.value == pytest.approx(fresh.value, rel=1e-12, abs=1e-12 + 2 * fresh.error)


@given(connected_topologies(min_nodes=2), seeds, st.integers(1, 4))
def test_a_laplacian_counts_as_often_as_its_multiplicity(topology, seed, multiplicity):
    weights = np.random.default_rng(seed).uniform(0.1, 10, topology.num_edges)
    solver = LogDetSolver(topology.edges, topology.num_nodes, 0)
    once, often = (solver.log_det(laplacian_form(topology.edges, weights, multiplicity=c)).value for c in (1, multiplicity))
    assert often == pytest.approx(multiplicity * once, rel=1e-14, abs=1e-13)
    expected = np.linalg.slogdet(topology.reduced_laplacian(weights).toarray())[1]
    assert once == pytest.approx(expected, rel=1e-10, abs=1e-10)


def test_parallel_edges_add():
    edges = np.array([(0, 1), (1, 0), (0, 1)])
    found = LogDetSolver(edges, 2, 0).log_det(laplacian_form(edges, np.array([1.0, 2.0, 4.0])))
    assert found.value == pytest.approx(math.log(7), rel=1e-15)


def test_nothing_free_has_determinant_one():
    edges = np.array([(0, 1), (1, 2)])
    form = laplacian_form(edges, np.ones(2))
    solver = LogDetSolver(edges, 3, np.arange(3))
    assert solver.log_det(form) == Estimate(0.0, 0.0)
    assert solver.hadamard(form) == Estimate(0.0, 0.0)
    assert LogDetSolver(np.zeros((0, 2), dtype=int), 1, 0).log_det(
        laplacian_form(np.zeros((0, 2), dtype=int), np.zeros(0))
    ) == Estimate(0.0, 0.0)


@pytest.mark.parametrize("num_nodes", [3, 1500], ids=["small", "too large for QR"])
def test_a_singular_matrix_has_infinite_error(num_nodes):
    """Two components, one of them without a held node."""
    half = num_nodes // 2
    edges = np.array([(i, i + 1) for i in range(num_nodes - 1) if i != half])
    found = LogDetSolver(edges, num_nodes, 0).log_det(laplacian_form(edges, np.ones(len(edges))))
    assert found.error == math.inf


def test_the_factor_of_a_weak_bridge_breaks_down_and_orthogonal_triangles_do_not():
    """1 + 1e-20 is 1: the Gram matrix is singular in double precision, but its rows know better."""
    edges = np.array([(0, 1), (1, 2), (2, 3)])
    weights = np.array([1e-20, 1.0, 1.0])
    found = LogDetSolver(edges, 4, 0).log_det(laplacian_form(edges, weights))
    assert found.value == pytest.approx(math.log(1e-20), abs=max(found.error, 1e-12))
    assert found.error < 1e-3


@pytest.mark.parametrize("decades", [4, 8, 12, 16])
@settings(max_examples=25)
@given(topology=connected_topologies(min_nodes=2, max_nodes=9), data=st.data())
def test_the_error_estimate_covers_badly_scaled_laplacians(decades, topology, data):
    """Weights over many decades, a shift among them, against 80 digits: covered, or not claimed to be known."""
    rng = np.random.default_rng(data.draw(seeds))
    weights = 10.0 ** rng.uniform(-decades / 2, decades / 2, topology.num_edges)
    held = int(rng.integers(topology.num_nodes))
    solver = LogDetSolver(topology.edges, topology.num_nodes, held)
    for shift in (0.0, data.draw(st.sampled_from([1e-6, 1.0, 1e6]))):
        found = solver.log_det(laplacian_form(topology.edges, weights), shift=shift)
        exact = float(laplacian_log_det_exact(topology.num_nodes, topology.edges, weights, held=held, shift=shift))
        if math.isfinite(found.error):
            assert abs(found.value - exact) <= found.error + 1e-15 * abs(exact)


def test_log_dets_add_and_scale_with_their_errors():
    a, b = Estimate(3.0, 0.1), Estimate(1.0, 0.2)
    assert a + b == Estimate(4.0, pytest.approx(0.3))
    assert a - b == Estimate(2.0, pytest.approx(0.3))
    assert -0.5 * a == Estimate(-1.5, 0.05)
    assert a.plus(-2.0).value == 1.0
    assert 0.1 < a.plus(-2.0).error < 0.1 + 1e-14


def test_large_matrices_sample_their_error_within_reach_of_the_exact_one():
    """Beyond 200 variables variances are sampled: the estimate stays within a factor of 4 of a doubled small one."""
    rng = np.random.default_rng(3)
    estimates = []
    for n in (190, 210):
        edges = np.array([(i, i + 1) for i in range(n - 1)] + [(i, i + 7) for i in range(0, n - 7, 3)])
        found = LogDetSolver(edges, n, 0).log_det(laplacian_form(edges, rng.uniform(0.5, 2, len(edges))))
        estimates.append(found.error)
    assert 0.5 < estimates[1] / estimates[0] < 8
