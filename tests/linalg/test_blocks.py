"""The blocks of a graph, and log-determinants that fall apart into them."""

import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graphs import NOISES, SE2_GROUP, SE3_GROUP, Noise, connected_topologies, random_pose_graph
from references import log_det_exact
from topobelief.entropy import joint_entropy_estimate
from topobelief.graph.fisher import fisher_rows
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg import LogDetSolver, laplacian_form
from topobelief.linalg.blocks import CutGraph, blocks_of_edges
from topobelief.signatures.spanning_trees import log_num_spanning_trees

seeds = st.integers(0, 2**32 - 1)
FORMS = ("joint", "positions", "rotations_given_positions")


def marked(num_nodes, nodes):
    flags = np.ones(num_nodes, dtype=bool)
    flags[nodes] = False
    return flags


@given(st.integers(1, 14), st.integers(0, 24), seeds)
def test_agrees_with_networkx(num_nodes, num_edges, seed):
    """Parallel edges, isolated nodes and several components among them."""
    rng = np.random.default_rng(seed)
    pairs = [rng.choice(num_nodes, 2, replace=False) for _ in range(num_edges if num_nodes > 1 else 0)]
    edges = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    found, count = blocks_of_edges(edges, num_nodes)
    expected = {}
    for block, pairs in enumerate(nx.biconnected_component_edges(nx.Graph(edges.tolist()))):
        expected |= {frozenset(pair): block for pair in pairs}
    labels = [expected[frozenset(pair)] for pair in edges.tolist()]
    assert count == len(set(labels)) == len(set(zip(labels, found.tolist(), strict=True)))


def test_a_long_path_needs_no_recursion():
    edges = np.stack([np.arange(50_000), np.arange(1, 50_001)], axis=1)
    assert blocks_of_edges(edges, 50_001)[1] == 50_000


def test_cut_nodes_stand_in_each_of_their_blocks():
    """Two triangles at node 2, a bridge to node 5 and two parallel edges on to node 6."""
    edges = np.array([(0, 1), (1, 2), (2, 0), (2, 3), (3, 4), (4, 2), (4, 5), (5, 6), (6, 5)])
    cut = CutGraph.of(edges, marked(7, [0]))
    assert cut.is_grounded
    assert len(cut.node) == 3 + 3 + 2 + 2
    assert edges[cut.kept[cut.is_bridge]].tolist() == [[4, 5]]
    names = np.where(cut.node == 7, 0, cut.node)
    assert np.array_equal(names[cut.edges], edges[cut.kept])
    assert (cut.block_of_node[cut.edges] == cut.block_of_edge[:, None]).all()


def test_nodes_that_no_held_node_reaches_are_noticed():
    edges = np.array([(0, 1), (2, 3)])
    assert not CutGraph.of(edges, marked(4, [0])).is_grounded
    assert not CutGraph.of(edges[:1], marked(3, [0])).is_grounded
    assert CutGraph.of(edges, marked(4, [0, 2])).is_grounded


@given(
    st.sampled_from([SE2_GROUP, SE3_GROUP]),
    st.sampled_from(NOISES),
    st.integers(2, 9),
    st.integers(0, 4),
    st.integers(1, 3),
    seeds,
)
def test_the_sum_over_blocks_is_the_log_determinant(group, kind, num_poses, num_extra, num_held, seed):
    """Of I, I_pp and L_r|p, whatever is held; bridges, parallel edges and several held poses among them."""
    graph = random_pose_graph(np.random.default_rng(seed), Noise(group, kind, 100.0, 1.0, 1.0), num_poses, num_extra)
    held = np.arange(min(num_held, num_poses - 1))
    rows, solver = fisher_rows(graph), LogDetSolver(graph.edges, num_poses, held)
    for name in FORMS:
        form = getattr(rows, name)()
        by_blocks = solver._by_blocks(form)
        if by_blocks is not None:
            assert form.multiplicity * by_blocks.value == pytest.approx(solver.log_det(form).value, abs=1e-8)
            assert form.multiplicity * by_blocks.value == pytest.approx(
                float(log_det_exact(graph, name, held=held.tolist())), abs=form.multiplicity * by_blocks.error
            )


def test_rotations_are_no_sum_over_blocks():
    """A motion of all poses together changes the form of I_rr, so that it matters which one is held."""
    rows = fisher_rows(PoseGraph([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [(0, 1), (1, 2)], None, np.eye(3)))
    assert not rows.rotations().gauge_free
    assert all(getattr(rows, name)().gauge_free for name in FORMS)
    held = [LogDetSolver(rows.edges, 3, node).log_det(rows.rotations()).value for node in range(3)]
    assert np.ptp(held) > 0.1


def drive(num_poses, rng):
    """Poses one metre apart along a winding way, and the odometry between them."""
    heading = np.cumsum(rng.normal(0, 0.3, num_poses))
    positions = np.cumsum(np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
    return np.column_stack([positions, heading]), [(i, i + 1) for i in range(num_poses - 1)]


def test_a_tree_of_700_poses_is_known_to_its_last_digits():
    """Beyond the size that QR could serve: J is a sum over edges."""
    rng = np.random.default_rng(0)
    poses, _ = drive(700, rng)
    edges = [(int(rng.integers(max(0, i - 5), i)), i) for i in range(1, 700)]
    information = np.diag([1e6, 1e6, 1.0]) * rng.uniform(0.5, 2, (699, 1, 1))
    found = joint_entropy_estimate(PoseGraph(poses, edges, None, information))
    expected = 699 * 1.5 * math.log(2 * math.pi * math.e) - np.linalg.slogdet(information)[1].sum() / 2
    assert found.value == pytest.approx(expected, abs=found.error)
    assert found.error < 1e-8


def test_a_long_tail_costs_a_small_core_nothing():
    """30 poses with closures, then 1000 more without: as well known as the 30 alone."""
    rng = np.random.default_rng(1)
    poses, edges = drive(1030, rng)
    closures = [tuple(rng.choice(30, 2, replace=False).tolist()) for _ in range(10)]
    information = np.diag([1e6, 1e6, 1.0])
    whole = joint_entropy_estimate(PoseGraph(poses, edges + closures, None, information))
    core = joint_entropy_estimate(PoseGraph(poses[:30], edges[:29] + closures, None, information))
    tail = 1000 * (1.5 * math.log(2 * math.pi * math.e) - np.linalg.slogdet(information)[1] / 2)
    assert whole.value == pytest.approx(core.value + tail, abs=whole.error + core.error)
    assert whole.error < 1.1 * core.error + 1e-8


def test_weights_over_many_decades_do_not_matter_to_a_tree():
    rng = np.random.default_rng(2)
    edges = np.array([(int(rng.integers(i)), i) for i in range(1, 2000)])
    weights = 10.0 ** rng.uniform(-15, 15, len(edges))
    found = LogDetSolver(edges, 2000, 0).log_det(laplacian_form(edges, weights))
    assert found.value == pytest.approx(np.log(weights).sum(), abs=found.error)
    assert found.error < 1e-9


@given(connected_topologies(min_nodes=2))
def test_trees_hung_on_a_graph_multiply_its_number_of_spanning_trees_by_one(topology):
    n = topology.num_nodes
    tail = [(i, i + 1) for i in range(n - 1, n + 30)]
    longer = type(topology)(n + 31, topology.edges.tolist() + tail)
    assert log_num_spanning_trees(longer) == pytest.approx(log_num_spanning_trees(topology), abs=1e-9)
