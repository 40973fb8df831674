"""Wheel odometry: arcs from wheel turns, and what slip and noise do to them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from topobelief.errors import InvalidInputError
from topobelief.simulation.wheel_odometry import Kinematics, WheelEncoders, WheelOdometry

KINEMATICS = Kinematics(wheel_radius=0.1, track_width=0.4)


def test_equal_turns_drive_straight() -> None:
    np.testing.assert_allclose(KINEMATICS.motion(np.array([20.0, 20.0])), [2.0, 0.0, 0.0])


def test_opposite_turns_turn_on_the_spot() -> None:
    np.testing.assert_allclose(KINEMATICS.motion(np.array([-math.pi, math.pi])), [0, 0, math.pi / 2], atol=1e-15)


def test_one_wheel_alone_draws_an_arc_around_the_other() -> None:
    x, y, theta = KINEMATICS.motion(np.array([0.0, 2 * math.pi]))  # a quarter circle about (0, 0.2)
    np.testing.assert_allclose([x, y, theta], [0.2, 0.2, math.pi / 2])


def test_wheel_speeds_are_the_inverse_of_motion() -> None:
    turns = 0.5 * KINEMATICS.wheel_speeds(np.array([0.8, -1.2]))
    expected = [0.8 / 1.2 * math.sin(0.6), -0.8 / 1.2 * (1 - math.cos(0.6)), -0.6]
    np.testing.assert_allclose(KINEMATICS.motion(turns), expected)


def test_odometry_adds_up_and_does_not_depend_on_how_often_it_is_read() -> None:
    once, often = WheelOdometry(KINEMATICS), WheelOdometry(KINEMATICS)
    assert once.pose.tolist() == [0, 0, 0]
    once.update(np.array([3.0, 7.0]))
    for share in np.linspace(0.1, 1.0, 10):
        often.update(share * np.array([3.0, 7.0]))
    np.testing.assert_allclose(once.pose, often.pose, rtol=1e-12)


@pytest.mark.parametrize("angles", [[1.0], [np.nan, 0.0]])
def test_a_reading_that_is_none_is_refused(angles: list[float]) -> None:
    with pytest.raises(InvalidInputError, match="angles of two wheels"):
        WheelOdometry(KINEMATICS).update(np.array(angles))


@pytest.mark.parametrize("readings", [1, 5, 40])
def test_slip_is_a_random_walk_in_the_distance_rolled(readings: int) -> None:
    """After 4 m a wheel is off by twice what it is off after one, however often it was read."""
    rng, distance = np.random.default_rng(0), 4.0
    off: list[float] = []
    for _ in range(400):
        encoders = WheelEncoders(slip=0.01, noise=0.0, wheel_radius=0.1, rng=rng)
        for share in np.linspace(0, 1, readings + 1)[1:]:
            counted = encoders.read(np.array([share, -share]) * distance / 0.1)
        off.extend(0.1 * (counted - np.array([1, -1]) * distance / 0.1))
    assert np.std(off) == pytest.approx(0.02, rel=0.1)
    assert abs(np.mean(off)) < 0.003


def test_encoder_noise_does_not_add_up() -> None:
    encoders = WheelEncoders(slip=0.0, noise=0.01, wheel_radius=0.1, rng=np.random.default_rng(0))
    off = np.array([encoders.read(np.full(2, 0.1 * k)) - 0.1 * k for k in range(2000)])
    assert np.std(off[:1000]) == pytest.approx(0.01, rel=0.1)
    assert np.std(off[1000:]) == pytest.approx(0.01, rel=0.1)


def test_a_robot_at_rest_does_not_slip() -> None:
    encoders = WheelEncoders(slip=0.1, noise=0.0, wheel_radius=0.1, rng=np.random.default_rng(0))
    assert [encoders.read(np.zeros(2)).tolist() for _ in range(3)] == [[0, 0]] * 3
