"""Landmarks to and from GTSAM: factors of bearing and range, with the Jacobians of GTSAM, and the files of its wheel."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

import topobelief as tb
from topobelief.errors import InvalidInputError, ReadingWarning

gtsam = pytest.importorskip("gtsam")


def information_by_elimination(factors, values, anchor):
    """ln det I of all variables but one pose, by GTSAM's elimination; a unit prior on the pose changes nothing."""
    at = values.atPose2(anchor) if values.exists(anchor) and is_planar(values, anchor) else values.atPose3(anchor)
    prior = gtsam.PriorFactorPose2 if isinstance(at, gtsam.Pose2) else gtsam.PriorFactorPose3
    held = gtsam.NonlinearFactorGraph(factors)
    held.add(prior(anchor, at, gtsam.noiseModel.Unit.Create(3 if isinstance(at, gtsam.Pose2) else 6)))
    net = held.linearize(values).eliminateSequential()
    return sum(2 * np.log(np.abs(np.diag(net.at(n).R()))).sum() for n in range(net.size()))


def is_planar(values, key):
    try:
        values.atPose2(key)
    except RuntimeError:
        return False
    return True


def entropy_by_gtsam(graph):
    """J from GTSAM's linearisation where each measurement is the one that the estimate predicts."""
    fitting = tb.PoseGraph(graph.poses, graph.edges, None, graph.noise, graph.kinds, ids=graph.ids, readings=graph.readings)
    factors, values = tb.to_gtsam(fitting)
    log_det = information_by_elimination(factors, values, int(graph.ids[graph.pose_indices[0]]))
    k, kappa = graph.group.position_dim, graph.tangent_dim
    dimension = kappa * (graph.num_poses - 1) + k * graph.num_landmarks
    return dimension / 2 * math.log(2 * math.pi * math.e) - log_det / 2


@pytest.mark.parametrize(
    "name",
    [
        "cityTrees_reduced_1k.g2o",
        "victoriaPark_reduced_1k.g2o",
        "known_landmark_localization_3.g2o",
        "known_landmark_localization_20.g2o",
        "edge_se3_trackxyz_example.g2o",
        "edge_se3_trackxyz_nonidentity_offset.g2o",
    ],
)
def test_the_entropy_of_every_landmark_file_is_that_of_gtsam_s_elimination(name):
    graph = tb.optimize(tb.read_pose_graph(gtsam.findExampleDataFile(name)))
    expected = entropy_by_gtsam(graph)
    assert tb.joint_entropy(graph) == pytest.approx(expected, rel=1e-9, abs=1e-9)
    bounds = tb.entropy_bounds(graph)
    assert bounds.lower - 1e-6 <= expected <= bounds.upper + 1e-6


def test_victoria_park_is_read_as_gtsam_reads_it_and_its_estimate_is_no_worse():
    """The first 600 poses: chi^2 at the dead reckoning, and at the minimum from there."""
    path = gtsam.findExampleDataFile("victoria_park.txt")
    with pytest.warns(ReadingWarning, match="covariances, as GTSAM does"):
        whole = tb.read_pose_graph(path)
    factors, values = gtsam.load2D(path)
    assert (whole.num_poses, whole.num_landmarks, whole.num_edges) == (6969, 151, factors.size())
    assert whole.chi2 == pytest.approx(2 * factors.error(values), rel=1e-9)
    first = set(whole.pose_indices[:600].tolist())
    observed = whole.edges[np.isin(whole.edges[:, 0], list(first))][:, 1]
    nodes = np.array(sorted(first | {node for node in observed.tolist() if whole.is_landmark[node]}))
    part = whole.part(nodes)
    factors, values = tb.to_gtsam(part)
    held = gtsam.NonlinearFactorGraph(factors)
    start = int(part.ids[0])
    held.add(gtsam.PriorFactorPose2(start, values.atPose2(start), gtsam.noiseModel.Isotropic.Sigma(3, 1e-4)))
    theirs = gtsam.LevenbergMarquardtOptimizer(held, values).optimize()
    ours = tb.optimize(part)
    assert ours.chi2 <= tb.from_gtsam(factors, theirs).chi2 * (1 + 1e-6)
    assert tb.joint_entropy(ours) == pytest.approx(entropy_by_gtsam(ours), rel=1e-9)


def test_the_estimate_of_victoria_park_is_within_its_noise():
    """From the dead reckoning, chi^2 per degree of freedom of which is 16 000, GTSAM's optimiser ends far above 1."""
    with pytest.warns(ReadingWarning):
        whole = tb.read_pose_graph(gtsam.findExampleDataFile("victoria_park.txt"))
    found = tb.optimize(whole)
    assert found.chi2 / found.degrees_of_freedom < 1


