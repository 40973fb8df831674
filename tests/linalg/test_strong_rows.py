"""Rows far stronger than the others: taken apart, they cost the others no digits and a decision no dense QR."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from graphs import SE2_GROUP, SE3_GROUP, Noise, random_pose_graph
from references import log_det_exact
from topobelief.entropy import joint_entropy_estimate
from topobelief.graph.fisher import fisher_rows
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg import LogDetSolver, laplacian_form, log_det, strong_rows
from topobelief.linalg.strong_rows import StrongRows

seeds = st.integers(0, 2**32 - 1)
FORMS = ("joint", "positions", "rotations", "rotations_given_positions")


def winding(num_poses, rng, strong):
    """A winding drive with closures, some edges of which are as strong as is given."""
    heading = np.cumsum(rng.normal(0, 0.3, num_poses))
    positions = np.cumsum(np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
    edges = [(i, i + 1) for i in range(num_poses - 1)]
    edges += [tuple(rng.choice(num_poses, 2, replace=False).tolist()) for _ in range(num_poses // 5)]
    information = np.tile(np.diag([100.0, 100.0, 400.0]), (len(edges), 1, 1))
    for place, strength in enumerate(strong):
        information[(place + 1) * num_poses // (len(strong) + 1)] = strength * np.eye(3)
    return PoseGraph(np.column_stack([positions, heading]), edges, None, information)


@settings(max_examples=40)
@given(
    st.sampled_from([SE2_GROUP, SE3_GROUP]), st.sampled_from(["isotropic", "full"]), st.integers(3, 7), st.integers(1, 6), seeds
)
def test_covered_by_their_errors_in_80_digits(group, kind, num_poses, num_extra, seed):
    rng = np.random.default_rng(seed)
    graph = random_pose_graph(rng, Noise(group, kind, 100.0, 1.0, 1.0), num_poses, num_extra)
    information = graph.information.copy()
    information[rng.integers(graph.num_edges, size=2)] *= 10.0 ** rng.uniform(2, 13)
    graph = PoseGraph(graph.poses, graph.edges, None, information)
    rows, held = fisher_rows(graph), int(rng.integers(num_poses))
    solver = LogDetSolver(graph.edges, num_poses, held)
    for name in FORMS:
        form = getattr(rows, name)()
        exact = float(log_det_exact(graph, name, held=held)) / form.multiplicity
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(strong_rows, "_STRONG", 10.0)
            found = solver._by_strong_rows(form, 0.0)
        if math.isfinite(found.error):
            assert found.value == pytest.approx(exact, rel=1e-15, abs=found.error)


def test_what_strong_rows_lack_completes_their_gram_matrix():
    graph = winding(20, np.random.default_rng(0), [1e9, 1e12])
    form = fisher_rows(graph).joint()
    strong = StrongRows.of(form)
    assert set(strong.edge.tolist()) == {6, 13}
    ends = (form.rows_i, strong.weakened.rows_i, strong.rows_i), (form.rows_j, strong.weakened.rows_j, strong.rows_j)
    for rows, weakened, lacking in ends:
        for edge in range(graph.num_edges):
            more = lacking[strong.edge == edge]
            gram, total = rows[edge].T @ rows[edge], weakened[edge].T @ weakened[edge] + more.T @ more
            assert np.allclose(total, gram, rtol=1e-12, atol=1e-12 * np.abs(gram).max())


@pytest.mark.parametrize("weights", [np.ones(5), np.array([1.0, 1.0, 1e12, 1e12, 1e12])], ids=["alike", "mostly strong"])
def test_no_row_is_strong_where_none_stands_out(weights):
    edges = np.array([(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)])
    assert StrongRows.of(laplacian_form(edges, weights)) is None


def test_three_strong_edges_among_300_poses_need_no_qr(monkeypatch):
    monkeypatch.setattr(log_det, "log_det_by_qr", lambda *arguments: pytest.fail("QR"))
    graph = winding(300, np.random.default_rng(0), [1.3e10, 1.7e12, 1.1e13])
    assert joint_entropy_estimate(graph).error < 1e-7
    rows = fisher_rows(graph)
    for name in FORMS:
        assert LogDetSolver(graph.edges, 300, 299).log_det(getattr(rows, name)()).error < 1e-7


def test_it_is_the_value_that_qr_gives():
    graph = winding(60, np.random.default_rng(3), [1.3e10, 1.7e12, 1.1e13])
    form = fisher_rows(graph).joint()
    solver = LogDetSolver(graph.edges, 60, 59)
    pattern = solver.pattern(3)
    by_qr = log_det._by_qr(pattern.dense_rows(form), pattern.magnitude(form), 0.0)
    by_strong_rows = solver._by_strong_rows(form, 0.0)
    assert by_strong_rows.error < 1e-8
    assert by_strong_rows.value == pytest.approx(by_qr.value, abs=by_strong_rows.error + by_qr.error)
