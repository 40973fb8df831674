"""Increments of log-determinants by extensions of a graph, against dense determinants of the extended graph."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graphs import NOISES, SE2_GROUP, SE3_GROUP, Noise, random_action, random_pose_graph, sessions
from references import log_det_exact, log_det_reference
from topobelief.forms.action_batch import ActionBatch
from topobelief.graph.action import posterior
from topobelief.graph.fisher import fisher_rows
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg import increments as increments_module
from topobelief.linalg.elimination_paths import FormFactor
from topobelief.linalg.elimination_tree import EliminationTree
from topobelief.linalg.extensions import Extensions
from topobelief.linalg.increments import diagonal_increments, log_det_increments

PARTS = ("joint", "positions", "rotations", "rotations_given_positions")
seeds = st.integers(0, 2**32 - 1)


def blocks_of(rows, part):
    """A form in blocks, whatever the noise."""
    return getattr(replace(rows, weights=None), part)()


def factored(graph, held, part):
    return FormFactor.of(EliminationTree.build(graph.edges, graph.num_poses, held), blocks_of(fisher_rows(graph), part))


@given(sessions(log_ratio=(-3.0, 2.0)), st.sampled_from(PARTS), seeds)
def test_they_lead_to_the_extended_graph_s_determinant(session, part, seed):
    graph, held = session.graph, int(np.random.default_rng(seed).integers(session.graph.num_poses))
    batch = ActionBatch(graph, session.actions)
    factor = factored(graph, held, part)
    found = log_det_increments(factor, batch.extensions, blocks_of(batch.rows, part))
    for k, action in enumerate(session.actions):
        expected = log_det_reference(posterior(graph, action), part, held=held)
        value = factor.log_det.value + found.forest[k] + found.closures[k]
        assert value == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(sessions(log_ratio=(-3.0, 2.0)), st.sampled_from(PARTS), seeds)
def test_with_the_existing_nodes_held_they_are_the_determinant_of_the_new_block(session, part, seed):
    graph, held = session.graph, int(np.random.default_rng(seed).integers(session.graph.num_poses))
    batch = ActionBatch(graph, session.actions)
    form = blocks_of(batch.rows, part)
    beside, alone = (log_det_increments(f, batch.extensions, form) for f in (factored(graph, held, part), None))
    np.testing.assert_array_equal(alone.closures, alone.closures_held)
    for k, action in enumerate(session.actions):
        added = (
            PoseGraph(posterior(graph, action).poses, action.edges, None, action.information) if len(action.edges) else graph
        )
        expected = log_det_reference(added, part, held=range(graph.num_poses)) if action.num_new_poses else 0.0
        for found in (beside, alone):
            assert found.forest[k] + found.closures_held[k] == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(sessions(log_ratio=(2.0, 5.0), max_actions=2), st.sampled_from(PARTS), seeds)
def test_beyond_that_their_error_covers_the_truth(session, part, seed):
    graph, held = session.graph, int(np.random.default_rng(seed).integers(session.graph.num_poses))
    batch = ActionBatch(graph, session.actions)
    factor = factored(graph, held, part)
    found = log_det_increments(factor, batch.extensions, blocks_of(batch.rows, part))
    for k, action in enumerate(session.actions):
        exact = float(log_det_exact(posterior(graph, action), part, held=held))
        value, error = factor.log_det.value + found.forest[k] + found.closures[k], 2 * factor.log_det.error + found.error[k]
        assert not np.isfinite(value + error) or abs(value - exact) <= error


@given(sessions(log_ratio=(-1.0, 1.0)), seeds)
def test_parts_of_the_closures_are_blocks_of_the_covariance_that_they_see(session, seed):
    """ln det (I + R) of the first k rows of each closure, and of the others, from the dense R of I's own rows."""
    graph, held = session.graph, int(np.random.default_rng(seed).integers(session.graph.num_poses))
    k = graph.group.position_dim
    batch = ActionBatch(graph, session.actions)
    found = log_det_increments(
        factored(graph, held, "joint"), batch.extensions, blocks_of(batch.rows, "joint"), wanted="parts", first_rows=k
    )
    starts = batch.extensions.edge_start
    for n, action in enumerate(session.actions):
        planted = np.r_[np.ones(graph.num_edges, bool), batch.extensions.planted[starts[n] : starts[n + 1]]]
        after = posterior(graph, action)
        rows = dense_rows(after, held)
        base, closures = rows[planted], rows[~planted]
        base = base.reshape(len(base) * rows.shape[1], rows.shape[2])
        covariance = np.linalg.inv(base.T @ base)
        for part, value in ((slice(0, k), found.first_rows), (slice(k, None), found.other_rows), (slice(None), found.closures)):
            chosen = closures[:, part]
            chosen = chosen.reshape(len(chosen) * chosen.shape[1], rows.shape[2])
            expected = np.linalg.slogdet(np.eye(len(chosen)) + chosen @ covariance @ chosen.T)[1]
            assert value[n] == pytest.approx(expected, rel=1e-7, abs=1e-7)


