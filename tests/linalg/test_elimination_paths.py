"""Factors along elimination trees against dense matrices: determinants, entries of the inverse, errors that cover the truth."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from graphs import connected_topologies, path, pose_graphs, star
from references import laplacian_log_det_exact, log_det_exact
from topobelief.graph.fisher import fisher_rows
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg import EdgeForm, LogDetSolver, elimination_paths, laplacian_form, strong_rows
from topobelief.linalg.elimination_paths import FormFactor
from topobelief.linalg.elimination_tree import EliminationTree

seeds = st.integers(0, 2**32 - 1)


@st.composite
def held_forms(draw):
    """A connected graph, a well-conditioned form on it with 1, 2, 3 or 6 variables a node, and the node that is held."""
    topology = draw(connected_topologies(max_nodes=14, max_extra=12))
    b, more = draw(st.sampled_from([1, 2, 3, 6])), draw(st.integers(0, 2))
    rng = np.random.default_rng(draw(seeds))
    rows_i, rows_j = rng.normal(size=(2, topology.num_edges, b + more, b))
    rows_i[:, :b] -= 3 * np.eye(b)
    rows_j[:, :b] += 3 * np.eye(b)
    form = EdgeForm(topology.edges, rows_i, rows_j, np.linalg.norm(rows_i, axis=1), np.linalg.norm(rows_j, axis=1))
    return topology.num_nodes, form, int(rng.integers(topology.num_nodes))


def dense_rows(num_nodes, form, held):
    """R without the held node's variables, nodes in their own order."""
    m, r, b = form.rows_i.shape
    rows = np.zeros((m, r, num_nodes, b))
    for edge, (i, j) in enumerate(form.edges.tolist()):
        rows[edge, :, i] += form.rows_i[edge]
        rows[edge, :, j] += form.rows_j[edge]
    return np.delete(rows, held, axis=2).reshape(m * r, (num_nodes - 1) * b)


def dense_matrix(num_nodes, form, held):
    rows = dense_rows(num_nodes, form, held)
    return rows.T @ rows


@given(held_forms(), st.sampled_from([0.0, 0.3, 100.0]))
def test_determinant_and_inverse_are_those_of_the_dense_matrix(drawn, shift):
    num_nodes, form, held = drawn
    matrix = dense_matrix(num_nodes, form, held) + shift * np.eye((num_nodes - 1) * form.block_size)
    factor = FormFactor.of(EliminationTree.build(form.edges, num_nodes, held), form, shift=shift)
    expected = np.linalg.slogdet(matrix)[1]
    tolerance = 1e-13 * np.linalg.cond(matrix) if len(matrix) else 0.0
    assert factor.log_det.value == pytest.approx(expected, rel=1e-12, abs=tolerance + factor.log_det.error)
    inverse, b, order = np.linalg.inv(matrix), form.block_size, factor.tree.order - (factor.tree.order > held)
    paths = factor.paths(np.arange(num_nodes - 1))
    for s in range(num_nodes - 1):
        for t in range(num_nodes - 1):
            block = inverse[b * order[s] : b * order[s] + b, b * order[t] : b * order[t] + b]
            scale = np.abs(inverse).max() * np.linalg.cond(matrix)
            np.testing.assert_allclose(paths.inverse_block(s, t), block, rtol=1e-11, atol=1e-14 * scale)


@given(held_forms(), seeds)
def test_paths_of_some_nodes_are_those_among_the_paths_of_all(drawn, seed):
    num_nodes, form, held = drawn
    factor = FormFactor.of(EliminationTree.build(form.edges, num_nodes, held), form)
    rng = np.random.default_rng(seed)
    places = np.flatnonzero(rng.random(num_nodes - 1) < 0.4)
    some, every = factor.paths(places), factor.paths(np.arange(num_nodes - 1))
    for s, place in enumerate(places):
        for t, other in enumerate(places):
            np.testing.assert_array_equal(some.inverse_block(s, t), every.inverse_block(place, other))


