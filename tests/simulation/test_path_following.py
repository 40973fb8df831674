"""Following a path: to the goal, tightly around corners, through doors without a touch, or saying why not."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

import topobelief as tb
from data_files import map_file
from topobelief.arrays import FloatArray
from topobelief.errors import InvalidInputError
from topobelief.geometry import SE2_GROUP
from topobelief.simulation.path_following import FollowerSettings, PathFollower

PERIOD = 0.1
ESTIMATE_NOISE = np.array([0.02, 0.02, 0.01])
OFFICE_BOUNDS = (7.0, -9.0, 29.0, 9.5)
OFFICE_GOALS = ((26.0, 8.0), (25.0, -2.95))


def drive_ideally(follower: PathFollower, start: FloatArray, *, seconds: float = 200.0) -> FloatArray:
    """Poses of a robot that does exactly as it is told, until it arrives, is stuck or runs out of time; shape (n, 3)."""
    poses = [start]
    for k in range(round(seconds / PERIOD)):
        speed, turn_rate = follower.command(poses[-1], k * PERIOD)
        if follower.arrived or follower.stuck:
            break
        poses.append(SE2_GROUP.compose(poses[-1], SE2_GROUP.exp(PERIOD * np.array([speed, 0.0, turn_rate]))))
    return np.array(poses)


def off_path(path: FloatArray, poses: FloatArray) -> float:
    line = shapely.LineString(path)
    return max(line.distance(shapely.Point(pose[:2])) for pose in poses)


PATHS = {
    "straight": [(0, 0), (6, 0)],
    "corner": [(0, 0), (3, 0), (3, 3)],
    "zigzag": [(0, 0), (2, 0), (2.5, 1.5), (3, 0), (5, 0.2)],
    "back and forth": [(0, 0), (3, 0), (0.5, 0), (3, 0.1)],
    "closed": [(0, 0), (3, 0), (3, 3), (0, 3), (0, 0)],
    "crossing itself": [(0, 0), (4, 0), (4, 2), (2, 2), (2, -2)],
    "doubled corners": [(0, 0), (0, 0), (2, 0), (2, 0), (2, 2), (2, 2)],
}


@pytest.mark.parametrize("name", PATHS)
@pytest.mark.parametrize("heading", [0.0, 2.0, math.pi])
def test_the_whole_path_is_driven_and_the_goal_reached(name: str, heading: float) -> None:
    path = np.array(PATHS[name], dtype=np.float64)
    follower = PathFollower(path)
    poses = drive_ideally(follower, np.array([0.0, 0.0, heading]))
    assert follower.arrived
    assert follower.stuck is None
    assert math.dist(poses[-1][:2], path[-1]) <= 0.2
    assert off_path(path, poses) < 0.06
    driven, length = (np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1).sum() for line in (poses, path))
    assert length - 0.6 < driven < length + 0.1  # corners are cut, and the last 0.15 m not driven


def test_straights_are_driven_at_full_speed() -> None:
    follower = PathFollower([(0, 0), (10, 0)])
    assert len(drive_ideally(follower, np.zeros(3))) * PERIOD < 10 / 0.7 + 1


def test_a_goal_at_the_start_is_reached_at_once() -> None:
    follower = PathFollower([(1.0, 1.0)])
    assert follower.command(np.array([1.1, 1.0, 2.0]), 0.0) == (0.0, 0.0)
    assert follower.arrived


def test_the_robot_joins_a_path_that_begins_elsewhere() -> None:
    follower = PathFollower([(0, 0), (5, 0)])
    poses = drive_ideally(follower, np.array([1.0, 0.5, 0.0]))
    assert follower.arrived
    assert abs(poses[len(poses) // 2][1]) < 0.05


def test_an_estimate_that_a_closure_corrects_on_the_way_does_no_harm() -> None:
    """The robot learns half way that it stands 0.8 m further back and 0.4 m aside."""
    path = np.array([(0.0, 0.0), (5.0, 0.0), (5.0, 4.0)])
    follower, pose, off = PathFollower(path), np.zeros(3), np.array([0.8, 0.4, 0.1])
    for k in range(400):
        estimate = SE2_GROUP.compose(pose, off) if k < 60 else pose
        speed, turn_rate = follower.command(estimate, k * PERIOD)
        pose = SE2_GROUP.compose(pose, SE2_GROUP.exp(PERIOD * np.array([speed, 0.0, turn_rate])))
    assert follower.arrived
    assert math.dist(pose[:2], path[-1]) <= 0.2


def test_a_robot_that_does_not_get_on_says_so_and_where() -> None:
    follower, pose = PathFollower([(0, 0), (8, 0)]), np.array([3.0, 0.1, 0.0])
    for k in range(99):
        follower.command(pose, k * PERIOD)
    assert follower.stuck is None
    for k in range(99, 110):
        command = follower.command(pose, k * PERIOD)
    assert command == (0.0, 0.0)
    assert not follower.arrived
    assert follower.stuck == "no progress for 10 s at (3.00, 0.10), 5.0 m of path before the goal and 0.10 m off the path"


def test_an_estimate_that_leaps_ahead_is_followed_at_once() -> None:
    follower = PathFollower(np.array(PATHS["crossing itself"]))
    follower.command(np.zeros(3), 0.0)
    follower.command(np.array([4.0, 1.5, np.pi / 2]), 0.1)
    assert follower.length_to_go == pytest.approx(6.5, abs=0.03)


def test_estimates_that_jump_to_and_fro_are_no_progress() -> None:
    follower = PathFollower([(0, 0), (8, 0)])
    for k in range(200):
        follower.command(np.array([3.0 if k % 2 else 3.5, 0.0, 0.0]), k * PERIOD)
    assert follower.stuck is not None


def test_what_is_left_of_the_path() -> None:
    follower = PathFollower([(0, 0), (4, 0), (4, 3)])
    for k in range(4):
        follower.command(np.array([k + 0.01, 0.05, 0.0]), float(k))
    np.testing.assert_allclose(follower.remaining, [(3, 0), (4, 0), (4, 3)], atol=0.011)
    assert follower.length_to_go == pytest.approx(4.0, abs=0.011)
    assert follower.goal.tolist() == [4.0, 3.0]


@pytest.mark.parametrize("waypoints", [np.zeros((0, 2)), np.zeros((2, 3)), [(0, math.nan)]])
def test_what_is_no_path_is_refused(waypoints: FloatArray) -> None:
    with pytest.raises(InvalidInputError, match="finite waypoints of shape"):
        PathFollower(waypoints)


def test_a_pose_that_is_not_finite_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="finite pose estimate"):
        PathFollower([(0, 0), (1, 0)]).command(np.array([0.0, math.inf, 0.0]), 0.0)


def test_settings_that_lead_nowhere_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="path follower's speed above 0, got 0"):
        FollowerSettings(speed=0.0)


def test_a_path_through_a_wall_that_nobody_knew_of_ends_with_a_reason() -> None:
    pytest.importorskip("mujoco")
    from topobelief.simulation.robot import Robot

    world = tb.World.from_boxes([(3, 0, 3.2, 4)], bounds=(0, 0, 6, 4))
    robot, follower = Robot(world, np.array([1.0, 2.0, 0.0]), rng=np.random.default_rng(0)), PathFollower([(1, 2), (5, 2)])
    while not (follower.arrived or follower.stuck):
        robot.step(*follower.command(robot.true_pose, robot.time))
    assert follower.stuck is not None
    assert follower.stuck.startswith("no progress for 10 s at (2.75, ")
    assert robot.contacts > 0


def drive_in_physics(world: tb.World, goals: list[FloatArray], start: FloatArray, *, num_paths: int, seed: int) -> float:
    """Drive to the goals by a random one of the diverse paths; the least clearance met, metres."""
    pytest.importorskip("mujoco")
    from topobelief.simulation.robot import Robot

    rng = np.random.default_rng(seed)
    robot = Robot(world, start, rng=rng)
    places = [robot.true_pose]
    for goal in goals:
        roadmap = tb.build_roadmap(world, robot.true_pose, goal, num_vertices=500, seed=seed)
        paths = tb.diverse_paths(roadmap, robot.true_pose, goal, num_paths=num_paths, seed=seed)
        follower = PathFollower(paths[rng.integers(len(paths))])
        while not (follower.arrived or follower.stuck):
            estimate = robot.true_pose + ESTIMATE_NOISE * rng.standard_normal(3)
            robot.step(*follower.command(estimate, robot.time))
            places.append(robot.true_pose)
        assert follower.stuck is None
        assert math.dist(robot.true_pose[:2], goal) <= 0.25  # 0.2 m by the estimate
    assert robot.contacts == 0
    return float(world.clearance(np.array(places)[:, :2]).min())


@pytest.mark.parametrize("seed", range(10))
def test_the_office_is_driven_without_a_touch(seed: int) -> None:
    world = tb.read_walls(map_file("willow_walls.csv"), bounds=OFFICE_BOUNDS)
    start = np.array([20.0, 0.0, 2.0 * np.pi * seed / 10])
    clearance = drive_in_physics(world, [np.array(goal) for goal in OFFICE_GOALS], start, num_paths=6, seed=seed)
    assert clearance > 0.3  # planned at 0.35 m


@pytest.mark.parametrize("seed", range(3))
def test_doors_of_74_cm_at_right_angles_are_passed_without_a_touch(seed: int) -> None:
    """Two rooms off a corridor of 0.9 m, as tight as a plan at 0.35 m allows."""
    walls = [(0, 2, 2.63, 2.1), (3.37, 2, 8, 2.1), (0, 3, 5.63, 3.1), (6.37, 3, 8, 3.1)]
    world = tb.World.from_boxes(walls, bounds=(0, 0, 8, 5))
    goals = [np.array([6.0, 4.2]), np.array([1.0, 1.0])]
    clearance = drive_in_physics(world, goals, np.array([1.0, 1.0, 1.0]), num_paths=1, seed=seed)
    assert clearance > 0.28
