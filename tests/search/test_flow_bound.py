"""The bound by flows: no walk is better."""

import contextlib
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

import topobelief as tb
from roadmap_walks import Case, random_case, with_landmarks
from topobelief.search.bound import OutOfTimeError
from topobelief.search.flows import FlowBound
from topobelief.search.front_bounds import FrontBounds
from topobelief.search.walk_bounds import walk_bounds

OBJECTIVES = ("error", "map", "joint", "per_pose")
WITH_WALKS = (4, 8, 17, 62, 85, 96, 106, 111)  # of cases with 15 to 70 walks


@pytest.fixture(autouse=True)
def _always_cells(monkeypatch):
    """Cells as on long ways, where pieces are coarse; "joint" and "per_pose" have one cell anyway."""
    monkeypatch.setattr("topobelief.search.walk_bounds._FINE", 100)


def _run(case: Case, objective: str, best: float, steps: int) -> tuple[FlowBound, list[tuple[int, ...]]]:
    """Steps without the best value and then with it; no bound on the way may exceed it."""
    bound, _ = walk_bounds(case.graph, case.roadmap, objective=objective, **case.arguments())
    found: list[tuple[int, ...]] = []
    for step in range(2 * steps):
        found.extend(tuple(walk.tolist()) for walk in bound.step())
        assert bound.lower_bound <= best + 1e-9 * max(1, abs(best))
        if step >= steps:
            bound.prune(best)
    return bound, found


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("seed", WITH_WALKS)
def test_no_walk_is_better_than_the_bound(seed, objective):
    """All walks are enumerated: any noise, closure rule, walls, ends, costs."""
    case = random_case(seed)
    walks = case.walks()
    assert len(walks) > 1
    values = case.values(objective, walks)
    _, found = _run(case, objective, float(values.min()), 5)
    assert set(found) <= {tuple(walk.tolist()) for walk in walks}


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("seed", WITH_WALKS)
def test_no_walk_is_better_than_the_bound_where_landmarks_are_seen(seed, objective):
    """Any sensor: range, field of view, limit a pose, probability, with walls and loop closures beside."""
    case = with_landmarks(random_case(seed), seed)
    walks = case.walks()
    values = case.values(objective, walks)
    without = replace(case, observations=tb.ObservationModel(1e-6, 1.0)).values(objective, walks)
    assert (values <= without + 1e-9).all()
    _run(case, objective, float(values.min()), 5)


@pytest.mark.parametrize("objective", ["error", "map"])
def test_landmarks_alone_are_something_to_see(objective):
    """Without any loop closure the flow's bound follows what landmarks bring, and meets the best walk in the end."""
    case = with_landmarks(random_case(17), 3)
    case = replace(case, rule=tb.ClosureModel(radius=1e-6), observations=tb.ObservationModel(4.0, 0.05, probability=1.0))
    values = case.values(objective, case.walks())
    bound, _ = _run(case, objective, float(values.min()), 60)
    now = tb.Planner(case.graph, objective="map").entropies([tb.Action([], [], case.information)])[0]
    assert values.min() < values.max()
    assert bound.lower_bound >= values.min() - 0.3 * np.ptp(values)
    assert objective == "error" or values.min() < now


@pytest.mark.parametrize("objective", ["error", "map", "joint"])
@pytest.mark.parametrize(("seed", "detour"), [(1, 3.0), (4, 2.5), (9, 3.0), (23, 3.0), (31, 2.5)])
def test_no_long_walk_is_better_than_the_bound(seed, detour, objective):
    """Two to three times as long as the shortest one: walks turn back, go round, and pass cells again."""
    case = random_case(seed)
    case = replace(case, max_length=detour * float(case.roadmap.distances_to(0)[1]))
    walks = case.walks()
    assert len(walks) > 20
    _run(case, objective, float(case.values(objective, walks).min()), 4)


