"""What SLAM says about its own position."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief.simulation.front_end import FrontEndSettings, wheel_covariance
from topobelief.simulation.scan import Scan
from topobelief.simulation.slam import Slam


def test_the_position_error_is_two_sigma_of_the_worst_direction() -> None:
    """By the wheels alone: over 2 m straight on, the end swings sideways with the heading of both steps."""
    slam = Slam(np.zeros(3), bounds=(0, 0, 5, 5), noise=None, rng=np.random.default_rng(0))
    nothing = Scan([], [], 0.0, 10.0)
    slam.add_key_pose(np.zeros(3), nothing)
    assert slam.position_error < 0.001
    for x in (1.0, 2.0):
        slam.add_key_pose(np.array([x, 0.0, 0.0]), nothing)
    step = wheel_covariance(np.array([1.0, 0.0, 0.0]), FrontEndSettings())
    lever = np.array([1.0, 1.0])  # y of the end, by y and heading of the first step, whose end is 1 m away
    sideways = lever @ step[1:, 1:] @ lever + step[1, 1]
    assert slam.position_error == pytest.approx(2 * np.sqrt(sideways), rel=1e-3)
