"""Von Neumann entropies by degrees of many extensions, against the extended graphs' own."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from topobelief.signatures.degree_increments import DegreeEntropy

from graphs import connected_topologies
from topobelief.graph.topology import Topology
from topobelief.signatures.von_neumann import von_neumann_entropy_approx


def of_extensions(topology, extensions):
    """Entropies of a list of (edges, number of new nodes)."""
    edges = np.concatenate([np.reshape(np.array(edges, dtype=np.int64), (-1, 2)) for edges, _ in extensions])
    edge_start = np.cumsum([0] + [len(edges) for edges, _ in extensions])
    return DegreeEntropy(topology).of_extensions(edges, edge_start, np.array([new for _, new in extensions]))


@given(connected_topologies(max_nodes=8), st.lists(st.tuples(st.integers(0, 5), st.integers(0, 12)), min_size=1), st.randoms())
def test_they_are_those_of_the_extended_graphs(topology, sizes, random):
    """New nodes without edges, parallel edges, edges that the graph has already: all as in the graph as a whole."""
    extensions = []
    for num_new, num_edges in sizes:
        total = topology.num_nodes + num_new
        edges = [random.sample(range(total), 2) for _ in range(num_edges)] if total > 1 else []
        extensions.append((edges + edges[:2] + topology.edges[:1].tolist(), num_new))
    for (edges, num_new), found in zip(extensions, of_extensions(topology, extensions), strict=True):
        whole = Topology(topology.num_nodes + num_new, [*topology.edges.tolist(), *edges])
        assert found == pytest.approx(von_neumann_entropy_approx(whole), rel=1e-13)


def test_an_edge_that_is_there_already_changes_nothing():
    triangle = Topology(3, [(0, 1), (1, 2), (2, 0)])
    found = of_extensions(triangle, [([], 0), ([(1, 0), (0, 2), (0, 2)], 0)])
    assert found[0] == found[1] == pytest.approx(von_neumann_entropy_approx(triangle), rel=1e-15)
