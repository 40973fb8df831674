"""`proof="optimal"` returns an optimum in thousands of random sessions in which every value is known."""

from __future__ import annotations

import numpy as np
import pytest

from engines import judge
from graphs import NOISES, SE2_GROUP, SE3_GROUP, Noise, random_action, random_pose_graph
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.engine import ScratchEngine
from topobelief.planning.planner import Planner

SESSIONS_A_TEST = 250
OBJECTIVES = ("joint", "map", "per_pose")


def random_session(rng: np.random.Generator) -> tuple[PoseGraph, list[Action]]:
    """Up to 14 poses and 8 actions of any noise, xi times the edge length 1e-4 to 1e2; some ties, some without closures."""
    group = (SE2_GROUP, SE3_GROUP)[rng.integers(2)]
    length = float(10 ** rng.uniform(-1, 1))
    noise = Noise(
        group,
        str(rng.choice(NOISES)),
        position_weight=float(10 ** rng.uniform(-1, 3)),
        ratio=float(10 ** rng.uniform(-4, 2)),
        length=length,
        spread=float(rng.uniform(0, 2)),
    )
    graph = random_pose_graph(rng, noise, int(rng.integers(2, 15)), int(rng.integers(0, 8)))
    actions = [random_action(rng, graph, noise) for _ in range(int(rng.integers(2, 9)))]
    if rng.random() < 0.3:  # where the anchored bounds touch
        actions = [without_closures(graph, action) for action in actions]
    if rng.random() < 0.3:
        actions[-1] = actions[0]
    return graph, actions


def without_closures(graph: PoseGraph, action: Action) -> Action:
    """A chain hung on the last pose in place of the action's edges."""
    count = action.num_new_poses
    chain = [(graph.num_poses - 1 + i, graph.num_poses + i) for i in range(count)]
    matrices = np.resize(action.information, (count, *action.information.shape[1:])) if count else graph.information[:1]
    return Action(action.poses, chain, matrices if count else graph.information[0], cost=action.cost)


@pytest.mark.parametrize("seed", range(8))
def test_a_proven_optimum_is_one(seed):
    rng = np.random.default_rng([2026, seed])
    evaluations = possible = 0
    for number in range(SESSIONS_A_TEST):
        graph, actions = random_session(rng)
        objective = OBJECTIVES[number % 3]
        bounds = ("fischer", "anchored", "auto", "chain")[int(rng.integers(4))]
        signature = "spanning_trees" if rng.random() < 0.7 else "von_neumann_approx"
        engine = "incremental" if rng.random() < 0.7 else "scratch"
        planner = Planner(graph, objective=objective, bounds=bounds, signature=signature, engine=engine)
        decision = planner.decide(actions, proof="optimal")
        values, errors = judge(graph, ScratchEngine, objective=objective).entropies(actions)
        totals = values + np.array([action.cost for action in actions])
        assert decision.proven_optimal
        assert totals[decision.best] - errors[decision.best] <= np.min(totals + errors), (seed, number)
        assert (decision.lower <= totals + errors).all(), (seed, number)
        assert (totals - errors <= decision.upper).all(), (seed, number)
        evaluations += decision.num_evaluations
        possible += len(actions)
    assert evaluations < 0.9 * possible  # the proofs are not by exhaustion