def ranging(noise=0.1):
    """A drive around three beacons whose distances it measures, in turn."""
    rng = np.random.default_rng(2)
    factors, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    beacons = {gtsam.symbol("l", n): np.array(place) for n, place in enumerate([(0.0, 4.0), (6.0, 5.0), (3.0, -3.0)])}
    sigmas = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.1, 0.1, 0.05]))
    of_range = gtsam.noiseModel.Isotropic.Sigma(1, noise)
    poses = [gtsam.Pose2(t, math.sin(t / 2), 0.3 * t) for t in np.linspace(0, 6, 25)]
    for n, pose in enumerate(poses):
        values.insert(n, pose.compose(gtsam.Pose2(*(0.1 * rng.normal(size=3)))) if n else pose)
        if n:
            factors.add(gtsam.BetweenFactorPose2(n - 1, n, poses[n - 1].between(pose), sigmas))
        key = gtsam.symbol("l", n % 3)
        factors.add(gtsam.RangeFactor2D(n, key, pose.range(beacons[key]) + noise * rng.normal(), of_range))
    for key, place in beacons.items():
        values.insert(key, place + 0.3 * rng.normal(size=2))
    return factors, values


def test_ranges_alone_are_read_with_their_jacobians_and_optimised():
    factors, values = ranging()
    graph = tb.from_gtsam(factors, values)
    assert (graph.num_poses, graph.num_landmarks) == (25, 3)
    assert set(graph.readings) == {"pose", "range"}
    assert graph.chi2 == pytest.approx(2 * factors.error(values), rel=0.05)  # GTSAM takes the whole logarithm between poses
    held = gtsam.NonlinearFactorGraph(factors)
    held.add(gtsam.PriorFactorPose2(0, values.atPose2(0), gtsam.noiseModel.Isotropic.Sigma(3, 1e-4)))
    theirs = gtsam.LevenbergMarquardtOptimizer(held, values).optimize()
    ours = tb.optimize(graph)
    assert ours.chi2 <= 2 * factors.error(theirs) * (1 + 1e-6)
    assert tb.joint_entropy(ours) == pytest.approx(entropy_by_gtsam(ours), abs=1e-8)
    bounds = tb.entropy_bounds(ours)
    assert bounds.lower < tb.joint_entropy(ours) < bounds.upper
    action = tb.Action(
        ours.poses[ours.last_pose][None] + 0.5, [(ours.last_pose, ours.num_nodes), (ours.num_nodes, 26)], np.eye(3)
    )
    assert tb.Planner(ours).decide([action]).best == 0


@pytest.mark.parametrize("k", [2, 3])
def test_bearings_and_ranges_go_to_gtsam_and_back(k):
    """Any noise, bearing and range correlated too: information and chi^2 are GTSAM's."""
    rng = np.random.default_rng(k)
    poses = rng.normal(size=(2, 3)) if k == 2 else np.column_stack([rng.normal(size=(2, 3)), rng.normal(size=(2, 4))])
    kappa = 3 * (k - 1)
    landmark = np.zeros(poses.shape[1])
    landmark[:k], landmark[-1] = 3.0, 1.0
    root = rng.normal(size=(5, kappa, kappa))
    readings = ["pose", "bearing_range", "range", "bearing", "position"]
    graph = tb.PoseGraph(
        [*poses, landmark],
        [(0, 1), (0, 2), (1, 2), (1, 2), (0, 2)],
        None,
        root @ root.transpose(0, 2, 1) + np.eye(kappa),
        ["pose", "pose", "landmark"],
        readings=readings,
    )
    back = tb.from_gtsam(*tb.to_gtsam(graph))
    assert back.readings.tolist() == ["pose", "bearing_range", "range", "bearing", "bearing_range"]
    np.testing.assert_allclose(back.information, graph.information, rtol=1e-9, atol=1e-9)
    assert tb.joint_entropy(graph) == pytest.approx(entropy_by_gtsam(graph), abs=1e-9)
    moved = graph.with_poses(graph.poses + 0.01)
    factors, _ = tb.to_gtsam(graph)
    observations = gtsam.NonlinearFactorGraph()
    for number in (1, 2, 3):
        observations.add(factors.at(number))
    part = moved.reading_codes > 0
    part[4] = False
    alone = tb.PoseGraph(
        moved.poses, graph.edges[part], graph.measurements[part], graph.noise[part], graph.kinds, readings=graph.readings[part]
    )
    assert alone.chi2 == pytest.approx(2 * observations.error(tb.to_gtsam(moved)[1]), rel=1e-6)


def test_the_bearing_of_what_is_nowhere_is_refused():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        graph = tb.PoseGraph([[0, 0, 0], [0, 0, 0]], [(0, 1)], None, np.eye(3), ["pose", "landmark"])
    with pytest.raises(InvalidInputError, match="expected landmark 1 away from pose 0, because GTSAM takes its position"):
        tb.to_gtsam(graph)
