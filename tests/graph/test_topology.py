"""Topologies: degrees, Laplacians, components, and what is refused."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graphs import SPANNING_TREES, bundle, connected_topologies, cycle, petersen
from topobelief.errors import DisconnectedGraphError, InvalidGraphError, InvalidInputError
from topobelief.graph.topology import Topology, checked_anchor, checked_weights


def as_networkx(topology, weights=None):
    graph = nx.MultiGraph()
    graph.add_nodes_from(range(topology.num_nodes))
    weights = np.ones(topology.num_edges) if weights is None else weights
    graph.add_weighted_edges_from((*edge, weight) for edge, weight in zip(topology.edges.tolist(), weights, strict=True))
    return graph


@given(connected_topologies(), st.integers(0, 2**32 - 1))
def test_degrees_and_laplacians_agree_with_networkx(topology, seed):
    weights = np.random.default_rng(seed).uniform(0.1, 5, topology.num_edges)
    graph = as_networkx(topology, weights)
    assert topology.degrees.tolist() == [degree for _, degree in graph.degree()]
    assert np.allclose(topology.weighted_degrees(weights), [degree for _, degree in graph.degree(weight="weight")])
    if topology.num_edges:
        expected = nx.laplacian_matrix(graph, nodelist=range(topology.num_nodes)).toarray()
        assert np.allclose(topology.laplacian(weights).toarray(), expected, atol=1e-12)


@given(connected_topologies(min_nodes=2), st.data())
def test_reduced_laplacian_lacks_the_anchor(topology, data):
    anchor = data.draw(st.integers(0, topology.num_nodes - 1))
    full = topology.laplacian().toarray()
    expected = np.delete(np.delete(full, anchor, axis=0), anchor, axis=1)
    assert np.array_equal(topology.reduced_laplacian(anchor=anchor).toarray(), expected)
    from_the_end = topology.reduced_laplacian(anchor=anchor - topology.num_nodes)
    assert np.array_equal(from_the_end.toarray(), expected)


@given(connected_topologies())
def test_laplacian_rows_sum_to_zero_and_direction_does_not_matter(topology):
    turned = Topology(topology.num_nodes, topology.edges[:, ::-1])
    assert np.array_equal(topology.laplacian().toarray(), turned.laplacian().toarray())
    assert np.abs(topology.laplacian().sum(axis=1)).max() == 0


def test_parallel_edges_add_and_simple_collapses_them():
    topology = bundle(5)
    assert topology.degrees.tolist() == [5, 5]
    assert topology.laplacian().toarray().tolist() == [[5, -5], [-5, 5]]
    assert topology.simple().edges.tolist() == [[0, 1]]


@given(connected_topologies())
def test_simple_has_the_neighbours_of_the_original(topology):
    simple = topology.simple()
    assert {frozenset(edge) for edge in simple.edges.tolist()} == {frozenset(edge) for edge in topology.edges.tolist()}
    assert simple.num_edges == len({frozenset(edge) for edge in simple.edges.tolist()})


def test_no_edges_give_an_empty_laplacian():
    lonely = Topology(3, [])
    assert lonely.edges.shape == (0, 2)
    assert lonely.laplacian().toarray().tolist() == np.zeros((3, 3)).tolist()
    assert lonely.simple().num_edges == 0
    assert lonely.num_components == 3


@pytest.mark.parametrize("name", SPANNING_TREES)
def test_named_graphs_are_connected(name):
    topology, _ = SPANNING_TREES[name]
    topology.require_connected(anchor=topology.num_nodes - 1)
    assert topology.num_components == 1


def test_a_disconnected_graph_names_what_the_anchor_does_not_reach():
    topology = Topology(9, [(0, 1), (2, 3), (3, 4), (5, 6), (7, 8)])
    with pytest.raises(
        DisconnectedGraphError, match=r"got 7 node\(s\) that node 0 does not reach: 2, 3, 4, 5, 6 and 2 more"
    ) as info:
        topology.require_connected()
    assert info.value.nodes == (2, 3, 4, 5, 6, 7, 8)
    with pytest.raises(DisconnectedGraphError, match=r"that node 30 does not reach: 0, 10, 20"):
        Topology(4, [(0, 1), (1, 2)]).require_connected(anchor=3, names=np.array([0, 10, 20, 30]))


def test_edges_enough_for_a_tree_do_not_hide_a_lonely_node():
    with pytest.raises(DisconnectedGraphError, match="node 0 does not reach: 3"):
        Topology(4, [(0, 1), (1, 2), (2, 0), (1, 0)]).require_connected()


@pytest.mark.parametrize(
    ("num_nodes", "edges", "message"),
    [
        (0, [], "expected at least one node, got 0"),
        (-3, [], "expected at least one node, got -3"),
        (2, [(0, 2)], r"expected node indices from 0 to 1, got edge 0 = \(0, 2\)"),
        (3, [(0, 1), (-1, 2)], r"expected node indices from 0 to 2, got edge 1 = \(-1, 2\)"),
        (3, [(0, 1), (2, 2)], r"got self-loop at node 2 \(edge 1\)"),
        (3, [(0, 1, 2)], r"expected edges of shape \(num_edges, 2\), got \(1, 3\)"),
        (3, [0, 1], r"expected edges of shape \(num_edges, 2\), got \(2,\)"),
    ],
)
def test_malformed_topologies_are_refused(num_nodes, edges, message):
    with pytest.raises(InvalidGraphError, match=message):
        Topology(num_nodes, edges)


def test_fractions_are_not_rounded_to_nodes():
    with pytest.raises(InvalidInputError, match="expected edges to be integers, got dtype float64"):
        Topology(3, [(0.0, 1.0), (1.0, 2.5)])
    with pytest.raises(InvalidInputError):
        Topology(2.7, [(0, 1)])


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ([1.0], r"expected one weight per edge, shape \(3,\), got \(1,\)"),
        ([1.0, 0.0, 1.0], "expected positive finite weights, got 0.0 at edge 1"),
        ([1.0, 1.0, -2.0], "expected positive finite weights, got -2.0 at edge 2"),
        ([np.nan, 1.0, 1.0], "expected positive finite weights, got nan at edge 0"),
        ([1.0, np.inf, 1.0], "expected positive finite weights, got inf at edge 1"),
    ],
)
def test_bad_weights_name_the_edge(weights, message):
    with pytest.raises(InvalidGraphError, match=message):
        checked_weights(cycle(3), weights)


def test_an_anchor_out_of_range_is_refused():
    assert checked_anchor(10, -1) == 9
    for anchor in (10, -11):
        with pytest.raises(InvalidGraphError, match=f"expected an anchor from 0 to 9, got {anchor}"):
            petersen().reduced_laplacian(anchor=anchor)


def test_topologies_do_not_change():
    edges = np.array([(0, 1), (1, 2)])
    topology = Topology(3, edges)
    edges[0] = (2, 2)
    assert topology.edges.tolist() == [[0, 1], [1, 2]]
    with pytest.raises(ValueError, match="read-only"):
        topology.edges[0, 0] = 2
    with pytest.raises(AttributeError):
        topology.num_nodes = 4
