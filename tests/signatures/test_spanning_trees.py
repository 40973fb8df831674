"""Spanning trees: known counts, laws of weights, and the signature's closed forms."""

import math
from itertools import combinations

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from graphs import SPANNING_TREES, bundle, connected_topologies, cycle, noises, path, petersen
from references import LOG_2_PI_E
from topobelief.errors import DisconnectedGraphError, IllConditionedError, InvalidGraphError
from topobelief.graph.information import block_isotropic
from topobelief.graph.topology import Topology
from topobelief.signatures.spanning_trees import log_num_spanning_trees, spanning_tree_signature

seeds = st.integers(0, 2**32 - 1)


def random_weights(seed, count):
    return np.random.default_rng(seed).uniform(0.1, 10, count)


@pytest.mark.parametrize("name", SPANNING_TREES)
def test_named_graphs_have_the_trees_of_the_textbook(name):
    topology, count = SPANNING_TREES[name]
    assert log_num_spanning_trees(topology) == pytest.approx(math.log(count), rel=1e-12, abs=1e-9)


@settings(max_examples=25)
@given(connected_topologies(max_nodes=6, max_extra=5), seeds)
def test_weighted_trees_are_those_that_enumeration_finds(topology, seed):
    """t(G) is the sum over spanning trees of the product of their weights: the definition, tree by tree."""
    weights = random_weights(seed, topology.num_edges)
    n, total = topology.num_nodes, 0.0
    for subset in combinations(range(topology.num_edges), n - 1):
        if Topology(n, topology.edges[list(subset)]).num_components == 1:
            total += float(np.prod(weights[list(subset)]))
    assert log_num_spanning_trees(topology, weights=weights) == pytest.approx(math.log(total), abs=1e-10)


@given(connected_topologies(min_nodes=2, max_nodes=12, max_extra=20))
def test_unweighted_trees_agree_with_networkx(topology):
    graph = nx.MultiGraph(topology.edges.tolist())
    assert log_num_spanning_trees(topology) == pytest.approx(math.log(nx.number_of_spanning_trees(graph)), abs=1e-9)


@given(connected_topologies(), seeds, st.floats(-6, 6))
def test_scaling_the_weights_adds_a_constant_per_free_node(topology, seed, decades):
    weights = random_weights(seed, topology.num_edges)
    scaled = log_num_spanning_trees(topology, weights=10**decades * weights)
    expected = log_num_spanning_trees(topology, weights=weights) + (topology.num_nodes - 1) * decades * math.log(10)
    assert scaled == pytest.approx(expected, abs=1e-9)


@given(connected_topologies(), seeds)
def test_names_order_and_direction_do_not_matter(topology, seed):
    rng = np.random.default_rng(seed)
    weights = random_weights(seed, topology.num_edges)
    permutation, order = rng.permutation(topology.num_nodes), rng.permutation(topology.num_edges)
    other = Topology(topology.num_nodes, permutation[topology.edges[order]][:, ::-1])
    expected = log_num_spanning_trees(topology, weights=weights)
    assert log_num_spanning_trees(other, weights=weights[order]) == pytest.approx(expected, abs=1e-10)


@given(connected_topologies(min_nodes=2), seeds)
def test_a_new_edge_adds_trees(topology, seed):
    rng = np.random.default_rng(seed)
    more = Topology(topology.num_nodes, [*topology.edges.tolist(), rng.choice(topology.num_nodes, 2, replace=False).tolist()])
    assert log_num_spanning_trees(more) > log_num_spanning_trees(topology) + 1e-9


@given(connected_topologies(min_nodes=2), seeds)
def test_parallel_edges_add_their_weights(topology, seed):
    weights = random_weights(seed, topology.num_edges)
    shares = np.random.default_rng(seed).uniform(0.1, 0.9, topology.num_edges)
    doubled = Topology(topology.num_nodes, np.concatenate([topology.edges, topology.edges[:, ::-1]]))
    expected = log_num_spanning_trees(topology, weights=weights)
    found = log_num_spanning_trees(doubled, weights=np.concatenate([shares * weights, (1 - shares) * weights]))
    assert found == pytest.approx(expected, abs=1e-10)


def test_bundles_and_bridges():
    assert log_num_spanning_trees(bundle(5), weights=[1.0, 2.0, 3.0, 4.0, 5.0]) == pytest.approx(math.log(15))
    two_triangles = Topology(6, [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (2, 3)])
    weights = [1.0] * 6 + [1e-3]
    assert log_num_spanning_trees(two_triangles, weights=weights) == pytest.approx(math.log(9e-3))


def test_a_disconnected_graph_has_no_tree():
    for call in (log_num_spanning_trees, lambda topology: spanning_tree_signature(topology, np.eye(3))):
        with pytest.raises(DisconnectedGraphError, match="node 0 does not reach: 2, 3"):
            call(Topology(4, [(0, 1), (2, 3)]))


