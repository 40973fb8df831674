"""Von Neumann entropy by spectrum and by degrees: known values, the expansion that links them, and what is announced."""

import math
import warnings

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graphs import bundle, complete, complete_bipartite, connected_topologies, cycle, noises, path, petersen
from references import LOG_2_PI_E
from topobelief.errors import InvalidGraphError
from topobelief.graph.topology import Topology
from topobelief.signatures import von_neumann
from topobelief.signatures.von_neumann import (
    ExpensiveSpectrumWarning,
    normalized_laplacian,
    von_neumann_entropy,
    von_neumann_entropy_approx,
)


def entropy_of_eigenvalues(*values_and_counts):
    """- sum of (v/2) ln(v/2), 0 ln 0 = 0."""
    return -sum(count * value / 2 * math.log(value / 2) for value, count in values_and_counts if value > 0)


@pytest.mark.parametrize(
    ("topology", "spectrum"),
    [
        (Topology(1, []), [(0, 1)]),
        (path(2), [(0, 1), (2, 1)]),
        (path(3), [(0, 1), (1, 1), (2, 1)]),
        (complete(7), [(0, 1), (7 / 6, 6)]),
        (complete_bipartite(3, 5), [(0, 1), (1, 6), (2, 1)]),
        (petersen(), [(0, 1), (2 / 3, 5), (5 / 3, 4)]),
        (cycle(6), [(0, 1), (0.5, 2), (1.5, 2), (2, 1)]),
    ],
    ids=["one node", "path 2", "path 3", "K_7", "K_3,5", "Petersen", "cycle 6"],
)
def test_known_spectra(topology, spectrum):
    assert von_neumann_entropy(topology) == pytest.approx(entropy_of_eigenvalues(*spectrum), abs=1e-12)


@pytest.mark.parametrize(
    ("topology", "sum_over_edges"),
    [
        (Topology(1, []), 0),
        (path(2), 1),
        (path(5), 2 / 2 + 2 / 4),
        (cycle(9), 9 / 4),
        (complete(6), 15 / 25),
        (petersen(), 15 / 9),
        (complete_bipartite(3, 5), 15 / 15),
    ],
    ids=["one node", "path 2", "path 5", "cycle 9", "K_6", "Petersen", "K_3,5"],
)
def test_known_degrees(topology, sum_over_edges):
    """n/2 ln 2 - 1/2 sum over edges of 1/(d(i) d(j)), each undirected edge once."""
    expected = topology.num_nodes / 2 * math.log(2) - sum_over_edges / 2
    assert von_neumann_entropy_approx(topology) == pytest.approx(expected, abs=1e-13)


@given(connected_topologies(min_nodes=2))
def test_the_normalised_laplacian_is_that_of_networkx(topology):
    graph = nx.Graph(topology.edges.tolist())
    expected = nx.normalized_laplacian_matrix(graph, nodelist=range(topology.num_nodes)).toarray()
    assert np.allclose(normalized_laplacian(topology), expected, rtol=0, atol=1e-14)
    values = np.clip(np.linalg.eigvalsh(expected), 1e-300, None) / 2
    assert von_neumann_entropy(topology) == pytest.approx(float(-np.sum(values * np.log(values))), abs=1e-10)


@given(connected_topologies(min_nodes=2))
def test_by_degrees_is_the_quadratic_expansion_of_the_exact_one(topology):
    """-x ln x about x = 1/2 to second order, summed over the spectrum: 1/2 ln 2 + (ln 2 - 1)(x - 1/2) - (x - 1/2)^2."""
    x = np.linalg.eigvalsh(normalized_laplacian(topology)) / 2
    expansion = 0.5 * math.log(2) + (math.log(2) - 1) * (x - 0.5) - (x - 0.5) ** 2
    assert von_neumann_entropy_approx(topology) == pytest.approx(float(expansion.sum()), abs=1e-11)


@given(connected_topologies(min_nodes=2), st.integers(0, 2**32 - 1))
def test_names_directions_and_parallel_edges_do_not_matter(topology, seed):
    rng = np.random.default_rng(seed)
    edges = rng.permutation(topology.num_nodes)[topology.edges]
    other = Topology(topology.num_nodes, np.concatenate([edges, edges[:, ::-1]]))
    for entropy in (von_neumann_entropy, von_neumann_entropy_approx):
        assert entropy(other) == pytest.approx(entropy(topology), abs=1e-10)


def test_a_bundle_is_one_edge():
    for entropy in (von_neumann_entropy, von_neumann_entropy_approx):
        assert entropy(bundle(7)) == pytest.approx(entropy(path(2)), abs=1e-15)


def test_disconnected_graphs_and_lonely_nodes_are_welcome():
    """Spectra of components join; a node without edges adds a zero eigenvalue."""
    topology = Topology(7, [(0, 1), (2, 3), (3, 4), (4, 2)])
    assert von_neumann_entropy(topology) == pytest.approx(entropy_of_eigenvalues((0, 4), (2, 1), (1.5, 2)), abs=1e-12)
    assert von_neumann_entropy_approx(topology) == pytest.approx(7 / 2 * math.log(2) - 0.5 * (1 + 3 / 4), abs=1e-12)


@given(connected_topologies(), noises(kinds=("equal",)), st.integers(0, 2**32 - 1))
def test_the_normalised_form_adds_the_noise_of_the_spanning_tree_signature(topology, noise, seed):
    omega = noise.draw(np.random.default_rng(seed), 1)[0]
    added = (topology.num_nodes - 1) / 2 * (np.linalg.slogdet(omega)[1] - len(omega) * LOG_2_PI_E)
    expected = von_neumann_entropy_approx(topology) + (added if topology.num_edges else 0)
    assert von_neumann_entropy_approx(topology, information=omega) == pytest.approx(expected, rel=1e-12, abs=1e-9)
    repeated = np.tile(omega, (topology.num_edges, 1, 1))
    assert von_neumann_entropy_approx(topology, information=repeated) == pytest.approx(expected, rel=1e-12, abs=1e-9)


def test_the_normalised_form_takes_the_mean_where_noise_differs():
    information = np.stack([np.eye(3), 100 * np.eye(3)])
    expected = von_neumann_entropy_approx(path(3)) + 2 / 2 * (3 * math.log(10) - 3 * LOG_2_PI_E)
    assert von_neumann_entropy_approx(path(3), information=information) == pytest.approx(expected)


def test_bad_noise_is_refused():
    with pytest.raises(InvalidGraphError, match=r"expected information matrices of size 3 \(SE\(2\)\) or 6 \(SE\(3\)\), got 5"):
        von_neumann_entropy_approx(path(3), information=np.eye(5))


def test_a_large_spectrum_is_announced_with_its_time_and_memory(monkeypatch):
    monkeypatch.setattr(von_neumann, "DENSE_SPECTRUM_SIZE", 20)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        von_neumann_entropy(cycle(20))
    with pytest.warns(
        ExpensiveSpectrumWarning, match=r"spectrum of 21 nodes takes about 0 s and 0.0 GB; von_neumann_entropy_approx needs"
    ):
        von_neumann_entropy(cycle(21))


def test_the_announcement_starts_above_3000_nodes():
    assert von_neumann.DENSE_SPECTRUM_SIZE == 3000
    assert 10 < von_neumann.expected_spectrum_seconds(10_000) < 1000


def test_entropy_is_never_minus_zero():
    """What is printed of one node reads 0.0."""
    assert str(von_neumann_entropy(Topology(1, []))) == "0.0"
