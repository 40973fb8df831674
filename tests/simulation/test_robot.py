"""The robot: calibrated odometry, walls that stop it, one run for one seed."""

from __future__ import annotations

import math

import numpy as np
import pytest

import topobelief as tb
from topobelief.arrays import FloatArray
from topobelief.errors import InvalidInputError
from topobelief.geometry import SE2_GROUP
from topobelief.simulation.calibration import calibrated_kinematics
from topobelief.simulation.robot import LidarSettings, Robot, RobotSettings

pytest.importorskip("mujoco")

IDEAL = RobotSettings(wheel_slip=0.0, encoder_noise=0.0)
HALL = tb.World.from_boxes([], bounds=(-50, -50, 50, 50))
START = np.array([1.0, 2.0, 0.5])


def robot_in(world: tb.World, *, seed: int = 0, settings: RobotSettings = IDEAL, start: FloatArray = START) -> Robot:
    return Robot(world, start, settings=settings, rng=np.random.default_rng(seed))


def commands(count: int, *, seed: int) -> list[tuple[float, float]]:
    """Straights, arcs and turns on the spot, a second and a half each, the way a robot is driven through rooms."""
    rng = np.random.default_rng(seed)
    legs = [(float(rng.choice([0.0, 0.4, 0.7])), float(rng.choice([0.0, 0.0, -1.5, 0.8]))) for _ in range(count // 15 + 1)]
    return [legs[k // 15] for k in range(count)]


def odometry_error(robot: Robot, start: FloatArray = START) -> FloatArray:
    return SE2_GROUP.between(robot.true_pose, SE2_GROUP.compose(start, robot.wheel_odometry))


@pytest.mark.parametrize("seed", range(3))
def test_without_slip_and_noise_odometry_drifts_little_in_40_m(seed: int) -> None:
    robot, driven, k = robot_in(HALL), 0.0, 0
    plan = commands(2000, seed=seed)
    while driven < 40.0:
        before = robot.true_pose
        robot.step(*plan[k])
        driven += math.dist(before[:2], robot.true_pose[:2])
        k += 1
    error = odometry_error(robot)
    assert np.hypot(*error[:2]) < 0.1
    assert abs(error[2]) < 0.05


def test_calibration_is_needed_and_near_what_was_built() -> None:
    kinematics = calibrated_kinematics(IDEAL)
    assert 0.0005 < abs(kinematics.wheel_radius / IDEAL.wheel_radius - 1) < 0.01
    assert kinematics.track_width == pytest.approx(IDEAL.track_width, rel=0.01)


def test_slip_and_noise_show_in_odometry_and_not_in_the_driving() -> None:
    plan = commands(300, seed=0)
    ideal, real = robot_in(HALL), robot_in(HALL, settings=RobotSettings())
    for speed, turn_rate in plan:
        ideal.step(speed, turn_rate)
        real.step(speed, turn_rate)
    assert real.true_pose.tolist() == ideal.true_pose.tolist()
    assert np.abs(odometry_error(real)).max() > 5 * np.abs(odometry_error(ideal)).max()


def test_the_robot_does_as_commanded() -> None:
    robot = robot_in(HALL)
    for _ in range(20):
        robot.step(0.5, 0.4)
    before = robot.true_pose
    for _ in range(10):
        robot.step(0.5, 0.4)
    np.testing.assert_allclose(SE2_GROUP.log(SE2_GROUP.between(before, robot.true_pose)), [0.5, 0.0, 0.4], atol=0.01)
    assert robot.time == pytest.approx(3.0)


def test_commands_are_cut_to_what_the_robot_can_do() -> None:
    fast, limited = robot_in(HALL), robot_in(HALL)
    for _ in range(30):
        fast.step(5.0, -9.0)
        limited.step(IDEAL.max_speed, -IDEAL.max_turn_rate)
    assert fast.true_pose.tolist() == limited.true_pose.tolist()


def test_motors_ramp_up() -> None:
    robot = robot_in(HALL)
    robot.step(0.7, 0.0)
    assert math.dist(robot.true_pose[:2], START[:2]) < 0.6 * IDEAL.max_acceleration * IDEAL.control_period**2


def test_a_wall_at_the_origin_of_the_map_is_no_matter_elsewhere() -> None:
    robot, free = robot_in(tb.World.from_boxes([(-0.1, -3, 0.1, 0.1)], bounds=(-50, -50, 50, 50))), robot_in(HALL)
    for _ in range(20):
        robot.step(0.5, 0.0)
        free.step(0.5, 0.0)
    np.testing.assert_allclose(robot.true_pose, free.true_pose, atol=1e-6)


def test_a_turn_that_is_ended_overshoots_by_its_ramp_alone() -> None:
    """Speed and turn rate ramp each for itself: speeding up does not draw out a turn."""
    robot = robot_in(HALL)
    for _ in range(20):
        robot.step(0.0, 1.2)
    heading = robot.true_pose[2]
    for _ in range(20):
        robot.step(0.7, 0.0)
    expected = 1.2**2 / (2 * IDEAL.max_turn_acceleration)
    assert robot.true_pose[2] - heading == pytest.approx(expected, abs=0.05)


def test_a_wall_stops_the_robot_and_is_counted() -> None:
    world = tb.World.from_boxes([(2, -5, 2.05, 5)], bounds=(-3, -5, 8, 5))
    robot = robot_in(world, start=np.zeros(3))
    for _ in range(20):
        robot.step(0.7, 0.0)
    assert robot.contacts == 0
    for _ in range(60):
        robot.step(0.7, 0.0)
        assert robot.true_pose[0] < 2 - IDEAL.radius + 0.005
    assert robot.contacts > 100
    for _ in range(30):
        robot.step(-0.3, 0.0)
    assert robot.true_pose[0] < 1.3  # and it comes off again


def test_the_same_seed_is_the_same_run_bit_by_bit_and_scans_change_nothing() -> None:
    runs = [robot_in(HALL, seed=7, settings=RobotSettings()) for _ in range(3)]
    for k, (speed, turn_rate) in enumerate(commands(150, seed=1)):
        for robot in runs:
            robot.step(speed, turn_rate)
        first, second = runs[0].scan(), runs[1].scan()
        assert first.ranges.tobytes() == second.ranges.tobytes(), k
    assert runs[0].true_pose.tobytes() == runs[1].true_pose.tobytes() == runs[2].true_pose.tobytes()
    assert runs[0].wheel_odometry.tobytes() == runs[1].wheel_odometry.tobytes() == runs[2].wheel_odometry.tobytes()


def test_other_seeds_are_other_runs() -> None:
    one, other = (robot_in(HALL, seed=seed, settings=RobotSettings()) for seed in (1, 2))
    one.step(0.5, 0.0)
    other.step(0.5, 0.0)
    assert one.wheel_odometry.tolist() != other.wheel_odometry.tolist()


def test_a_scan_is_new_when_a_revolution_has_passed_and_else_the_last() -> None:
    robot = Robot(HALL, START, lidar=LidarSettings(rate=5.0), rng=np.random.default_rng(0))
    stamps = [robot.scan().time]
    for _ in range(6):
        robot.step(0.1, 0.0)
        stamps.append(robot.scan().time)
    np.testing.assert_allclose(stamps, [0, 0, 0.2, 0.2, 0.4, 0.4, 0.6])


def test_a_scan_is_taken_from_the_true_pose() -> None:
    world = tb.World.from_boxes([], bounds=(0, 0, 6, 4))
    robot = Robot(world, START, lidar=LidarSettings(range_noise=0.0), rng=np.random.default_rng(0))
    for _ in range(20):
        robot.step(0.3, 0.4)
    points = SE2_GROUP.rotation_matrix(robot.true_pose) @ robot.scan().points.T + robot.true_pose[:2, None]
    np.testing.assert_allclose(world.clearance(points.T), 0, atol=1e-9)


def test_placing_moves_the_robot_and_not_its_odometry() -> None:
    robot, fresh = robot_in(HALL, seed=3), robot_in(HALL, start=np.array([-4.0, 7.0, -2.0]))
    for _ in range(30):
        robot.step(0.5, 0.3)
    odometry, time, scan = robot.wheel_odometry, robot.time, robot.scan()
    robot.place(np.array([-4.0, 7.0, -2.0]))
    np.testing.assert_allclose(robot.true_pose, [-4.0, 7.0, -2.0], atol=1e-12)
    assert (robot.wheel_odometry.tolist(), robot.time) == (odometry.tolist(), time)
    assert robot.scan() is not scan
    for _ in range(20):
        robot.step(0.5, -0.3)
        fresh.step(0.5, -0.3)
    np.testing.assert_allclose(robot.true_pose, fresh.true_pose, atol=1e-4)  # at rest when put down


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ([0.0, 0.2, 0.0], r"room for the robot's radius of 0.25 m, got \(0, 0.2\) with 0.20 m"),
        ([0.0, -1.0, 0.0], "room for the robot's radius"),
        ([1.0, 1.0], "finite pose"),
        ([1.0, 1.0, np.nan], "finite pose"),
    ],
)
def test_a_place_where_the_robot_cannot_be_is_refused(start: list[float], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        robot_in(tb.World.from_boxes([], bounds=(-5, 0, 5, 5)), start=np.array(start))


def test_a_command_that_is_not_finite_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="finite command, got nan"):
        robot_in(HALL).step(math.nan, 0.0)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"radius": 0.0}, "radius above 0"),
        ({"max_speed": math.inf}, "max_speed above 0"),
        ({"wheel_slip": -1.0}, "wheel_slip of at least 0"),
    ],
)
def test_settings_that_no_robot_has_are_refused(settings: dict[str, float], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        RobotSettings(**settings)


def test_a_control_period_between_physics_steps_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"control_period in whole steps of 0.005 s, got 0.012 s"):
        robot_in(HALL, settings=RobotSettings(control_period=0.012))