def test_bad_weights_and_noise_are_refused():
    with pytest.raises(InvalidGraphError, match=r"expected positive finite weights, got 0\.0 at edge 1"):
        log_num_spanning_trees(cycle(3), weights=[1, 0, 1])
    with pytest.raises(InvalidGraphError, match=r"expected information matrices of size 3 \(SE\(2\)\) or 6"):
        spanning_tree_signature(cycle(3), np.eye(2))
    with pytest.raises(InvalidGraphError, match=r"expected information of shape \(3, 3, 3\) or \(3, 3\).*got \(2, 3, 3\)"):
        spanning_tree_signature(cycle(3), np.tile(np.eye(3), (2, 1, 1)))
    with pytest.raises(InvalidGraphError, match="expected a positive definite information matrix"):
        spanning_tree_signature(cycle(3), -np.eye(3))


@pytest.mark.parametrize("first", [1e-17, 1e-30, 1e-300])
@pytest.mark.parametrize("num_nodes", [3, 1500])
def test_a_tree_of_extreme_weights_is_counted_right_or_refused(first, num_nodes):
    """A path has one tree: tau is the sum of ln w. Never nan, never a wrong number without a word."""
    for place in (0, num_nodes // 2):
        weights = np.ones(num_nodes - 1)
        weights[place] = first
        try:
            tau = log_num_spanning_trees(path(num_nodes), weights=weights)
        except IllConditionedError:
            continue
        assert tau == pytest.approx(math.log(first), abs=0.1)


def test_a_signature_of_extreme_noise_is_right_or_refused():
    """On a tree s_ST = -J = sum of ln|Omega| / 2 - constants, whatever the noise."""
    information = np.tile(np.eye(3), (1499, 1, 1))
    information[700] *= 1e-20
    expected = 0.5 * 3 * math.log(1e-20) - 1499 * 1.5 * LOG_2_PI_E
    try:
        found = spanning_tree_signature(path(1500), information)
    except IllConditionedError:
        return
    assert found == pytest.approx(expected, abs=0.1)


# s_ST -------------------------------------------------------------------------------------------------------------------


@given(connected_topologies(), noises(kinds=("equal",)), seeds)
def test_one_omega_gives_the_papers_signature(topology, noise, seed):
    """s_ST = kappa/2 tau + (n-1)/2 [ln|Omega| - kappa ln(2 pi e)], shared or repeated."""
    omega = noise.draw(np.random.default_rng(seed), 1)[0]
    kappa, free = len(omega), topology.num_nodes - 1
    expected = kappa / 2 * log_num_spanning_trees(topology) + free / 2 * (np.linalg.slogdet(omega)[1] - kappa * LOG_2_PI_E)
    assert spanning_tree_signature(topology, omega) == pytest.approx(expected, rel=1e-12, abs=1e-9)
    repeated = np.tile(omega, (topology.num_edges, 1, 1))
    assert spanning_tree_signature(topology, repeated) == pytest.approx(expected, rel=1e-12, abs=1e-9)


@given(connected_topologies(), noises(), seeds)
def test_any_noise_is_two_weighted_counts(topology, noise, seed):
    """s_ST = (k tau_p + q tau_r)/2 - constants with w_p = |Omega_pp|^(1/k), w_r = |Omega_r|p|^(1/q) (THEORY section 5)."""
    information = noise.draw(np.random.default_rng(seed), topology.num_edges)
    k, q = noise.group.position_dim, noise.group.rotation_dim
    w_p = np.linalg.det(information[:, :k, :k]) ** (1 / k)
    w_r = np.exp((np.linalg.slogdet(information)[1] - k * np.log(w_p)) / q)
    tau_p, tau_r = (log_num_spanning_trees(topology, weights=w) for w in (w_p, w_r))
    expected = (k * tau_p + q * tau_r) / 2 - (topology.num_nodes - 1) * (k + q) / 2 * LOG_2_PI_E
    assert spanning_tree_signature(topology, information) == pytest.approx(expected, rel=1e-9, abs=1e-7)


def test_one_node_has_no_uncertainty():
    assert spanning_tree_signature(Topology(1, []), np.eye(3)) == 0.0


def test_petersen_with_the_papers_noise():
    sigma_p, sigma_theta = 0.1, 0.035
    omega = block_isotropic(sigma_p, sigma_theta)
    expected = 1.5 * math.log(2000) + 4.5 * (
        -4 * math.log(sigma_p) - 2 * math.log(sigma_theta) - 3 * math.log(2 * math.pi * math.e)
    )
    assert spanning_tree_signature(petersen(), omega) == pytest.approx(expected, rel=1e-13)
