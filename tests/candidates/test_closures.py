"""The closure model: at most so many a pose, spread over the prior's chain, for many places at once."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from topobelief import ClosureModel, PoseGraph
from topobelief.candidates.closures import closures_among, closures_with_prior
from topobelief.errors import InvalidInputError
from topobelief.geometry import SE2_GROUP
from topobelief.world import World

OMEGA = np.diag([100.0, 100.0, 800.0])


def drive(positions: list[tuple[float, float]], *, without: int | None = None) -> PoseGraph:
    """A chain; one of its edges may be replaced by one from its first pose."""
    poses = np.column_stack([np.array(positions, dtype=float), np.zeros(len(positions))])
    chain = [(i if i != without else 0, i + 1) for i in range(len(poses) - 1)]
    return PoseGraph(poses, chain, None, OMEGA)


def literally(graph: PoseGraph, poses: np.ndarray, model: ClosureModel, steps: np.ndarray, linked: set[int]) -> list:
    """The rule of `closures_with_prior`, place by place."""
    found = []
    for row, pose in enumerate(poses):
        away = np.linalg.norm(graph.positions - pose[:2], axis=1)
        turns = np.abs((graph.poses[:, 2] - pose[2] + np.pi) % (2 * np.pi) - np.pi)
        apart = steps[row] + graph.num_poses - 1 - np.arange(graph.num_poses)
        can = [j for j in np.argsort(away, kind="stable") if away[j] < model.radius and turns[j] <= model.angle]
        left = [int(j) for j in can if apart[j] >= model.min_index_gap]
        taken: list[int] = []
        while left and (model.max_per_pose is None or len(taken) < model.max_per_pose):
            beside = {j + 1 for j in taken if j in linked} | {j - 1 for j in taken if j - 1 in linked}
            choice = next((j for j in left if j not in beside), left[0])
            taken.append(choice)
            left.remove(choice)
        found += [[row, j] for j in sorted(taken)]
    return found


class TestClosuresWithPrior:
    @given(
        st.integers(0, 1000),
        st.sampled_from([1, 2, 3, None]),
        st.sampled_from([0.7, math.pi]),
        st.integers(2, 12),
        st.floats(0.5, 4),
    )
    def test_are_those_of_the_rule_taken_literally(
        self, seed: int, limit: int | None, angle: float, gap: int, radius: float
    ) -> None:
        rng = np.random.default_rng(seed)
        poses = np.column_stack([np.cumsum(rng.normal(size=(30, 2)), axis=0) / 2, rng.uniform(-3, 3, 30)])
        linked = set(rng.choice(29, 20, replace=False).tolist())
        edges = [(i, i + 1) if i in linked else (max(0, i - 2), i + 1) for i in range(29)]
        edges[0] = (0, 1)
        graph = PoseGraph(poses, edges, None, OMEGA)
        places = poses[rng.integers(30, size=12)] + rng.normal(size=(12, 3)) / 2
        model = ClosureModel(radius, angle, gap, limit)
        steps = rng.integers(1, 20, size=12)
        found = closures_with_prior(graph, places, model, steps=steps)
        assert found.tolist() == literally(graph, places, model, steps, linked | {0})

    def test_of_many_places_are_those_of_each(self) -> None:
        """More than are held in memory at once."""
        rng = np.random.default_rng(1)
        graph = drive([tuple(place) for place in np.cumsum(rng.normal(size=(200, 2)), axis=0)])
        places = graph.poses[rng.integers(200, size=5000)] + rng.normal(size=(5000, 3)) / 3
        model = ClosureModel(max_per_pose=2)
        found = closures_with_prior(graph, places, model)
        for row in (0, 2047, 2048, 4999):
            alone = closures_with_prior(graph, places[row : row + 1], model)
            assert found[found[:, 0] == row, 1].tolist() == alone[:, 1].tolist()

    def test_are_not_neighbours_on_the_chain_while_there_are_others(self) -> None:
        """A place amid two legs: the nearest pose of each, though the nearest two are of one."""
        graph = drive([*((x, 0) for x in range(7)), *((6 - x, 3) for x in range(7))])
        place = [(3.4, 1.3, 0)]
        assert closures_with_prior(graph, place, ClosureModel(max_per_pose=2)).tolist() == [[0, 3], [0, 10]]
        near = ClosureModel(radius=1.6, max_per_pose=2)  # the other leg is out of reach
        assert closures_with_prior(graph, place, near).tolist() == [[0, 3], [0, 4]]

    def test_poses_without_odometry_between_them_are_no_neighbours(self) -> None:
        place, model = [(0.4, 0.5, 0)], ClosureModel(radius=1.4, max_per_pose=2)
        legs = [(-9, 0), (0, 0), (1, 0), (0, 1.5)]
        assert closures_with_prior(drive(legs), place, model)[:, 1].tolist() == [1, 3]
        assert closures_with_prior(drive(legs, without=1), place, model)[:, 1].tolist() == [1, 2]

    def test_steps_and_the_start_say_what_is_recent(self) -> None:
        graph, model = drive([(x, 0) for x in range(8)]), ClosureModel(max_per_pose=None, radius=1.5)
        place = [(4, 0.5, 0)]
        assert closures_with_prior(graph, place, model)[:, 1].tolist() == [3, 4, 5]
        assert closures_with_prior(graph, place, model, steps=1)[:, 1].tolist() == [3]
        assert closures_with_prior(graph, place, model, steps=2)[:, 1].tolist() == [3, 4]
        assert closures_with_prior(graph, place, model, steps=1, start=4)[:, 1].tolist() == [5]

    def test_must_be_in_sight(self) -> None:
        graph = drive([(x, 0) for x in range(8)])
        wall = World.from_boxes([(-1, 0.2, 4.2, 0.3)], (-5, -5, 9, 5))
        found = closures_with_prior(graph, [(4, 0.5, 0)], ClosureModel(max_per_pose=None), world=wall)
        assert found[:, 1].tolist() == [5]

    def test_of_no_places_are_none(self) -> None:
        assert closures_with_prior(drive([(0, 0)]), np.zeros((0, 3)), ClosureModel()).shape == (0, 2)


def test_closures_among_new_poses_take_what_is_left() -> None:
    poses = np.column_stack([np.r_[0:6, 5:-1:-1], np.r_[[0] * 6, [1] * 6], np.zeros(12)]).astype(float)
    model = ClosureModel(max_per_pose=1, min_index_gap=4)
    found = closures_among(SE2_GROUP, poses, model)
    assert found.tolist() == [[7, 3], *([later, 11 - later] for later in range(8, 12))]
    assert closures_among(SE2_GROUP, poses, model, left=np.zeros(12, dtype=np.int64)).tolist() == []


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"radius": 0}, "expected radius above 0, got 0"),
        ({"angle": 90}, "90 degrees are 1.571 radians"),
        ({"min_index_gap": 1}, "at least 2"),
        ({"min_index_gap": 2.5}, "at least 2"),
        ({"max_per_pose": 0}, "max_per_pose as a whole number of at least 1, or None for no limit, got 0"),
        ({"max_per_pose": 1.5}, "got 1.5"),
        ({"probability": 0}, "probability above 0 and at most 1, got 0"),
        ({"probability": 1.1}, "got 1.1"),
        ({"probability": math.nan}, "got nan"),
    ],
)
def test_models_out_of_range_are_refused(values: dict, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        ClosureModel(**values)


def test_a_model_says_what_it_is() -> None:
    assert (
        str(ClosureModel(num_observed=0))
        == "closures: at most 1 a pose, 50 % of opportunities, assumed because this graph has none"
    )
    assert str(ClosureModel.by_hand()) == "closures: all poses within 2 m, at least 5 steps apart"
    assert str(ClosureModel.paper()) == "closures: all poses within 2 m and 1 rad, at least 2 steps apart"
    assert str(ClosureModel(max_per_pose=2, probability=0.0314)) == "closures: at most 2 a pose, 3.1 % of opportunities"
