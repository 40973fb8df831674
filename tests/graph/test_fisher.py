"""The four matrices made of whitened world-frame rows have the determinants that body-frame Jacobians give."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graphs import noises, pose_graphs, random_action, random_pose_graph
from references import log_det_reference
from topobelief.graph.action import posterior
from topobelief.graph.fisher import fisher_rows
from topobelief.linalg import LogDetSolver

PARTS = ("joint", "positions", "rotations", "rotations_given_positions")


@given(pose_graphs(min_poses=2), st.data())
def test_each_part_agrees_with_its_dense_definition_whatever_is_held(graph, data):
    held = data.draw(st.integers(0, graph.num_poses - 1))
    rows, solver = fisher_rows(graph), LogDetSolver(graph.edges, graph.num_poses, held)
    for part in PARTS:
        found = solver.log_det(getattr(rows, part)())
        expected = log_det_reference(graph, part, held=held)
        assert found.value == pytest.approx(expected, rel=1e-9, abs=1e-7 + 2 * found.error), part


@given(pose_graphs(min_poses=2), st.data())
def test_all_but_the_rotations_part_are_the_same_whatever_is_held(graph, data):
    """log det I, I_pp and L_r|p do not depend on the anchor; I_rr may."""
    one, other = (data.draw(st.integers(0, graph.num_poses - 1)) for _ in range(2))
    rows = fisher_rows(graph)
    for part in ("joint", "positions", "rotations_given_positions"):
        found = [LogDetSolver(graph.edges, graph.num_poses, held).log_det(getattr(rows, part)()) for held in (one, other)]
        assert found[0].value == pytest.approx(found[1].value, abs=1e-9 + found[0].error + found[1].error), part


@given(noises(), st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_rows_of_a_prior_and_of_an_action_join_to_those_of_the_posterior(noise, num_poses, seed):
    rng = np.random.default_rng(seed)
    graph = random_pose_graph(rng, noise, num_poses, 3)
    after = posterior(graph, random_action(rng, graph, noise))
    joined = fisher_rows(graph).joined(fisher_rows(after, first_edge=graph.num_edges))
    whole = fisher_rows(after)
    solver = LogDetSolver(after.edges, after.num_poses, 0)
    for part in PARTS:
        a, b = solver.log_det(getattr(joined, part)()), solver.log_det(getattr(whole, part)())
        assert a.value == pytest.approx(b.value, abs=1e-12 + a.error + b.error), part


@given(pose_graphs(min_poses=2, kinds=("equal",)))
def test_equal_noise_gives_multiples_of_one_laplacian(graph):
    """THEORY section 4: I_pp = w_p L kron I_k, L_r|p = w_r L, as scalar forms."""
    rows = fisher_rows(graph)
    k, q = graph.group.position_dim, graph.group.rotation_dim
    positions, rotations = rows.positions(), rows.rotations_given_positions()
    assert (positions.block_size, positions.multiplicity) == (1, k)
    assert (rotations.block_size, rotations.multiplicity) == (1, q)
    assert np.allclose(
        rows.squared_lengths(), np.sum((graph.positions[graph.edges[:, 1]] - graph.positions[graph.edges[:, 0]]) ** 2, axis=1)
    )
