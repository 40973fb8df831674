"""The bound by windows: no walk is better; each of its terms bounds what a pose adds."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import topobelief as tb
from roadmap_walks import Case, random_case
from topobelief.search.both_bounds import BothBounds
from topobelief.search.front_bounds import FrontBounds
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
    """That of coarse layers is there after the first step, and counts as long as none is larger."""
    case = _one_closure_a_pose(17)
    made = []

    def make(pieces):
        made.append(walk_bounds(case.graph, case.roadmap, objective="map", pieces_per_pose=pieces, **case.arguments()))
        return made[-1]

    both = BothBounds(make, lambda arcs: 20)
    assert math.isinf(both.lower_bound)
    least = float(case.values("map", case.walks()).min())
    both.prune(least)
    names = set()
    for step in range(14):
        both.step()
        assert len(made) == min(step + 1, 2)
        flows, windows = made[-1]
        assert both.lower_bound == max(made[0][0].lower_bound, flows.lower_bound, windows.lower_bound)
        assert math.isfinite(both.lower_bound)
        assert both.lower_bound <= least + 1e-9 * abs(least)
        assert both.by in both.covers
        names.add(both.by)
    assert windows.finished
    assert "flows" in names


def test_where_fine_layers_are_not_affordable_the_coarse_ones_are_all():
    case = _one_closure_a_pose(17)
    made = []

    def make(pieces):
        made.append(walk_bounds(case.graph, case.roadmap, objective="map", pieces_per_pose=pieces, **case.arguments()))
        return made[-1]

    both = BothBounds(make, lambda arcs: 3)
    for _ in range(12):
        both.step()
    assert len(made) == 1
    assert made[0][1].finished


def test_there_are_none_for_errors_and_for_several_closures_a_pose():
    case = _one_closure_a_pose(17)
    assert walk_bounds(case.graph, case.roadmap, objective="error", **case.arguments())[1] is None
    several = replace(case, rule=replace(case.rule, max_per_pose=2))
    assert walk_bounds(several.graph, several.roadmap, objective="map", **several.arguments())[1] is None


@settings(max_examples=12)
@given(st.integers(0, 10_000), st.sampled_from(["error", "map", "joint", "per_pose"]))
def test_no_walk_is_below_any_bound(seed, objective):
    """All walks of a random roadmap: not below the bound by windows, nor below that of the front at their length."""
    case = _one_closure_a_pose(seed)
    walks = case.walks(60)
    assume(len(walks) > 1)
    values, lengths = case.values(objective, walks), np.array([case.length(walk) for walk in walks])
    tolerance = 1e-9 * np.maximum(1, np.abs(values))
    flows, windows = walk_bounds(case.graph, case.roadmap, objective=objective, **case.arguments())
    while windows is not None and not windows.finished:
        windows.step()
        assert windows.lower_bound <= values.min() + tolerance.max()
    plain = values - case.cost_per_metre * lengths
    front = FrontBounds([flows], float(lengths.min()), case.max_length)
    flows.step()
    for _ in range(10):
        if not front.finished:
            front.step(lambda length: plain[lengths <= length * (1 + 1e-9)].min(initial=math.inf))
    metres, bounds = front.curve().T
    assert (np.append(bounds, -math.inf)[np.searchsorted(metres, lengths)] <= plain + tolerance).all()


def test_driven_in_three_dimensions():
    """A planar graph in SE(3), of any noise: the bound covers its walks too."""
    case = _one_closure_a_pose(85)
    graph = case.graph
    zero, half = np.zeros(graph.num_poses), graph.poses[:, 2] / 2
    poses = np.column_stack([graph.positions, zero, zero, zero, np.sin(half), np.cos(half)])
    root = np.random.default_rng(0).normal(size=(6, 6)) + 4 * np.eye(6)
    spatial = tb.PoseGraph(poses, graph.edges, None, 10 * (root @ root.T + root @ root.T).T)
    case = replace(case, graph=spatial, information=spatial.information[0])
    for objective in ("map", "joint"):
        best = float(case.values(objective, case.walks()).min())
        assert _bound(case, objective)[0] <= best + 1e-9 * abs(best)