@given(held_forms())
def test_every_row_of_a_column_is_an_ancestor_and_subtrees_are_contiguous(drawn):
    num_nodes, form, held = drawn
    tree = EliminationTree.build(form.edges, num_nodes, held)
    assert tree.position[held] == -1
    assert sorted([*tree.order.tolist(), held]) == list(range(num_nodes))
    ancestors = [set() for _ in range(tree.num_free)]
    for place in range(tree.num_free - 1, -1, -1):
        if tree.parent[place] >= 0:
            assert tree.parent[place] > place
            ancestors[place] = ancestors[tree.parent[place]] | {int(tree.parent[place])}
        assert tree.depth[place] == len(ancestors[place])
        assert set(tree.rows[tree.start[place] : tree.start[place + 1]].tolist()) <= ancestors[place]
    for place in range(tree.num_free):
        subtree = [other for other in range(tree.num_free) if other == place or place in ancestors[other]]
        assert subtree == list(range(place - len(subtree) + 1, place + 1))


@given(pose_graphs(log_ratio=(-3.0, 6.0)), st.sampled_from(["joint", "positions", "rotations"]), seeds)
def test_the_error_covers_the_truth(graph, part, seed):
    held = int(np.random.default_rng(seed).integers(graph.num_poses))
    form = getattr(replace(fisher_rows(graph), weights=None), part)()
    found = FormFactor.of(EliminationTree.build(graph.edges, graph.num_poses, held), form).log_det
    if math.isfinite(found.error):
        assert abs(found.value - float(log_det_exact(graph, part, held=held))) <= found.error
    else:
        assert LogDetSolver(graph.edges, graph.num_poses, held).log_det(form).error > 1e-9


def test_the_error_of_a_large_factor_is_sampled_and_agrees_with_that_from_scratch():
    n = 3000
    rng = np.random.default_rng(3)
    edges = np.array([(i, i + 1) for i in range(n - 1)] + [tuple(rng.choice(n, 2, replace=False)) for _ in range(40)])
    weights = 10.0 ** rng.uniform(-4, 4, len(edges))
    form = laplacian_form(edges, weights)
    factor = FormFactor.of(EliminationTree.build(edges, n, 7), form)
    scratch = LogDetSolver(edges, n, 7).log_det(form)
    exact = float(laplacian_log_det_exact(n, edges, weights, held=7))
    assert abs(factor.log_det.value - exact) <= factor.log_det.error
    assert factor.log_det.error == pytest.approx(scratch.error, rel=0.5)


def test_a_single_node_leaves_nothing_to_factor():
    tree = EliminationTree.build(np.zeros((0, 2), dtype=np.int64), 1, 0)
    factor = FormFactor.of(tree, laplacian_form(tree.edges, np.zeros(0)))
    assert factor.log_det.value == 0.0
    assert factor.log_det.error == 0.0
    assert len(factor.paths(np.zeros(0, dtype=np.int64)).values) == 0


def test_parts_of_the_tree_that_the_held_node_separates_share_nothing():
    tree = EliminationTree.build(star(6).edges, 6, 0)
    factor = FormFactor.of(tree, laplacian_form(tree.edges, np.arange(1.0, 6.0)))
    paths = factor.paths(np.arange(5))
    for s in range(5):
        for t in range(5):
            assert paths.inverse_block(s, t) == pytest.approx(1 / tree.order[s] if s == t else 0.0)


def test_resistances_of_a_chain_add():
    """(L_tilde^-1)_st of a chain held at its end is the resistance that the ways from s and t have in common."""
    chain = path(200)
    resistances = np.random.default_rng(0).uniform(0.1, 10, 199)
    tree = EliminationTree.build(chain.edges, 200, 0)
    paths = FormFactor.of(tree, laplacian_form(tree.edges, 1 / resistances)).paths(np.arange(199))
    common = np.cumsum(resistances)
    for s, t in np.random.default_rng(1).integers(199, size=(60, 2)).tolist():
        nearer = min(tree.order[s], tree.order[t])
        assert paths.inverse_block(s, t)[0, 0] == pytest.approx(common[nearer - 1], rel=1e-9)


