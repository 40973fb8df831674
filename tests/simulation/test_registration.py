"""Scan matching: how close it comes, whether it knows how close, and what it refuses."""

from __future__ import annotations

import importlib
import math

import numpy as np
import pytest

import topobelief as tb
from drives import LOOP, ROOMS, driven
from topobelief.arrays import FloatArray
from topobelief.errors import InvalidInputError
from topobelief.geometry import SE2_GROUP
from topobelief.simulation.lidar import Lidar, LidarSettings
from topobelief.simulation.registration import Registration, RegistrationSettings, ScanCloud, load_small_gicp, register
from topobelief.simulation.scan import Scan
from topobelief.simulation.scenario import named_scenario

SETTINGS = RegistrationSettings()


def matched(world: tb.World, a: FloatArray, b: FloatArray, *, seed: int = 0, guess: FloatArray | None = None) -> Registration:
    rng = np.random.default_rng(seed)
    lidar = Lidar(world, LidarSettings())
    target, source = (ScanCloud(lidar.scan(pose, 0.0, rng=rng)) for pose in (a, b))
    truth = SE2_GROUP.between(a, b)
    guess = SE2_GROUP.compose(truth, np.array([0.1, -0.08, 0.05])) if guess is None else guess
    match = register(target, source, guess, SETTINGS)
    assert match is not None
    return match


def test_scans_a_metre_apart_match_to_a_centimetre_and_a_tenth_of_a_degree() -> None:
    a, b = np.array([2.0, 2.0, 0.3]), np.array([2.4, 3.0, 1.2])
    match = matched(ROOMS, a, b)
    x, y, theta = SE2_GROUP.between(SE2_GROUP.between(a, b), match.pose)
    assert math.hypot(x, y) < 0.01
    assert abs(theta) < math.radians(0.1)
    assert match.wall_share > 0.9
    assert match.rmse < 0.1


def test_the_same_scans_give_the_same_bits() -> None:
    a, b = np.array([2.0, 2.0, 0.3]), np.array([2.4, 3.0, 1.2])
    first, second = matched(ROOMS, a, b), matched(ROOMS, a, b)
    assert first.pose.tobytes() == second.pose.tobytes()
    assert first.information.tobytes() == second.information.tobytes()


@pytest.mark.parametrize(
    ("world", "path", "seed"),
    [
        (ROOMS, LOOP, 100),
        (ROOMS, LOOP[::-1], 101),
        (named_scenario("office").world, [(20, 0), (24, 0), (26, 0.5), (26, 2)], 102),
        (named_scenario("lab").world, [(-0.15, -6.86), (4.3, -7.0)], 103),
    ],
)
def test_information_is_calibrated(world: tb.World, path: FloatArray, seed: int) -> None:
    """Normalised errors squared, e^T Omega e, against chi-square with 3 degrees of freedom (mean 3, 99.9 % below 16.3).

    Point sigma and floor were fitted on 1450 matches along drives through `office` and `lab` with seeds 10 to 13; these drives
    and seeds are others. A little caution is allowed, confidence beyond a half too much is not.
    """
    key_poses = driven(world, path, seed=seed)
    clouds = [ScanCloud(pose.scan) for pose in key_poses]
    squared = []
    for j in range(1, len(key_poses)):
        for i in range(max(0, j - 2), j):
            truth = SE2_GROUP.between(key_poses[i].truth, key_poses[j].truth)
            match = register(clouds[i], clouds[j], SE2_GROUP.compose(truth, np.array([0.03, -0.03, 0.02])), SETTINGS)
            if match is None or match.matched_share < 0.7 or match.wall_share < 0.85:
                continue
            error = SE2_GROUP.log(SE2_GROUP.between(truth, match.pose))
            squared.append(float(error @ match.information @ error))
    assert len(squared) >= 5
    assert 0.5 < np.mean(squared) < 4.5
    assert np.mean(np.array(squared) < 16.3) >= 0.95


def test_a_corridor_without_ends_in_sight_says_nothing_of_the_way_along_it() -> None:
    corridor = tb.World.from_boxes([], bounds=(-50, -1, 50, 1))
    match = matched(corridor, np.array([0.0, 0.0, 0.0]), np.array([1.0, 0.1, 0.0]), guess=np.array([1.0, 0.05, 0.01]))
    along, across = match.information[0, 0], match.information[1, 1]
    assert along < across / 100
    assert abs(match.pose[1] - 0.1) < 0.01


def test_another_room_does_not_lie_on_the_walls() -> None:
    match = matched(ROOMS, np.array([2.0, 2.0, 0.0]), np.array([6.0, 3.0, 0.0]), guess=np.zeros(3))
    assert match.matched_share < 0.8 or match.wall_share < 0.85


def test_too_few_points_are_no_match() -> None:
    blind = ScanCloud(Scan(np.full(360, np.nan), np.linspace(-3, 3, 360), 0.0, 10.0))
    seeing = ScanCloud(Lidar(ROOMS, LidarSettings()).scan(np.array([2.0, 2.0, 0.0]), 0.0, rng=np.random.default_rng(0)))
    assert register(blind, seeing, np.zeros(3), SETTINGS) is None
    assert register(seeing, blind, np.zeros(3), SETTINGS) is None


def test_without_small_gicp_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(InvalidInputError, match=r"topobelief\[sim\]"):
        load_small_gicp()
