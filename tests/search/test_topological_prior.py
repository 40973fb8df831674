"""The search by signatures: values are theirs, and no walk is better than the bound."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import topobelief as tb
from roadmap_walks import Case, plan_of, random_case
from topobelief.errors import InvalidInputError
from topobelief.search.criteria import Criterion
from topobelief.search.information_gain import gain
from topobelief.search.plans import Plan
from topobelief.search.topological_prior import OBJECTIVES, TopologicalPrior, WeightForm, constant
from topobelief.search.walk_bounds import walk_bounds


def by_signature(case: Case, objective: str, walk) -> float:
    """From scratch, cost included."""
    action = case.action(walk)
    after = tb.posterior(case.graph, action)
    if objective == "error":
        value = -tb.resistance_signature(after.topology, after.information, case.graph.num_poses)
    else:
        planner = tb.Planner(case.graph, objective=objective, engine="scratch")
        value = constant(objective, case.graph) - float(planner.decide([action], proof="none").signatures[0])
        if objective == "joint":
            assert value == pytest.approx(-tb.spanning_tree_signature(after.topology, after.information), abs=1e-9)
    return value + case.cost_per_metre * case.length(walk)


def of_several_noises(seed: int) -> Case:
    """A case whose edges differ in the ratio of their weights."""
    case = random_case(seed)
    scale = np.random.default_rng(seed).uniform(0.5, 2.0, (case.graph.num_edges, 3))
    information = scale[:, :, None] * case.graph.information * scale[:, None, :]
    graph = tb.PoseGraph(case.graph.poses, case.graph.edges, None, information)
    return Case(
        graph, case.roadmap, case.world, case.goal, case.max_length, case.spacing, case.information, case.rule,
        case.return_to_start, case.cost_per_metre,
    )  # fmt: skip


@pytest.mark.parametrize("make", [random_case, of_several_noises])
@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("seed", [5, 16, 34])
def test_a_walk_is_worth_its_signature(seed, objective, make):
    """With idle poses too."""
    case = make(seed)
    for walk in case.walks()[:4]:
        action = case.action(walk)
        if action.num_new_poses == 0:
            continue
        seen = np.union1d(action.edges[action.num_new_poses :, 1], [0, 3])
        form = WeightForm.of(objective, case.graph, case.information, case.information)
        prior = TopologicalPrior.of(
            case.graph, case.graph.num_poses - 1, seen, case.information, form,
            probability=case.rule.probability, min_index_gap=case.rule.min_index_gap, with_errors=objective == "error",
        )  # fmt: skip
        metric = plan_of(case.graph, action, seen, num_idle=2 * (objective != "error"))
        weight = form.matrix(case.information)
        plan = Plan(metric.closures, np.broadcast_to(weight, (len(metric.odometry), *weight.shape)), metric.num_poses, 0, 0)
        criterion = Criterion.of(objective, prior, weight, len(plan.closures), 0)
        value = criterion.of_gain(gain(prior, criterion.kind, plan)) + criterion.linear(plan)
        exact = by_signature(case, objective, walk) - case.cost_per_metre * case.length(walk)
        assert value == pytest.approx(exact, rel=1e-9, abs=1e-9)


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 300), objective=st.sampled_from(OBJECTIVES), several=st.booleans())
def test_no_walk_is_better_than_the_bound(seed, objective, several):
    """All walks are enumerated: any noise, closure rule, walls, ends, costs."""
    case = of_several_noises(seed) if several else random_case(seed)
    walks = case.walks(60)
    assume(len(walks) > 1)
    best = min(by_signature(case, objective, walk) for walk in walks)
    bound, _ = walk_bounds(case.graph, case.roadmap, objective=objective, metric=False, **case.arguments())
    for step in range(6):
        bound.step()
        assert bound.lower_bound <= best + 1e-9 * max(1, abs(best))
        if step == 3:
            bound.prune(best)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_the_search_finds_the_best_walk_by_signature(objective):
    """Exactly valued, and bounded; its words say what was minimised."""
    case = random_case(17)
    found = tb.search_roadmap(
        case.graph, case.roadmap, goal=None if case.goal is None else case.roadmap.vertices[case.goal],
        max_length=case.max_length, return_to_start=case.return_to_start, objective=objective, closures=case.rule,
        world=case.world, spacing=case.spacing, information=case.information, cost_per_metre=case.cost_per_metre, metric=False,
    )  # fmt: skip
    after, objective_alone = tb.posterior(case.graph, found.action), found.value - found.action.cost
    if objective == "error":
        signature = tb.resistance_signature(after.topology, after.information, case.graph.num_poses)
        assert objective_alone == pytest.approx(-signature, rel=1e-9)
    elif objective == "joint":
        assert objective_alone == pytest.approx(-tb.spanning_tree_signature(after.topology, after.information), rel=1e-9)
    assert found.lower_bound <= found.value <= found.value_now + 1e-9
    assert found.value <= min(by_signature(case, objective, walk) for walk in case.walks()) + 1e-9
    assert ("by effective resistance" if objective == "error" else "by spanning trees") in found.summary()


def test_one_weight_serves_where_the_ratio_is_the_same():
    graph = random_case(5).graph
    same, other = graph.information[0], np.diag([1.0, 1.0, 9.0])
    assert WeightForm.of("map", graph, 3 * same) == WeightForm(("both",), 3)
    assert WeightForm.of("map", graph, other) == WeightForm(("positions", "positions", "rotations"), 1)
    assert WeightForm.of("error", graph, other) == WeightForm(("positions",), 2)


def test_an_objective_without_a_signature_of_its_own_is_refused():
    case = random_case(17)
    with pytest.raises(InvalidInputError, match="objective of the topological form"):
        tb.search_roadmap(case.graph, case.roadmap, max_length=3.0, objective="per_pose", metric=False)
