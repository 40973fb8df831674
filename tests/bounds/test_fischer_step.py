"""Fischer's bounds one step closer: always bounds, never looser, and what the formula says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graphs import NOISES, SE2_GROUP, SE3_GROUP, Noise, pose_graphs, random_pose_graph
from topobelief.bounds import entropy_bounds
from topobelief.entropy import joint_entropy_estimate
from topobelief.errors import IllConditionedError
from topobelief.forms.of_graph import GraphForms
from topobelief.graph.fisher import fisher_rows

DETERMINANTS = ("cholesky", "hadamard")


@given(pose_graphs(log_ratio=(-3.0, 2.0)), st.sampled_from(DETERMINANTS), st.data())
def test_never_looser_than_fischer_and_always_a_bound(graph, determinant, data):
    anchor = data.draw(st.integers(0, graph.num_poses - 1))
    fischer, closer = (
        entropy_bounds(graph, family=family, determinant=determinant, anchor=anchor) for family in ("fischer", "fischer_step")
    )
    entropy = joint_entropy_estimate(graph)
    rounding = 1e-9 * (1 + abs(entropy.value))
    assert fischer.lower - rounding <= closer.lower <= entropy.value + entropy.error
    assert closer.upper == pytest.approx(fischer.upper, rel=1e-12, abs=1e-9)


@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP])
@pytest.mark.parametrize("kind", NOISES)
@pytest.mark.parametrize("step", [0.0, 0.5, 0.8, 1.0])
def test_the_formula_with_dense_matrices(group, kind, step):
    """I_rr + N^T I_pr + I_rp N + N^T I_pp N with N = -step D^-1 I_pr, and its diagonal blocks."""
    rng = np.random.default_rng(7)
    graph = random_pose_graph(rng, Noise(group, kind, 100.0, 0.5, 2.0), 12, 8)
    k, kappa, anchor = group.position_dim, group.tangent_dim, 3
    form = fisher_rows(graph).joint()
    rows = np.zeros((graph.num_edges, kappa, graph.num_poses, kappa))
    rows[np.arange(graph.num_edges), :, graph.edges[:, 0]] = form.rows_i
    rows[np.arange(graph.num_edges), :, graph.edges[:, 1]] = form.rows_j
    rows = np.delete(rows, anchor, axis=2)
    p, r = (rows[..., part].reshape(graph.num_edges * kappa, -1) for part in (slice(k), slice(k, None)))
    diagonal = np.kron(np.eye(graph.num_poses - 1), np.ones((k, k))) * (p.T @ p)
    shear = -step * np.linalg.solve(diagonal, p.T @ r)
    forms = GraphForms(graph, anchor=anchor)
    found = forms.sheared_rotations(step, hadamard=False)
    expected = np.linalg.slogdet((r + p @ shear).T @ (r + p @ shear))[1]
    assert found.value == pytest.approx(expected, abs=1e-9 + found.error)
    reduced = r.T @ r - 2 * step * (1 - step) * (r.T @ p) @ np.linalg.solve(diagonal, p.T @ r)
    q = kappa - k
    blocks = [reduced[i : i + q, i : i + q] for i in range(0, len(reduced), q)]
    by_blocks = forms.sheared_rotations(step, hadamard=True)
    assert by_blocks.value == pytest.approx(sum(np.linalg.slogdet(block)[1] for block in blocks), abs=1e-9 + by_blocks.error)
    if step == 0.0:
        assert found.value == pytest.approx(forms.log_det("rotations").value, abs=1e-9)


def test_rounding_is_covered_or_refused_at_any_condition():
    """Positions of 1e4 m and weights over 16 decades: bounds hold for the exact value, or an error says why not."""
    refused = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        noise = Noise(SE2_GROUP, "full", 10.0 ** rng.uniform(-6, 6), 10.0 ** rng.uniform(-4, 5), 1e2, spread=4.0)
        graph = random_pose_graph(rng, noise, 8, 6)
        try:
            entropy = joint_entropy_estimate(graph)
            found = [entropy_bounds(graph, family="fischer_step", determinant=each) for each in DETERMINANTS]
        except IllConditionedError:
            refused += 1
            continue
        assert all(bounds.lower <= entropy.value + entropy.error for bounds in found)
    assert refused < 30


def test_a_single_pose_and_a_tree():
    rng = np.random.default_rng(0)
    for num_poses in (1, 2, 6):
        graph = random_pose_graph(rng, Noise(SE3_GROUP, "full", 1.0, 1.0, 1.0), num_poses, 0)
        for determinant in DETERMINANTS:
            bounds = entropy_bounds(graph, family="fischer_step", determinant=determinant)
            assert bounds.lower <= joint_entropy_estimate(graph).value + 1e-9
