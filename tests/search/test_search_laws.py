"""Laws of the search over a roadmap, on small random ones all of whose walks are enumerated."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import topobelief as tb
from roadmap_walks import Case, plan_of, random_case
from topobelief.candidates.roadmap import Roadmap
from topobelief.search.information_gain import gain
from topobelief.search.plans import Background, Mixture
from topobelief.search.reduced_prior import ReducedPrior
from topobelief.search.result import SearchResult

OBJECTIVES = ("error", "map", "joint", "per_pose")
MOST_WALKS = 40
STEPS = 4  # of the bound, after which a search is stopped

cases = st.integers(0, 2**32 - 1).map(random_case).filter(lambda case: len(case.walks(MOST_WALKS)) > 1)
objectives = st.sampled_from(OBJECTIVES)
few = settings(max_examples=6)


def search(case: Case, objective: str, *, turn: float | None = 100.0, **changes) -> SearchResult:
    """By local search alone unless `turn` is None: a turn of several rounds puts no pose at a corner."""
    options = {
        "goal": None if case.goal is None else case.roadmap.vertices[case.goal],
        "max_length": case.max_length,
        "return_to_start": case.return_to_start,
        "objective": objective,
        "closures": case.rule,
        "world": case.world,
        "cost_per_metre": case.cost_per_metre,
        "spacing": case.spacing,
        "information": case.information,
        "turn": turn,
    }
    return tb.search_roadmap(case.graph, case.roadmap, **(options | changes))


def same(value: float) -> object:
    return pytest.approx(value, rel=1e-9, abs=1e-9)


@settings(max_examples=12)
@given(cases, objectives)
def test_no_walk_is_better_than_any_bound_on_the_way(case, objective):
    """Any noise, caps, probabilities, angles, walls, costs, goals: closures with the map counted, as the bound says."""
    least = case.values(objective, case.walks()).min()
    bounds: list[float] = []

    def look(progress) -> None:
        if progress.lower_bound > -math.inf:
            bounds.append(progress.lower_bound)
        if len(bounds) == STEPS:
            raise KeyboardInterrupt

    found = search(case, objective, turn=None, on_progress=look)
    assert max([*bounds, found.lower_bound]) <= least + 1e-9 * max(1.0, abs(least))
    assert found.lower_bound > -math.inf


@few
@given(cases, objectives)
def test_the_optimum_is_found_and_is_what_the_planner_says_of_the_action(case, objective):
    paths = [case.roadmap.vertices[walk] for walk in case.walks()]
    rule = {"closures": case.rule, "world": case.world, "spacing": case.spacing, "information": case.information}
    planner = tb.Planner(case.graph, objective=objective, engine="scratch")
    values = planner.entropies(tb.predict_actions(case.graph, paths, turn=None, **rule))
    values = values + case.cost_per_metre * np.array([case.length(walk) for walk in case.walks()])
    found = search(case, objective)
    assert found.value == same(values.min())
    assert planner.entropies([found.action])[0] + found.action.cost == same(found.value)


@few
@given(cases, objectives)
def test_the_front_falls_as_lengths_grow_and_ends_at_the_best_objective(case, objective):
    found = search(case, objective)
    metres, values = found.front.T
    assert (np.diff(metres) > 0).all()
    assert (np.diff(values) < 0).all()
    assert metres[-1] <= found.max_length * (1 + 1e-9)
    assert values[-1] <= found.value - found.action.cost + 1e-9


@few
@given(cases, objectives, st.floats(1.0, 2.0))
def test_a_longer_limit_never_worsens_the_value(case, objective, factor):
    shorter = search(case, objective)
    longer = search(case, objective, max_length=factor * case.max_length, earlier=shorter, max_evaluations=100)
    assert longer.value <= shorter.value + 1e-9


@few
@given(cases, objectives, st.integers(0, 100))
def test_without_a_goal_it_is_at_least_as_good_as_with_any_of_the_same_length(case, objective, vertex):
    case = replace(case, goal=None, return_to_start=False)
    to_vertex = case.roadmap.distances_to(0)
    reachable = np.flatnonzero(to_vertex <= case.max_length)
    goal = case.roadmap.vertices[reachable[vertex % len(reachable)]]
    free, there = search(case, objective), search(case, objective, goal=goal)
    assert free.value <= there.value + 1e-9 * abs(there.value)


@few
@given(cases, objectives, st.randoms(use_true_random=False))
def test_relabelling_the_roadmap_changes_nothing(case, objective, random):
    others = list(range(1, len(case.roadmap.vertices)))
    random.shuffle(others)
    order = np.array([0, *others])
    rank, plain = np.argsort(order), case.roadmap
    edges = np.unique(np.sort(rank[plain.edges], axis=1), axis=0)
    relabelled = Roadmap(plain.world, plain.robot_radius, plain.region, plain.vertices[order], edges)
    goal = None if case.goal is None else int(rank[case.goal])
    again = search(replace(case, roadmap=relabelled, goal=goal), objective)
    assert again.value == same(search(case, objective).value)


@settings(max_examples=20)
@given(cases, st.sampled_from(["map", "joint", "error"]), st.randoms(use_true_random=False))
def test_along_a_segment_between_walks_the_gain_is_concave_and_exact_at_its_ends(case, kind, random):
    walks = case.walks()
    actions = [case.action(walks[random.randrange(len(walks))]) for _ in range(2)]
    most = max(action.num_new_poses for action in actions)
    if min(action.num_new_poses for action in actions) == 0:
        return
    n = case.graph.num_poses
    seen = np.unique(np.concatenate([[0, n - 1], *(action.edges[action.num_new_poses :, 1] for action in actions)]))
    prior = ReducedPrior(
        case.graph, n - 1, seen, case.information, probability=case.rule.probability, min_index_gap=2, with_errors=True
    )
    plans = [plan_of(case.graph, action, seen, num_idle=most - action.num_new_poses) for action in actions]
    nothing = Background(1, np.zeros((most, len(seen))), np.zeros(0, int), np.zeros(0, int), np.zeros((0, 3, 3)))
    weights = np.linspace(0.0, 1.0, 6)
    gains = np.array([gain(prior, kind, Mixture(plans, np.array([1 - w, w]), nothing, 0.0)) for w in weights])
    assert (np.diff(gains, 2) <= 1e-9 * max(1.0, np.abs(gains).max())).all()
    assert gains[[0, -1]] == pytest.approx([gain(prior, kind, plan) for plan in plans], rel=1e-9, abs=1e-12)