def dense_rows(graph, held):
    """I's whitened rows on all variables but the held pose's, (m, kappa, variables)."""
    form = fisher_rows(graph).joint()
    m, r, b = form.rows_i.shape
    rows = np.zeros((m, r, graph.num_poses, b))
    rows[np.arange(m), :, graph.edges[:, 0]] = form.rows_i
    rows[np.arange(m), :, graph.edges[:, 1]] = form.rows_j
    return np.delete(rows, held, axis=2).reshape(m, r, (graph.num_poses - 1) * b)


@given(sessions(log_ratio=(-2.0, 1.5)), st.sampled_from(PARTS), st.sampled_from([0.0, 2.5]), seeds)
def test_increments_of_the_diagonal_blocks(session, part, shift, seed):
    graph, held = session.graph, int(np.random.default_rng(seed).integers(session.graph.num_poses))
    batch = ActionBatch(graph, session.actions)
    shifts = np.full(batch.count, shift)
    prior = blocks_of(fisher_rows(graph), part)
    found, errors = diagonal_increments(prior, held, batch.extensions, blocks_of(batch.rows, part), shifts)
    before = diagonal_log_det(graph, prior, held, shift)
    for k, action in enumerate(session.actions):
        after = posterior(graph, action)
        expected = diagonal_log_det(after, blocks_of(fisher_rows(after), part), held, shift)
        assert before + found[k] == pytest.approx(expected, rel=1e-9, abs=1e-9)
        assert 0 <= errors[k] < 1e-9


def diagonal_log_det(graph, form, held, shift):
    blocks = np.zeros((graph.num_poses, form.block_size, form.block_size)) + shift * np.eye(form.block_size)
    for (i, j), rows_i, rows_j in zip(form.edges.tolist(), form.rows_i, form.rows_j, strict=True):
        blocks[i] += rows_i.T @ rows_i
        blocks[j] += rows_j.T @ rows_j
    return float(np.sum(np.linalg.slogdet(np.delete(blocks, held, axis=0))[1]))


@given(sessions())
def test_a_forest_attaches_every_new_node_once_and_parents_come_first(session):
    batch = ActionBatch(session.graph, session.actions)
    extensions, n = batch.extensions, session.graph.num_poses
    assert extensions.planted.sum() == batch.num_new.sum()
    np.testing.assert_array_equal(np.flatnonzero(extensions.planted), np.sort(extensions.stem))
    seen = set(range(n))
    for new in extensions.order.tolist():
        i, j = extensions.edges[extensions.stem[new]].tolist()
        assert n + new in (i, j)
        assert i + j - (n + new) in seen
        seen.add(n + new)
    assert len(seen) == n + batch.num_new.sum()


def test_a_chain_is_its_own_forest_whatever_it_closes():
    edges = np.array([(9, 10), (10, 2), (10, 11), (3, 11), (11, 12), (12, 10), (12, 4)])
    extensions = Extensions.of(10, edges, np.array([0, 7]), np.array([0, 3]))
    assert edges[extensions.stem].tolist() == [[9, 10], [10, 11], [11, 12]]
    assert extensions.order.tolist() == [0, 1, 2]


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP])
def test_neither_the_batch_nor_memory_nor_threads_change_them(monkeypatch, part, group):
    rng = np.random.default_rng(11)
    noise = Noise(group, NOISES[1], 100.0, 0.4, 2.0)
    graph = random_pose_graph(rng, noise, 60, 30)
    actions = [random_action(rng, graph, noise, max_new=12, max_closures=12) for _ in range(30)]
    factor = factored(graph, 59, part)
    batch = ActionBatch(graph, tuple(actions))
    together = log_det_increments(factor, batch.extensions, blocks_of(batch.rows, part))
    monkeypatch.setattr(increments_module, "_PATH_NUMBERS", 2000)
    monkeypatch.setattr(increments_module, "num_threads", lambda: 3)
    grouped = log_det_increments(factor, batch.extensions, blocks_of(batch.rows, part))
    for name in ("forest", "closures", "closures_held"):
        np.testing.assert_array_equal(getattr(grouped, name), getattr(together, name))
    for k, action in enumerate(actions):
        alone = ActionBatch(graph, (action,))
        single = log_det_increments(factor, alone.extensions, blocks_of(alone.rows, part))
        assert single.forest[0] == together.forest[k]
        assert single.closures[0] == pytest.approx(together.closures[k], rel=1e-12, abs=1e-12)
