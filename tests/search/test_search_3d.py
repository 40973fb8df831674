"""The search of a roadmap in space: no walk is better than its bound, and its way is worth what it says."""

import numpy as np
import pytest

import topobelief as tb
from drives_3d import flight, ramp, roadmap_in_space
from roadmap_walks import Case
from topobelief.search.walk_bounds import walk_bounds


def case(seed: int) -> Case:
    graph = flight(seed)
    roadmap = roadmap_in_space(graph, seed)
    rng = np.random.default_rng(seed)
    rule = tb.ClosureModel(
        radius=float(rng.uniform(0.8, 1.6)), angle=float(rng.uniform(1.5, 3.1)), min_index_gap=2, max_per_pose=1 + seed % 2,
        probability=0.7,
    )  # fmt: skip
    world = tb.World3D.from_trajectory(graph, 2.7) if seed % 2 else None
    length = 2.2 * float(roadmap.distances_to(0)[1])
    return Case(graph, roadmap, world, 1, length, 0.7, 50 * np.eye(6), rule, False, 0.001)


@pytest.mark.parametrize("objective", ["error", "map"])
@pytest.mark.parametrize("seed", [1, 3, 4, 10])
def test_no_walk_is_better_than_the_bound(seed, objective):
    given = case(seed)
    walks = given.walks()
    assert len(walks) > 3
    best = float(given.values(objective, walks).min())
    bound, _ = walk_bounds(given.graph, given.roadmap, objective=objective, **given.arguments())
    for _ in range(4):
        bound.step()
        assert bound.lower_bound <= best + 1e-9 * max(1, abs(best))


def test_a_search_on_a_ramp_ends_with_a_way_and_a_bound():
    graph = ramp(rounds=1)
    world = tb.World3D.from_trajectory(graph, 3.0, 1.0)
    roadmap = tb.build_roadmap(world, graph.positions[-1], graph.positions[15], 50, 0.3)
    found = tb.search_roadmap(
        graph, roadmap, goal=graph.positions[15], max_detour=1.1, world=world, spacing=3.0, max_evaluations=20
    )
    assert found.path.shape[1] == 3
    assert found.lower_bound <= found.value <= found.value_now
    exact = tb.Planner(graph, objective="error").entropies([found.action])
    assert exact[0] == pytest.approx(found.value, rel=1e-9)
