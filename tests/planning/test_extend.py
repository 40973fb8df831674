"""A planner that is extended decides as a new one on the grown graph would, and does not factor what has not changed."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graphs import SE3_GROUP, Noise, random_action, random_pose_graph, sessions
from topobelief.benchmark.sessions import candidate_paths, city_drive
from topobelief.errors import DisconnectedGraphError
from topobelief.graph.action import posterior
from topobelief.graph.information import block_isotropic
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg import block_cholesky, elimination_paths
from topobelief.planning.planner import Planner

OBJECTIVES = ("joint", "map", "per_pose")
FAMILIES = ("fischer", "anchored", "chain")


def assert_same_decisions(extended: Planner, new: Planner, actions, *, tolerance=1e-9) -> None:
    ours, theirs = extended.decide(actions), new.decide(actions)
    np.testing.assert_allclose(ours.signatures, theirs.signatures, rtol=tolerance, atol=tolerance)
    np.testing.assert_allclose(ours.lower, theirs.lower, rtol=tolerance, atol=tolerance)
    np.testing.assert_allclose(ours.upper, theirs.upper, rtol=tolerance, atol=tolerance)
    np.testing.assert_allclose(extended.entropies(actions), new.entropies(actions), rtol=tolerance, atol=tolerance)


def moved(graph: PoseGraph, rng: np.random.Generator) -> PoseGraph:
    poses = graph.poses.copy()
    poses[:, : graph.group.position_dim] += 1e-3 * rng.normal(size=graph.positions.shape)
    return PoseGraph(poses, graph.edges, graph.measurements, graph.information, ids=graph.ids)


@given(sessions(log_ratio=(-2.0, 1.0)), st.sampled_from(OBJECTIVES), st.sampled_from(FAMILIES), st.booleans())
def test_random_graphs_that_grow(session, objective, family, poses_move):
    first = planner = Planner(session.graph, engine="incremental", objective=objective, bounds=family)
    graph, rng = session.graph, np.random.default_rng(0)
    planner.decide(session.actions)
    noise = Noise(graph.group, "full", position_weight=10.0, ratio=1.0, length=1.0, spread=1.0)
    for _ in range(3):
        graph = posterior(graph, random_action(rng, graph, noise))
        graph = moved(graph, rng) if poses_move else graph
        actions = [random_action(rng, graph, noise) for _ in range(3)]
        new = Planner(graph, engine="incremental", objective=objective, bounds=family)
        planner = planner.extended(graph)
        assert_same_decisions(planner, new, actions, tolerance=1e-7)
    new = Planner(session.graph, engine="incremental", objective=objective, bounds=family)
    assert_same_decisions(first, new, session.actions)  # the planner that was extended still works


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("poses_move", [False, True])
@pytest.mark.parametrize("anchor", [None, 17])
def test_a_city_that_grows(family, poses_move, anchor):
    graph, rng = city_drive(800, block_isotropic(0.1, 0.035), rng=np.random.default_rng(3)), np.random.default_rng(4)
    planner = Planner(graph, engine="incremental", bounds=family, anchor=anchor)
    for _ in range(4):
        actions = candidate_paths(graph, 5, num_new_poses=30, num_closures=6, rng=rng)
        assert_same_decisions(planner, Planner(graph, engine="incremental", bounds=family, anchor=anchor), actions)
        graph = posterior(graph, actions[0])
        graph = moved(graph, rng) if poses_move else graph
        planner = planner.extended(graph)
        assert planner.graph is graph


def test_three_dimensions():
    rng = np.random.default_rng(5)
    noise = Noise(SE3_GROUP, "full", position_weight=100.0, ratio=0.5, length=1.0, spread=1.0)
    graph = random_pose_graph(rng, noise, 40, 15)
    planner = Planner(graph, engine="incremental", bounds="anchored")
    for _ in range(3):
        actions = [random_action(rng, graph, noise) for _ in range(4)]
        assert_same_decisions(planner, Planner(graph, engine="incremental", bounds="anchored"), actions)
        graph = posterior(graph, actions[0])
        planner = planner.extended(graph)


def test_graphs_that_are_no_extension_start_anew():
    """Edges dropped or in another order, other noise, fewer poses, another group."""
    graph, rng = city_drive(300, block_isotropic(0.1, 0.035), rng=np.random.default_rng(6)), np.random.default_rng(7)
    drop = np.delete(np.arange(graph.num_edges), [310, 350])
    shuffled = rng.permutation(graph.num_edges)
    noise = Noise(SE3_GROUP, "equal", position_weight=100.0, ratio=0.5, length=1.0)
    others = [
        PoseGraph(graph.poses, graph.edges[drop], None, graph.information[drop]),
        PoseGraph(graph.poses, graph.edges[shuffled], None, graph.information[shuffled]),
        PoseGraph(graph.poses, graph.edges, None, block_isotropic(0.2, 0.01)),
        city_drive(200, block_isotropic(0.1, 0.035), rng=rng),
        random_pose_graph(rng, noise, 320, 100),
    ]
    planner = Planner(graph)
    planner.decide(candidate_paths(graph, 3, num_new_poses=10, num_closures=3, rng=rng))
    for other in others:
        actions = candidate_paths(other, 3, num_new_poses=10, num_closures=3, rng=rng)
        assert_same_decisions(planner.extended(other), Planner(other, engine="incremental"), actions)


def test_a_graph_that_cannot_be_planned_on_leaves_the_planner_as_it_was():
    graph = city_drive(50, block_isotropic(0.1, 0.035), rng=np.random.default_rng(8))
    planner = Planner(graph)
    loose = PoseGraph(np.concatenate([graph.poses, [[0, 0, 0]]]), graph.edges, graph.measurements, graph.information)
    with pytest.raises(DisconnectedGraphError):
        planner.extended(loose)
    actions = candidate_paths(graph, 2, num_new_poses=5, num_closures=2, rng=np.random.default_rng(0))
    assert planner.graph is graph
    assert_same_decisions(planner, Planner(graph), actions)


def test_a_planner_that_is_extended_again_and_again_keeps_one_earlier_graph_only():
    graph, rng = city_drive(60, block_isotropic(0.1, 0.035), rng=np.random.default_rng(8)), np.random.default_rng(0)
    planner, graphs = Planner(graph, engine="incremental"), [weakref.ref(graph)]
    for _ in range(4):
        actions = candidate_paths(graph, 2, num_new_poses=5, num_closures=2, rng=rng)
        planner.decide(actions)
        graph = posterior(graph, actions[0])
        planner = planner.extended(graph)
        graphs.append(weakref.ref(graph))
    gc.collect()
    assert [each() is not None for each in graphs] == [False, False, False, True, True]


@pytest.mark.parametrize(("poses_move", "least"), [(False, 0.75), (True, 0.0)])
def test_columns_that_have_not_changed_are_copied(monkeypatch, poses_move, least):
    shares: list[tuple[int, float]] = []

    def spy(axes, start, rows, done, diagonal, blocks):
        shares.append((len(axes), float(done.mean())))
        return block_cholesky.factorize(axes, start, rows, done, diagonal, blocks)

    graph = city_drive(3000, block_isotropic(0.1, 0.035), rng=np.random.default_rng(9))
    actions = candidate_paths(graph, 3, num_new_poses=20, num_closures=4, rng=np.random.default_rng(1))
    planner = Planner(graph, engine="incremental", bounds="anchored")
    planner.decide(actions)
    grown = posterior(graph, actions[0])
    grown = moved(grown, np.random.default_rng(2)) if poses_move else grown
    monkeypatch.setattr(elimination_paths, "factorize", spy)
    new_actions = candidate_paths(grown, 3, num_new_poses=20, num_closures=4, rng=np.random.default_rng(1))
    planner.extended(grown).decide(new_actions)
    by_size = dict(shares)
    assert by_size[1] > 0.75  # spanning trees do not know where poses are
    assert by_size[3] >= least
    assert (by_size[3] == 0) == poses_move
