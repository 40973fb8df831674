"""The bound by windows: no walk is better; each of its terms bounds what a pose adds."""

import math
from dataclasses import replace

import numpy as np
import pytest

import topobelief as tb
from roadmap_walks import Case, random_case
from topobelief.search.both_bounds import BothBounds
from topobelief.search.walk_bounds import walk_bounds

WITH_WALKS = (4, 8, 17, 62, 85, 96, 106, 111)  # of cases with 15 to 70 walks


def _one_closure_a_pose(seed: int) -> Case:
    case = random_case(seed)
    return replace(case, rule=replace(case.rule, max_per_pose=1))


def _bound(case: Case, objective: str, best: float = math.inf) -> tuple[float, list[tuple[int, ...]]]:
    _, windows = walk_bounds(case.graph, case.roadmap, objective=objective, **case.arguments())
    assert windows is not None
    assert windows.lower_bound == -math.inf
    windows.prune(best)
    found: list[tuple[int, ...]] = []
    while not windows.finished:
        found.extend(tuple(walk.tolist()) for walk in windows.step())
    return windows.lower_bound, found


@pytest.mark.parametrize("objective", ["map", "joint", "per_pose"])
@pytest.mark.parametrize("seed", WITH_WALKS)
def test_no_walk_is_better_than_the_bound(seed, objective):
    """All walks are enumerated: any noise, walls, ends, probabilities, costs."""
    case = _one_closure_a_pose(seed)
    walks = case.walks()
    best = float(case.values(objective, walks).min())
    for known in (math.inf, best):
        bound, found = _bound(case, objective, known)
        assert -math.inf < bound <= best + 1e-9 * max(1, abs(best))
        assert set(found) <= {tuple(walk.tolist()) for walk in walks}


@pytest.mark.parametrize("detour", [2.5, 3.0])
@pytest.mark.parametrize("seed", [1, 4, 9, 23, 31])
def test_no_long_walk_is_better_than_the_bound(seed, detour):
    case = _one_closure_a_pose(seed)
    case = replace(case, max_length=detour * float(case.roadmap.distances_to(0)[1]))
    best = float(case.values("map", case.walks()).min())
    assert _bound(case, "map")[0] <= best + 1e-9 * max(1, abs(best))


def test_it_is_nearly_exact_for_one_pose():
    """A single step towards a single place: the window is all there is."""
    omega = np.diag([100.0, 100.0, 400.0])
    graph = tb.PoseGraph([(x, 0, 0) for x in range(6)], [(i, i + 1) for i in range(5)], None, omega)
    world = tb.World.from_boxes([], bounds=(-9, -9, 9, 9))
    vertices = np.array([(5.0, 0.0), (5.0, 1.0)])
    roadmap = tb.Roadmap(world, 0.1, world.component((5, 0), 0.1), vertices, np.array([(0, 1)]))
    rule = tb.ClosureModel(radius=4.6, max_per_pose=1, min_index_gap=5, probability=1.0)
    case = Case(graph, roadmap, None, 1, 1.0, 1.0, omega, rule, False, 0.0)
    for objective in ("map", "joint"):
        (value,) = case.values(objective, case.walks())
        bound, _ = _bound(case, objective)
        assert value - 0.01 < bound <= value + 1e-9 * abs(value)  # a piece is 2.5 cm long


def test_the_larger_of_both_bounds_counts_and_has_its_name():
    case = _one_closure_a_pose(17)
    flows, windows = walk_bounds(case.graph, case.roadmap, objective="map", **case.arguments())
    both = BothBounds(flows, windows)
    both.prune(float(case.values("map", case.walks()).min()))
    names = set()
    for _ in range(12):
        both.step()
        assert both.lower_bound == max(flows.lower_bound, windows.lower_bound)
        assert both.by in both.covers
        names.add(both.by)
    assert windows.finished
    assert "flows" in names


def test_there_are_none_for_errors_and_for_several_closures_a_pose():
    case = _one_closure_a_pose(17)
    assert walk_bounds(case.graph, case.roadmap, objective="error", **case.arguments())[1] is None
    several = replace(case, rule=replace(case.rule, max_per_pose=2))
    assert walk_bounds(several.graph, several.roadmap, objective="map", **several.arguments())[1] is None
