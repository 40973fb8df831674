"""Worlds from a trajectory: free within a width of where the robot has been, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief import PoseGraph
from topobelief.errors import InvalidInputError
from topobelief.world import World
from topobelief.world.trajectory import default_width


def drive(positions: list[tuple[float, float]], closures: list[tuple[int, int]] | None = None) -> PoseGraph:
    poses = np.column_stack([np.array(positions, dtype=float), np.zeros(len(positions))])
    chain = [(i, i + 1) for i in range(len(poses) - 1)]
    return PoseGraph(poses, np.array(chain + (closures or [])).reshape(-1, 2), None, np.eye(3))


def test_clearance_is_the_width_less_the_distance_to_the_trajectory() -> None:
    """On the straight exactly, at the round ends within 0.5 % of the width."""
    world = World.from_trajectory(drive([(0, 0), (4, 0), (10, 0)]), width=1.0)
    np.testing.assert_allclose(world.clearance([(5, 0), (5, 0.4), (5, 1.5)]), [1, 0.6, -0.5], atol=1e-12)
    assert world.clearance([(10.3, 0)])[0] == pytest.approx(0.7, abs=0.005)
    assert world.bounds == pytest.approx((-1, -1, 11, 1), abs=0.005)


def test_every_pose_has_nearly_the_width_of_clearance() -> None:
    rng = np.random.default_rng(1)
    graph = drive([tuple(p) for p in np.cumsum(rng.normal(size=(500, 2)), axis=0)])
    world = World.from_trajectory(graph, width=0.8)
    assert world.clearance(graph.positions).min() > 0.8 * 0.99
    assert len(world.free.geoms) == 1


def test_a_block_that_is_driven_around_is_an_obstacle() -> None:
    world = World.from_trajectory(drive([(0, 0), (10, 0), (10, 10), (0, 10), (0, 0)]), width=1.0)
    assert len(world.component((0, 0), 0.35).interiors) == 1
    assert not world.visible([(0, 5)], [(10, 5)])[0]


def test_closures_open_no_way() -> None:
    graph = drive([(0, 0), (10, 0), (10, 10), (0, 10)], closures=[(3, 0)])
    assert not World.from_trajectory(graph, width=1.0).visible([(0, 0)], [(0, 10)])[0]


def test_a_pose_without_odometry_stands_in_a_disc_of_its_own() -> None:
    graph = PoseGraph([[0, 0, 0], [50, 0, 0], [60, 0, 0]], [(0, 2), (2, 1)], None, np.eye(3))
    world = World.from_trajectory(graph, width=2.0)
    assert world.free.area == pytest.approx(10 * 4 + 2 * np.pi * 4, rel=0.01)
    assert world.clearance([(0, 0)])[0] == pytest.approx(2.0, rel=0.01)


def test_a_jump_between_consecutive_poses_that_no_edge_joins_opens_no_corridor() -> None:
    """Two drives side by side, joined by a closure between their first poses; pose 2 ends the one, pose 3 begins the other."""
    poses = [[0, 0, 0], [5, 0, 0], [10, 0, 0], [0, 20, 0], [5, 20, 0], [10, 20, 0]]
    graph = PoseGraph(poses, [(0, 1), (1, 2), (3, 4), (4, 5), (0, 3)], None, np.eye(3))
    world = World.from_trajectory(graph, width=1.0)
    assert not world.contains([(5, 10), (0, 10)]).any()
    assert world.visible([(0, 0), (0, 20)], [(10, 0), (10, 20)]).all()


def test_a_graph_without_odometry_is_a_disc_at_each_pose() -> None:
    graph = PoseGraph([[0, 0, 0], [10, 0, 0], [20, 0, 0], [30, 0, 0]], [(0, 2), (2, 0), (1, 3), (0, 3)], None, np.eye(3))
    assert len(World.from_trajectory(graph, width=2.0).free.geoms) == 4


def test_the_default_width_is_two_typical_steps_though_most_steps_turn_on_the_spot() -> None:
    positions = [(float(i // 10), 0.0) for i in range(100)]
    assert default_width(drive(positions)) == pytest.approx(2.0)


def test_a_graph_in_space_is_refused() -> None:
    poses = np.zeros((2, 7))
    poses[:, 6], poses[1, 0] = 1, 1
    with pytest.raises(InvalidInputError, match=r"SE\(2\), got SE\(3\).*floor plan"):
        World.from_trajectory(PoseGraph(poses, [(0, 1)], None, np.eye(6)))


@pytest.mark.parametrize("width", [0.0, -1.0, np.nan, np.inf])
def test_a_width_that_is_none_is_refused(width: float) -> None:
    with pytest.raises(InvalidInputError, match="width above 0 m"):
        World.from_trajectory(drive([(0, 0), (1, 0)]), width)


def test_a_graph_that_suggests_no_width_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="give a width"):
        World.from_trajectory(drive([(0, 0), (0, 0)]))
    with pytest.raises(InvalidInputError, match="give a width"):
        World.from_trajectory(PoseGraph([[0, 0, 0]], np.zeros((0, 2), dtype=int), None, np.eye(3)))