def test_several_cells_bound_no_worse_than_one(monkeypatch):
    """Poses of one number in different cells are different poses: a flow through both gains less."""
    case = random_case(17)
    best = float(case.values("map", case.walks()).min())
    with_cells, _ = _run(case, "map", best, 2)
    monkeypatch.setattr("topobelief.search.walk_bounds._MOST_CELLS", 1)
    with_one, _ = _run(case, "map", best, 2)
    assert with_one.lower_bound <= with_cells.lower_bound + 1e-9 <= best + 1e-8


def test_the_bound_meets_the_best_value():
    """Splitting ends with the best walk alone."""
    case = random_case(52)
    walks = case.walks()
    for objective in ("error", "map"):
        values = case.values(objective, walks)
        bound, _ = _run(case, objective, float(values.min()), 60)
        assert bound.lower_bound >= values.min() - 0.05 * np.ptp(values)
        assert bound.share_ruled_out > 0.5


def test_bound_never_falls():
    case = random_case(85)
    bound, _ = walk_bounds(case.graph, case.roadmap, objective="map", **case.arguments())
    assert bound.lower_bound == -math.inf
    before = -math.inf
    for _ in range(6):
        bound.step()
        assert bound.lower_bound >= before
        before = bound.lower_bound
    bound.prune(before - 5.0)
    assert bound.lower_bound == before


