"""Degree sums of many extensions, against the extended graphs' own."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graphs import connected_topologies
from topobelief.forms.degree_sums import DegreeSums
from topobelief.graph.topology import Topology


def of_extensions(topology, extensions):
    """Degree sums of a list of (edges, number of new nodes)."""
    edges = np.concatenate([np.reshape(np.array(edges, dtype=np.int64), (-1, 2)) for edges, _ in extensions])
    edge_start = np.cumsum([0] + [len(edges) for edges, _ in extensions])
    return DegreeSums(topology).of_extensions(edges, edge_start, np.array([new for _, new in extensions]))


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
        assert found == pytest.approx(whole.degree_sum, rel=1e-12, abs=1e-12)


def test_an_edge_that_is_there_already_changes_nothing():
    triangle = Topology(3, [(0, 1), (1, 2), (2, 0)])
    found = of_extensions(triangle, [([], 0), ([(1, 0), (0, 2), (0, 2)], 0)])
    assert found[0] == found[1] == pytest.approx(triangle.degree_sum, rel=1e-15)
