"""The search and its peers on a small grid: what each returns is a walk's exact value within the limit, and rows come back."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import topobelief as tb
from topobelief.benchmark.search_comparison import (
    PeerRow,
    PlaceTask,
    SearchComparison,
    compare_peers,
    run_comparison,
    summarised,
)
from topobelief.benchmark.search_peers import PeerQuestion, peers_without_limit, random_restarts
from topobelief.benchmark.search_places import checked_source, search_place
from topobelief.errors import FileError, InvalidInputError
from topobelief.runs.in_process import InProcess

TINY = SearchComparison(objectives=("map",), num_paths=(5,), deadlines=(0.2,), max_detour=1.6)


def question(max_detour=1.6, objective="map"):
    place = search_place("grid-4", 0)
    way = place.roadmap.distances_to(1)[0]
    return PeerQuestion(place, objective, max_detour * way, max_detour, tb.Planner(place.graph, objective=objective))


def all_values(asked):
    """Of all walks on the grid from corner to corner within the limit that pass no place twice."""
    roadmap = asked.place.roadmap
    neighbours = {vertex: [] for vertex in range(len(roadmap.vertices))}
    for a, b in roadmap.edges.tolist():
        neighbours[a].append(b)
        neighbours[b].append(a)
    walks, stack = [], [(0,)]
    while stack:
        walk = stack.pop()
        if walk[-1] == 1:
            walks.append(walk)
        elif len(walk) <= asked.max_length + 1e-9:
            stack += [(*walk, vertex) for vertex in neighbours[walk[-1]] if vertex not in walk]
    walks = [walk for walk in walks if len(walk) - 1 <= asked.max_length + 1e-9]
    return asked.planner.entropies(asked.predict([roadmap.vertices[list(walk)] for walk in walks]))


def test_a_grid_has_been_driven_row_by_row_and_is_to_be_crossed():
    place = search_place("grid-5", 3)
    assert place.graph.num_poses == 25
    np.testing.assert_allclose(np.linalg.norm(np.diff(place.graph.positions, axis=0), axis=1), 1.0)
    assert len(place.roadmap.edges) == 2 * 5 * 4
    assert place.roadmap.distances_to(1)[0] == pytest.approx(8.0)
    np.testing.assert_array_equal(place.roadmap.vertices[0], place.graph.positions[-1])
    again, other = search_place("grid-5", 3), search_place("grid-5", 4)
    np.testing.assert_array_equal(again.graph.information, place.graph.information)
    assert not np.array_equal(other.graph.information, place.graph.information)


def test_a_map_gets_a_drive_and_a_goal_that_can_be_reached(tmp_path):
    (tmp_path / "hall.csv").write_text("# bounds: 0 0 12 8\nx_min,y_min,x_max,y_max\n5,3,7,5\n")
    place = search_place(str(tmp_path / "hall.csv"), 1, num_vertices=60)
    assert place.world.contains(place.graph.positions).all()
    assert place.graph.num_edges >= place.graph.num_poses
    assert math.isfinite(place.roadmap.distances_to(1)[0])
    np.testing.assert_allclose(place.roadmap.vertices[0], place.graph.positions[-1])


def test_a_graph_takes_the_map_beside_it_or_what_lies_along_it(tmp_path):
    x_y = [(x, 1.0) for x in range(1, 10)]
    graph = tb.PoseGraph([(x, y, 0) for x, y in x_y], [(i, i + 1) for i in range(8)], None, np.diag([400.0, 400.0, 1600.0]))
    tb.write_g2o(graph, tmp_path / "drive.g2o")
    alone = search_place(str(tmp_path / "drive.g2o"), 0, num_vertices=40, way=5.0)
    assert alone.roadmap.distances_to(1)[0] == pytest.approx(5.0, rel=0.25)
    (tmp_path / "drive.csv").write_text("# bounds: 0 0 10 8\nx_min,y_min,x_max,y_max\n4,3,6,5\n")
    beside = search_place(str(tmp_path / "drive.g2o"), 0, num_vertices=40, goal=(9.0, 7.0))
    assert beside.roadmap.vertices[1].tolist() == [9.0, 7.0]
    assert tuple(beside.world.bounds) == (0, 0, 10, 8)


@pytest.mark.parametrize(
    ("source", "error", "message"),
    [
        ("grid-2", InvalidInputError, "expected a grid from grid-3 to grid-40, got grid-2"),
        ("nowhere.g2o", FileError, "nowhere.g2o: expected a pose graph, a map, a data set or grid-N, got no such file"),
    ],
)
def test_a_source_that_is_not_there_is_named(source, error, message):
    with pytest.raises(error, match=message):
        checked_source(source)


@pytest.mark.parametrize("objective", ["map", "error"])
def test_each_peer_finds_the_value_of_a_walk_within_the_limit(objective):
    asked = question(objective=objective)
    values = all_values(asked)
    found = {name: peer(asked) for name, peer in peers_without_limit((5,)).items()}
    found["random restarts"] = random_restarts(asked, 0.3, itertools.count(0.0, 0.01).__next__, 0)
    for name, each in found.items():
        assert each.length <= asked.max_length * (1 + 1e-9), name
        assert each.num_evaluations >= 1
        assert each.value >= values.min() - 1e-9 * abs(values.min()) or "diverse" not in name
    shortest = found["shortest way"].value
    assert all(
        each.value <= shortest + 1e-9 * abs(shortest) for name, each in found.items() if "via" in name or "greedy" in name
    )
    assert found["greedy insertion"].value < shortest


def test_rows_hold_all_peers_and_their_medians_the_best_of_each(tmp_path):
    rows = compare_peers(PlaceTask(TINY, "grid-4", 0))
    assert [row.peer for row in rows] == [
        *("shortest way", "best of 5 diverse paths", "through one via-vertex", "through two via-vertices"),
        *("greedy insertion", "recursive greedy", "this search, 0.2 s", "random restarts"),
    ]
    assert all(row.value < row.value_now for row in rows)
    for row in rows:
        assert row.lower_bound == -math.inf or (row.peer.startswith("this search") and row.lower_bound <= row.value)
    summary = list(summarised(rows))
    assert max(each.share for each in summary) == 1.0
    assert all(math.isnan(each.own_gap) for each in summary if "search" not in each.peer)


def row(seed, peer, value, bound=-math.inf):
    return PeerRow("a", seed, "map", peer, 5, 10.0, 0.0, value, 9.0, bound, 3, 0.5)


def test_gaps_are_to_the_best_bound_of_the_same_seed():
    rows = [row(0, "x", -4.0), row(0, "y", -5.0, -6.0), row(1, "x", -8.0), row(1, "y", -8.0, -9.0)]
    x, y = summarised(rows)
    assert (x.gain, x.share, x.gap) == (6.0, 0.9, 1.5)
    assert math.isnan(x.own_gap)
    assert (y.gain, y.share, y.gap, y.own_gap) == (6.5, 1.0, 1.0, 1.0)


def test_a_run_continues_and_refuses_other_settings(tmp_path, monkeypatch):
    monkeypatch.setattr("topobelief.benchmark.search_comparison.compare_peers", lambda task: [row(task.seed, "x", -4.0)])
    first = run_comparison(TINY, ["grid-4"], [0], tmp_path, InProcess())
    done = []
    both = run_comparison(
        TINY, ["grid-4"], [0, 1], tmp_path, InProcess(), on_progress=lambda progress: done.append(progress.done)
    )
    assert done == [1, 2]
    assert both.rows == (*first.rows, row(1, "x", -4.0))
    other = SearchComparison(objectives=("error",), num_paths=(5,), deadlines=(0.2,), max_detour=1.6)
    with pytest.raises(FileError, match="expected a run with the same settings, objectives"):
        run_comparison(other, ["grid-4"], [0], tmp_path, InProcess())
    with pytest.raises(InvalidInputError, match="expected one place for a goal"):
        run_comparison(SearchComparison(goal=(1.0, 1.0)), ["grid-4", "grid-5"], [0], tmp_path / "b", InProcess())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"objectives": ("beauty",)}, "objective"),
        ({"max_detour": 0.5}, "max_detour of at least 1"),
        ({"num_paths": (0,)}, "num_paths of at least 1, got 0"),
        ({"deadlines": (-1.0,)}, "deadlines of at least 0"),
        ({"deadlines": ()}, "at least one deadline"),
        ({"num_vertices": 1}, "num_vertices of at least 2"),
    ],
)
def test_a_comparison_that_cannot_be_is_refused(options, message):
    with pytest.raises(InvalidInputError, match=message):
        SearchComparison(**options)