def test_an_interrupted_step_forgets_nothing(monkeypatch):
    """After Ctrl-C in the middle of a step the walks that were worked on are still bounded."""
    case = random_case(17)
    bound, _ = walk_bounds(case.graph, case.roadmap, objective="map", **case.arguments())
    for _ in range(3):
        bound.step()
    before = bound.lower_bound

    def interrupted(*_arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("topobelief.search.flows.longest_path", interrupted)
        with pytest.raises(KeyboardInterrupt):
            bound.step()
    bound.prune(float(case.values("map", case.walks()).min()))
    assert bound.lower_bound == before
    assert not bound.finished


def test_driven_in_three_dimensions():
    """A planar graph in SE(3): the bound covers its walks too."""
    case = random_case(85)
    graph = case.graph
    zero = np.zeros(graph.num_poses)
    half = graph.poses[:, 2] / 2
    poses = np.column_stack([graph.positions, zero, zero, zero, np.sin(half), np.cos(half)])
    root = np.random.default_rng(0).normal(size=(6, 6)) + 4 * np.eye(6)
    information = 20 * root @ root.T
    spatial = tb.PoseGraph(poses, graph.edges, None, (information + information.T) / 2)
    case = Case(
        spatial, case.roadmap, case.world, case.goal, case.max_length, case.spacing, spatial.information[0], case.rule,
        case.return_to_start, case.cost_per_metre,
    )  # fmt: skip
    walks = case.walks()
    for objective in OBJECTIVES:
        _run(case, objective, float(case.values(objective, walks).min()), 3)


def test_costs_of_edges():
    """An edge that costs more than anything can gain is on no walk that is found."""
    case = random_case(85)
    walks = case.walks()
    used = {tuple(sorted(pair)) for walk in walks for pair in zip(walk[:-1].tolist(), walk[1:].tolist(), strict=True)}
    avoidable = next(
        edge
        for edge in sorted(used)
        if any(edge not in {tuple(sorted(p)) for p in zip(w[:-1].tolist(), w[1:].tolist(), strict=True)} for w in walks)
    )
    costs = np.where((case.roadmap.edges == avoidable).all(axis=1), 1e4, 0.0)
    bound, _ = walk_bounds(case.graph, case.roadmap, objective="map", edge_costs=costs, **case.arguments())
    last = [bound.step() for _ in range(5)][-1]
    assert last
    assert all(avoidable not in {tuple(sorted(p)) for p in zip(w[:-1].tolist(), w[1:].tolist(), strict=True)} for w in last)


def test_says_what_is_wrong():
    case = random_case(70)
    arguments = case.arguments() | {"goal": 1, "return_to_start": False, "max_length": 0.01}
    with pytest.raises(tb.TopobeliefError, match="that of the shortest path"):
        walk_bounds(case.graph, case.roadmap, objective="map", **arguments)
    with pytest.raises(tb.TopobeliefError, match='expected objective to be one of "error"'):
        walk_bounds(case.graph, case.roadmap, objective="best", **case.arguments())
    with pytest.raises(tb.TopobeliefError, match="expected a cost of at least 0"):
        walk_bounds(case.graph, case.roadmap, objective="map", **case.arguments() | {"cost_per_metre": -1.0})
    with pytest.raises(tb.TopobeliefError, match="expected edge_costs of at least 0 for each of"):
        walk_bounds(case.graph, case.roadmap, objective="map", edge_costs=[1.0], **case.arguments())


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("seed", [*WITH_WALKS, 217])
def test_no_walk_of_any_length_is_below_the_bound_for_it(seed, objective):
    """All walks are enumerated; costs are not counted. The bounds fall as lengths grow, and end at that of the whole."""
    case = random_case(seed)
    walks = case.walks()
    lengths = np.array([case.length(walk) for walk in walks])
    values = case.values(objective, walks) - case.cost_per_metre * lengths
    whole, _ = walk_bounds(case.graph, case.roadmap, objective=objective, **case.arguments())
    front = FrontBounds([whole], float(lengths.min()), case.max_length)
    known = iter((math.inf, *np.sort(values)[::-1].tolist()))

    def best_within(length):
        """Nothing at first, then worse and better walks."""
        within = values[lengths <= length + 1e-9]
        return max(next(known, -math.inf), within.min(initial=math.inf))

    for turn in range(30):
        if turn % 3 == 0:
            whole.step()
        if not front.finished:
            front.step(best_within)
        metres, bounds = front.curve().T
        assert (np.diff(metres) > 0).all()
        assert (np.diff(bounds) < 0).all()
        place = np.searchsorted(metres, lengths)
        below = np.append(bounds, -math.inf)[place]
        assert (below <= values + 1e-9 * np.maximum(1, np.abs(values))).all()
    if not case.cost_per_metre:
        assert bounds[-1] >= whole.lower_bound


@pytest.mark.parametrize("objective", ["error", "map"])
def test_walks_that_are_known_to_be_good_are_where_it_begins(objective):
    """The flow is then as good as the best of them after the first step, and the bound still holds."""
    case = random_case(17)
    walks = case.walks()
    values = case.values(objective, walks)
    order = np.argsort(values)
    bound, _ = walk_bounds(case.graph, case.roadmap, objective=objective, **case.arguments())
    bound.suggest([walks[index] for index in order[:4]])
    found = {tuple(walk.tolist()) for walk in bound.step()}
    assert tuple(walks[order[0]].tolist()) in found
    for _ in range(6):
        bound.prune(float(values.min()))
        bound.step()
        assert bound.lower_bound <= values.min() + 1e-9 * abs(values.min())


@pytest.mark.parametrize("objective", ["error", "map"])
def test_work_that_a_check_ends_may_go_on_later(objective):
    """Wherever a step is broken off, the bound holds, and the next steps get as far as without."""
    case = random_case(17)
    least = float(case.values(objective, case.walks()).min())
    calls = itertools.count(1)
    most = math.inf

    def check():
        if next(calls) > most:
            raise OutOfTimeError

    bound, _ = walk_bounds(case.graph, case.roadmap, objective=objective, check=check, **case.arguments())
    for allowed in [*range(1, 16), math.inf, math.inf, math.inf]:
        calls, most, before = itertools.count(1), allowed, bound.lower_bound
        with contextlib.suppress(OutOfTimeError):
            bound.step()
        assert before <= bound.lower_bound <= least + 1e-9 * abs(least)
        bound.prune(least)
    whole, _ = walk_bounds(case.graph, case.roadmap, objective=objective, **case.arguments())
    for _ in range(3):
        whole.step()
        whole.prune(least)
    assert bound.lower_bound >= whole.lower_bound - 1e-9 * abs(least)
