"""Loop closures: who is asked, and who is believed."""

from __future__ import annotations

import math

import numpy as np

from drives import ROOMS
from topobelief.arrays import FloatArray
from topobelief.geometry import SE2_GROUP
from topobelief.simulation.factor import CLOSURE, ODOMETRY, Factor
from topobelief.simulation.lidar import Lidar, LidarSettings
from topobelief.simulation.loop_closures import OdometryChain, PairwiseConsistency, closure_candidates
from topobelief.simulation.occupancy import OccupancyMap

ODOMETRY_SIGMAS, CLOSURE_SIGMAS = np.array([0.02, 0.02, 0.02]), np.array([0.005, 0.005, 0.002])


def test_candidates_are_near_early_enough_and_in_sight_the_nearest_first() -> None:
    poses = np.zeros((9, 3))
    poses[:, 0] = [0.0, 1.9, 2.0, -1.0, 5.0, 0.1, 0.1, 0.1, 0.0]
    assert closure_candidates(poses, None, search_radius=2.0, min_index_gap=5).tolist() == [0, 3, 1]
    assert closure_candidates(poses, None, search_radius=2.0, min_index_gap=9).tolist() == []
    behind_a_wall = np.array([(3.0, 1.5, 0.0), (4.6, 1.5, 0.0), (3.4, 3.0, 0.0), *[(9.0, 9.0, 0.0)] * 4, (3.3, 1.5, 0.0)])
    lidar, rng = Lidar(ROOMS, LidarSettings()), np.random.default_rng(0)
    scans = [lidar.scan(pose, 0.0, rng=rng) for pose in behind_a_wall]
    occupancy = OccupancyMap.from_scans(behind_a_wall, scans, bounds=ROOMS.bounds)
    assert closure_candidates(behind_a_wall, occupancy, search_radius=2.0, min_index_gap=5).tolist() == [0, 2]
    assert closure_candidates(behind_a_wall, None, search_radius=2.0, min_index_gap=5).tolist() == [0, 1, 2]


def laps(num_laps: int, per_lap: int = 24) -> FloatArray:
    """True poses on a circle, a metre apart."""
    step = np.array([1.0, 0.0, 2 * math.pi / per_lap])
    poses = [np.zeros(3)]
    for _ in range(num_laps * per_lap):
        poses.append(SE2_GROUP.compose(poses[-1], SE2_GROUP.exp(step)))
    return np.array(poses)


def measured(truth: FloatArray, i: int, j: int, sigmas: FloatArray, rng: np.random.Generator) -> Factor:
    noise = SE2_GROUP.exp(sigmas * rng.standard_normal(3))
    kind = ODOMETRY if j == i + 1 else CLOSURE
    return Factor(i, j, SE2_GROUP.compose(SE2_GROUP.between(truth[i], truth[j]), noise), np.diag(sigmas**-2), kind)


def test_the_covariance_of_the_chain_is_that_of_many_draws() -> None:
    truth, rng = laps(1), np.random.default_rng(0)
    errors = []
    chain = OdometryChain()
    for j in range(1, len(truth)):
        chain.append(Factor(j - 1, j, SE2_GROUP.between(truth[j - 1], truth[j]), np.diag(ODOMETRY_SIGMAS**-2), ODOMETRY))
    for _ in range(400):
        pose = np.zeros(3)
        for j in range(1, len(truth)):
            pose = SE2_GROUP.compose(pose, measured(truth, j - 1, j, ODOMETRY_SIGMAS, rng).measurement)
        errors.append(SE2_GROUP.log(SE2_GROUP.compose(pose, SE2_GROUP.inverse(truth[-1]))))
    np.testing.assert_allclose(np.sqrt(np.diag(chain.covariances[-1])), np.std(errors, axis=0), rtol=0.15)


def consistency(**settings: float) -> PairwiseConsistency:
    return PairwiseConsistency(**({"confidence": 0.9999, "min_agreeing": 2, "window": 10} | settings))  # type: ignore[arg-type]


def test_right_closures_are_believed_and_displaced_ones_are_not() -> None:
    """Rooms that look alike: every fourth match is off by the same 0.9 m, which drift over a lap could explain alone."""
    truth, rng = laps(3), np.random.default_rng(1)
    shift = np.array([0.9, 0.0, 0.0])
    rule, believed, false = consistency(), [], set()
    for j in range(1, len(truth)):
        rule.chain.append(measured(truth, j - 1, j, ODOMETRY_SIGMAS, rng))
        closures = [measured(truth, i, j, CLOSURE_SIGMAS, rng) for i in range(j % 24, j - 5, 24)]
        if closures and j % 4 == 2:
            wrong = closures[0]
            closures[0] = Factor(wrong.i, j, SE2_GROUP.compose(shift, wrong.measurement), wrong.information, CLOSURE)
            false.add((wrong.i, j))
        believed += rule.believed(closures)
    pairs = {(factor.i, factor.j) for factor in believed}
    assert len(pairs) == len(believed)
    assert len(false) > 10
    assert not pairs & false
    assert len(pairs) > 0.95 * (sum(len(range(j % 24, j - 5, 24)) for j in range(1, len(truth))) - len(false))


def test_a_first_closure_is_held_back_until_another_agrees_and_then_both_are_believed() -> None:
    truth, rng = laps(2), np.random.default_rng(2)
    rule = consistency()
    for j in range(1, 25):
        rule.chain.append(measured(truth, j - 1, j, ODOMETRY_SIGMAS, rng))
    assert rule.believed([measured(truth, 0, 24, CLOSURE_SIGMAS, rng)]) == []
    rule.chain.append(measured(truth, 24, 25, ODOMETRY_SIGMAS, rng))
    assert {(f.i, f.j) for f in rule.believed([measured(truth, 1, 25, CLOSURE_SIGMAS, rng)])} == {(0, 24), (1, 25)}
    rule.chain.append(measured(truth, 25, 26, ODOMETRY_SIGMAS, rng))
    assert [(f.i, f.j) for f in rule.believed([measured(truth, 2, 26, CLOSURE_SIGMAS, rng)])] == [(2, 26)]


def test_a_closure_that_odometry_contradicts_is_dropped_though_two_agree() -> None:
    truth, rng = laps(2), np.random.default_rng(3)
    rule = consistency()
    far = np.array([8.0, 0.0, 0.0])
    for j in range(1, 27):
        rule.chain.append(measured(truth, j - 1, j, ODOMETRY_SIGMAS, rng))
        if j >= 24:
            right = measured(truth, j - 24, j, CLOSURE_SIGMAS, rng)
            wrong = Factor(j - 24, j, SE2_GROUP.compose(far, right.measurement), right.information, CLOSURE)
            assert rule.believed([wrong]) == []


def test_what_found_no_company_in_the_window_is_forgotten() -> None:
    truth, rng = laps(2), np.random.default_rng(4)
    rule = consistency(window=3)
    for j in range(1, 24 + 6):
        rule.chain.append(measured(truth, j - 1, j, ODOMETRY_SIGMAS, rng))
        if j == 24:
            assert rule.believed([measured(truth, 0, 24, CLOSURE_SIGMAS, rng)]) == []
    assert rule.believed([measured(truth, 5, 29, CLOSURE_SIGMAS, rng)]) == []
