"""Selected measurements: gains are differences of the exact entropy, greedy is within its guarantee of the best."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest

from graphs import SE2_GROUP, SE3_GROUP
from topobelief.entropy import joint_entropy
from topobelief.errors import DisconnectedGraphError, InvalidActionError, InvalidInputError
from topobelief.graph.action import Action, posterior
from topobelief.graph.pose_graph import PoseGraph
from topobelief.measurement_selection import select_measurements


def walk(group, seed: int) -> tuple[PoseGraph, np.ndarray, np.ndarray]:
    """A random walk of 8 poses with one closure; nine candidates of different noise, two of them alike."""
    rng = np.random.default_rng(seed)
    steps = group.exp(rng.normal(size=(8, group.tangent_dim)) * 0.5)
    poses = [group.identity()]
    for step in steps[1:]:
        poses.append(group.compose(poses[-1], step))
    roots = rng.normal(size=(17, group.tangent_dim, group.tangent_dim)) * 3
    omegas = roots @ roots.transpose(0, 2, 1) + np.eye(group.tangent_dim)
    graph = PoseGraph(np.array(poses), [*((k, k + 1) for k in range(7)), (6, 1)], None, omegas[:8])
    edges = np.array([(0, 7), (0, 7), (5, 2), (3, 7), (1, 4), (2, 0), (6, 3), (4, 7), (1, 7)])
    return graph, edges, omegas[[8, 8, *range(9, 16)]]


def reduction(graph: PoseGraph, edges: np.ndarray, information: np.ndarray, chosen) -> float:
    """By how much the exact entropy falls."""
    which = list(chosen)
    return joint_entropy(graph) - joint_entropy(posterior(graph, Action([], edges[which], information[which])))


@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP])
@pytest.mark.parametrize("seed", [0, 1])
def test_greedy_is_within_its_guarantee_of_the_best_of_all(group, seed: int):
    graph, edges, information = walk(group, seed)
    for k in (1, 2, 3, 4):
        found = select_measurements(graph, (edges, information), k)
        best = max(reduction(graph, edges, information, chosen) for chosen in combinations(range(len(edges)), k))
        assert found.gain == pytest.approx(reduction(graph, edges, information, found.indices), abs=1e-9)
        assert found.gain <= best + 1e-9 <= found.upper_bound + 2e-9
        assert found.guarantee >= 1 - 1 / math.e
        assert found.gain >= found.guarantee * best - 1e-9


@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP])
def test_each_choice_has_the_largest_gain_after_those_before_it(group):
    graph, edges, information = walk(group, 2)
    found = select_measurements(graph, (edges, information), len(edges))
    assert sorted(found.indices.tolist()) == list(range(len(edges)))
    chosen: list[int] = []
    for index, gain in zip(found.indices.tolist(), found.gains.tolist(), strict=True):
        others = [other for other in range(len(edges)) if other not in chosen]
        before = reduction(graph, edges, information, chosen) if chosen else 0.0
        values = {other: reduction(graph, edges, information, [*chosen, other]) - before for other in others}
        assert gain == pytest.approx(values[index], abs=1e-8)
        assert gain >= max(values.values()) - 1e-8
        chosen.append(index)
    assert found.guarantee == pytest.approx(1)


def test_candidates_come_as_an_action_a_pair_or_a_list_of_pairs():
    graph, edges, information = walk(SE2_GROUP, 3)
    ways = (
        Action([], edges, information),
        (edges, information),
        list(zip(edges.tolist(), information, strict=True)),
    )
    chosen = [select_measurements(graph, way, 3).indices.tolist() for way in ways]
    assert chosen[0] == chosen[1] == chosen[2]
    two = [((0, 7), np.eye(3)), ((0, 3), np.eye(3))]
    assert sorted(select_measurements(graph, two, 2).indices.tolist()) == [0, 1]
    assert select_measurements(graph, two[:1], 1).indices.tolist() == [0]
    assert select_measurements(graph, [], 0).gain == 0
    assert repr(select_measurements(graph, two, 2)).startswith("Selection(2 of 2 measurements, ")


def test_what_cannot_be_selected_is_named():
    graph, edges, information = walk(SE2_GROUP, 4)
    with pytest.raises(InvalidInputError, match="expected k from 0 to the number of candidates, 9, got 10"):
        select_measurements(graph, (edges, information), 10)
    with pytest.raises(InvalidActionError, match="edge 1"):
        select_measurements(graph, ([(0, 1), (2, 8)], np.eye(3)), 1)
    with pytest.raises(InvalidActionError, match="expected measurements between poses of the graph, got new poses"):
        select_measurements(graph, Action([[1, 0, 0]], [(7, 8)], np.eye(3)), 1)
    apart = PoseGraph([[0, 0, 0], [1, 0, 0]], [], None, np.eye(3))
    with pytest.raises(DisconnectedGraphError):
        select_measurements(apart, ([(0, 1)], np.eye(3)), 1)