def test_a_matrix_that_is_not_positive_definite_has_an_infinite_error():
    edges = np.array([(0, 1), (1, 2)])
    rows = np.array([[[1e200]], [[1e-200]]])
    form = EdgeForm(edges, -rows, rows, np.abs(rows[:, 0]), np.abs(rows[:, 0]))
    assert FormFactor.of(EliminationTree.build(edges, 3, 0), form).log_det.error == math.inf


@pytest.mark.parametrize("cores", [1, 3])
def test_paths_do_not_depend_on_the_number_of_threads(monkeypatch, cores):
    rng = np.random.default_rng(5)
    edges = np.array([(i, i + 1) for i in range(299)] + [tuple(rng.choice(300, 2, replace=False)) for _ in range(200)])
    factor = FormFactor.of(EliminationTree.build(edges, 300, 0), laplacian_form(edges, rng.uniform(1, 2, len(edges))))
    places = np.sort(rng.choice(299, 120, replace=False))
    expected = factor.paths(places).values
    monkeypatch.setattr(elimination_paths, "num_threads", lambda: cores)
    np.testing.assert_array_equal(factor.paths(places).values, expected)


@given(held_forms(), st.integers(1, 4), st.floats(2.0, 5.0), seeds)
def test_with_strong_rows_last_the_factor_is_that_of_the_same_matrix(drawn, count, decades, seed):
    num_nodes, form, held = drawn
    if len(form.edges) < 3:
        return
    rng = np.random.default_rng(seed)
    strength = np.ones((len(form.edges), form.rows_i.shape[1], 1))
    strength[rng.integers(len(form.edges), size=count), rng.integers(form.rows_i.shape[1], size=count)] = 10**decades
    columns = np.max(strength, axis=1)
    form = EdgeForm(
        form.edges, strength * form.rows_i, strength * form.rows_j, columns * form.magnitude_i, columns * form.magnitude_j
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(strong_rows, "_STRONG", 100.0)
        factor = FormFactor.with_strong_rows_last(form.edges, num_nodes, held, form)
    if factor is None or num_nodes == 1:
        return
    plain = FormFactor.of(EliminationTree.build(form.edges, num_nodes, held), form)
    assert factor.log_det.value == pytest.approx(plain.log_det.value, abs=factor.log_det.error + plain.log_det.error)
    inverse, b, order = np.linalg.pinv(dense_rows(num_nodes, form, held)), form.block_size, factor.tree.order
    inverse = inverse @ inverse.T
    order = order - (order > held)
    paths = factor.paths(np.arange(num_nodes - 1))
    scale = np.abs(inverse).max()
    for s in range(num_nodes - 1):
        for t in range(num_nodes - 1):
            block = inverse[b * order[s] : b * order[s] + b, b * order[t] : b * order[t] + b]
            np.testing.assert_allclose(paths.inverse_block(s, t), block, rtol=1e-6, atol=1e-6 * scale)


@settings(max_examples=40)
@given(pose_graphs(min_poses=3, max_poses=7, max_extra=6, log_ratio=(-1.0, 1.0)), st.floats(2.0, 13.0), seeds)
def test_strong_rows_last_cost_no_digits(graph, decades, seed):
    """Against 80 digits."""
    rng = np.random.default_rng(seed)
    information = graph.information.copy()
    information[rng.integers(graph.num_edges, size=2)] *= 10**decades
    graph = PoseGraph(graph.poses, graph.edges, None, information)
    rows, held = fisher_rows(graph), int(rng.integers(graph.num_poses))
    for name in ("joint", "positions", "rotations", "rotations_given_positions"):
        form = getattr(rows, name)()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(strong_rows, "_STRONG", 10.0)
            factor = FormFactor.with_strong_rows_last(graph.edges, graph.num_poses, held, form)
        if factor is not None and math.isfinite(factor.log_det.error):
            exact = float(log_det_exact(graph, name, held=held)) / form.multiplicity
            assert factor.log_det.value == pytest.approx(exact, rel=1e-15, abs=factor.log_det.error)
