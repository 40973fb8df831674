"""Conversion to GTSAM and back: the same factors, with its order of the tangent."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import gtsam
import numpy as np
import pytest
from hypothesis import given

from graphs import SE2_GROUP, SE3_GROUP, pose_graphs
from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.roadmap import build_roadmap
from topobelief.candidates.seen_again import described, seen_again
from topobelief.conversions.gtsam import action_to_gtsam, from_gtsam, to_gtsam
from topobelief.entropy import joint_entropy
from topobelief.errors import InvalidInputError, ReadingWarning
from topobelief.graph.action import Action, posterior
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.g2o import read_g2o, write_g2o
from topobelief.planning.planner import Planner
from topobelief.search.roadmap_search import search_roadmap
from topobelief.symbols import id_of_key, node_name
from topobelief.world import World

UNIT = gtsam.noiseModel.Unit.Create(3)


@given(graph=pose_graphs())
def test_there_and_back_is_the_same_graph(graph: PoseGraph):
    """Ids, poses, edges, measurements and information survive, up to the roundings of GTSAM's noise models."""
    named = PoseGraph(graph.poses, graph.edges, graph.measurements, graph.information, ids=7 + 10 * np.arange(graph.num_poses))
    back = from_gtsam(*to_gtsam(named))
    assert np.array_equal(back.ids, named.ids)
    assert np.array_equal(back.edges, named.edges)
    scale = max(1.0, np.abs(named.positions).max())
    np.testing.assert_allclose(back.poses, named.poses, atol=1e-12 * scale)
    root = np.sqrt(np.diagonal(named.information, axis1=1, axis2=2))
    assert (np.abs(back.information - named.information) <= 1e-9 * root[:, :, None] * root[:, None, :]).all()


@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP])
def test_a_factor_weighs_each_direction_as_the_edge_does(group):
    """GTSAM's error of a factor is half of chi^2, direction by direction, for any information.

    Where the rotation is the measured one, both take the same residual; where the position is, both see a pure rotation.
    """
    rng = np.random.default_rng(3)
    kappa, k = group.tangent_dim, group.position_dim
    root = rng.normal(size=(kappa, kappa))
    information = root.T @ root + np.eye(kappa)
    measured = group.exp(rng.normal(size=kappa))
    for direction in range(kappa):
        tangent = np.zeros(kappa)
        tangent[direction] = 0.3
        poses = np.stack([group.identity(), group.compose(measured, group.exp(tangent))])
        graph = PoseGraph(poses, [(0, 1)], measured[None], information)
        factors, values = to_gtsam(graph)
        assert graph.chi2 == pytest.approx(information[direction, direction] * 0.09, rel=1e-12)
        assert 2 * factors.error(values) == pytest.approx(graph.chi2, rel=1e-9)
    assert k < kappa


def test_one_prior_says_where_and_is_left_out():
    factors, values = to_gtsam(PoseGraph([[0, 0, 0], [1, 0, 0]], [(0, 1)], None, np.diag([1.0, 2.0, 3.0])))
    factors.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(), UNIT))
    assert from_gtsam(factors, values).num_edges == 1
    factors.add(gtsam.PriorFactorPose2(1, gtsam.Pose2(), UNIT))
    with pytest.raises(InvalidInputError, match="at most one prior, got PriorFactorPose2 as factor 2"):
        from_gtsam(factors, values)


def test_symbols_become_ids():
    values = gtsam.Values()
    values.insert(gtsam.symbol("x", 4), gtsam.Pose2(1, 2, 0.5))
    graph = from_gtsam(gtsam.NonlinearFactorGraph(), values)
    assert graph.ids.tolist() == [gtsam.symbol("x", 4)]
    assert graph.poses.tolist() == [[1, 2, 0.5]]


def test_symbols_go_through_a_file(tmp_path: Path):
    """What comes from GTSAM can be written and read again, ids and all."""
    values = _planar_values()
    for key in (gtsam.symbol("x", 0), gtsam.mrsymbol(ord("z"), ord("B"), 2**48 - 1)):
        values.insert(key, gtsam.Pose2(2, 0, 0))
    keys = sorted(values.keys())
    factors = _graph_with(*(gtsam.BetweenFactorPose2(*pair, gtsam.Pose2(1, 0, 0), UNIT) for pair in pairwise(keys)))
    graph = from_gtsam(factors, values)
    write_g2o(graph, tmp_path / "graph.g2o")
    assert read_g2o(tmp_path / "graph.g2o").ids.tolist() == keys
    assert node_name(keys[-1]) == "zB281474976710655"


def test_slots_of_removed_factors_are_skipped():
    factors = _graph_with(*(gtsam.BetweenFactorPose2(0, 1, gtsam.Pose2(x, 0, 0), UNIT) for x in range(3)))
    factors.remove(1)
    assert from_gtsam(factors, _planar_values()).measurements[:, 0].tolist() == [0, 2]


def test_arguments_of_other_types_are_refused():
    factors, values = _graph_with(), _planar_values()
    with pytest.raises(InvalidInputError, match=r"got \(Values, NonlinearFactorGraph\); swap the arguments"):
        from_gtsam(values, factors)
    with pytest.raises(InvalidInputError, match=r"expected \(NonlinearFactorGraph, Values\), got \(NoneType, Values\)$"):
        from_gtsam(None, values)


def test_any_key_becomes_an_id_and_the_key_again():
    """Keys of all 64 bits, in their order: a symbol with a character beyond ASCII, a labelled one, and plain numbers."""
    keys = [0, gtsam.symbol("x", 4), gtsam.mrsymbol(ord("z"), ord("B"), 7), 2**63, (0xE9 << 56) + 3, 2**64 - 2]
    values = gtsam.Values()
    for key in keys:
        values.insert(key, gtsam.Pose2())
    factors = _graph_with(*(gtsam.BetweenFactorPose2(*pair, gtsam.Pose2(1, 0, 0), UNIT) for pair in pairwise(keys)))
    graph = from_gtsam(factors, values)
    assert graph.edges.tolist() == [[index, index + 1] for index in range(5)]
    assert [graph.label(index) for index in (1, 2, 4)] == ["x4", "zB7", "é3"]
    assert [graph.index(key) for key in keys] == list(range(6))
    assert graph.index("é3") == 4
    back, values_again = to_gtsam(graph)
    assert list(values_again.keys()) == keys
    assert [tuple(back.at(index).keys()) for index in range(5)] == list(pairwise(keys))
    with pytest.raises(InvalidInputError, match="expected the id or label of a pose, as 0 or -2, got 'x5'"):
        graph.index("x5")


def test_a_planner_on_objects_of_gtsam_says_what_makes_a_graph_of_them():
    with pytest.raises(
        InvalidInputError, match="expected a PoseGraph, got ISAM2; from_gtsam makes one of factors and values, or"
    ):
        Planner(gtsam.ISAM2())


def test_the_entropy_of_chosen_poses_is_that_of_gtsam_s_joint_marginal():
    """x1 and é2 together, given the first pose, after each of two actions."""
    keys = [gtsam.symbol("x", 0), gtsam.symbol("x", 1), (0xE9 << 56) + 1, (0xE9 << 56) + 2]
    poses = [[0, 0, 0], [1, 0, 0.2], [2, 0.3, 0.5], [2.5, 1, 1.4]]
    omega = np.diag([50.0, 60, 200])
    factors, values = to_gtsam(PoseGraph(poses, list(pairwise(range(4))), None, omega, ids=list(map(id_of_key, keys))))
    graph = from_gtsam(factors, values)
    focus = [graph.index("x1"), graph.index("é2")]
    planner = Planner(graph, objective="focused", focus=focus, anchor=0)
    for action in (Action([[2, 2, 3]], [(3, 4), (4, 1)], omega), Action([], [(3, 0)], omega)):
        new_factors, new_values = action_to_gtsam(graph, action)
        all_factors, all_values = _graph_with(), gtsam.Values(values)
        for part in (factors, new_factors, _graph_with(gtsam.PriorFactorPose2(keys[0], gtsam.Pose2(*poses[0]), UNIT))):
            all_factors.push_back(part)
        all_values.insert(new_values)
        joint = gtsam.Marginals(all_factors, all_values).jointMarginalInformation([keys[0], keys[1], keys[3]])
        given_the_first = joint.fullMatrix()[3:, 3:]
        theirs = 3 * np.log(2 * np.pi * np.e) - np.linalg.slogdet(given_the_first)[1] / 2
        assert planner.entropies([action])[0] == pytest.approx(theirs, abs=1e-8)


def _graph_with(*factors: object) -> gtsam.NonlinearFactorGraph:
    graph = gtsam.NonlinearFactorGraph()
    for factor in factors:
        graph.add(factor)
    return graph


def _planar_values() -> gtsam.Values:
    values = gtsam.Values()
    values.insert(0, gtsam.Pose2())
    values.insert(1, gtsam.Pose2(1, 0, 0))
    return values


HUBER = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Huber.Create(1.0), UNIT)
BAD_FACTORS = {
    "range": (
        gtsam.RangeFactorPose2(0, 1, 1.0, gtsam.noiseModel.Unit.Create(1)),
        "got RangeFactorPose2 as factor 0",
    ),
    "constrained": (
        gtsam.BetweenFactorPose2(0, 1, gtsam.Pose2(), gtsam.noiseModel.Constrained.All(3)),
        "expected Gaussian or robust noise, got Constrained on factor 0",
    ),
    "no value": (gtsam.BetweenFactorPose2(0, 9, gtsam.Pose2(), UNIT), "got none for 9 of factor 0"),
    "mixed": (
        gtsam.BetweenFactorPose3(0, 1, gtsam.Pose3(), gtsam.noiseModel.Unit.Create(6)),
        "got both Pose2 and Pose3",
    ),
}


@pytest.mark.parametrize("case", BAD_FACTORS)
def test_what_is_no_pose_graph_is_refused(case: str):
    factor, message = BAD_FACTORS[case]
    with pytest.raises(InvalidInputError, match=message):
        from_gtsam(_graph_with(factor), _planar_values())


def test_values_that_are_no_poses_are_refused():
    values = gtsam.Values()
    values.insert(3, 1.0)
    with pytest.raises(InvalidInputError, match="expected values of type Pose2, Pose3, Point2 or Point3, got another at 3"):
        from_gtsam(gtsam.NonlinearFactorGraph(), values)
    with pytest.raises(InvalidInputError, match="expected at least one value, got none"):
        from_gtsam(gtsam.NonlinearFactorGraph(), gtsam.Values())


def test_a_robust_factor_is_the_gaussian_of_its_linearisation():
    """At 2 standard deviations Huber's weight is 1/2; the Hessian is that of GTSAM's own linearisation."""
    values = _planar_values()
    noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.5, 1.0, 2.0]))
    robust = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Huber.Create(1.0), noise)
    factor = gtsam.BetweenFactorPose2(0, 1, gtsam.Pose2(2, 0, 0), robust)
    with pytest.warns(ReadingWarning, match="took 1 robust factor for the Gaussian .*, with weights from 0.5 to 0.5$"):
        graph = from_gtsam(_graph_with(factor), values)
    np.testing.assert_allclose(graph.information[0], np.diag([2, 0.5, 0.125]))
    plain = gtsam.BetweenFactorPose2(0, 1, gtsam.Pose2(2, 0, 0), gtsam.noiseModel.Gaussian.Information(graph.information[0]))
    np.testing.assert_allclose(plain.linearize(values).information(), factor.linearize(values).information())


def test_an_outlier_of_no_weight_is_left_out():
    gone = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Tukey.Create(1.0), UNIT)
    factors = _graph_with(
        gtsam.BetweenFactorPose2(0, 1, gtsam.Pose2(1, 0, 0), HUBER), gtsam.BetweenFactorPose2(0, 1, gtsam.Pose2(9, 0, 0), gone)
    )
    with pytest.warns(ReadingWarning, match="with weights from 1 to 1; left out 1 outlier of no weight$"):
        assert from_gtsam(factors, _planar_values()).num_edges == 1


def test_isam2_stands_for_its_factors_and_its_estimate():
    values = _planar_values()
    isam = gtsam.ISAM2()
    prior = gtsam.PriorFactorPose2(0, gtsam.Pose2(), UNIT)
    isam.update(_graph_with(prior, gtsam.BetweenFactorPose2(0, 1, gtsam.Pose2(1.5, 0, 0), UNIT)), values)
    graph = from_gtsam(isam)
    assert graph.edges.tolist() == [[0, 1]]
    np.testing.assert_allclose(graph.poses[1], [1.5, 0, 0], atol=1e-9)
    with pytest.raises(
        InvalidInputError, match=r"expected \(NonlinearFactorGraph, Values\), got \(NonlinearFactorGraph, NoneType\)"
    ):
        from_gtsam(gtsam.NonlinearFactorGraph())


def test_a_decision_goes_back_to_gtsam_and_leaves_the_entropy_that_was_promised():
    """GTSAM's joint information after the update, given the first pose, is that of the posterior."""
    keys = [gtsam.symbol("x", index) for index in range(4)]
    poses = [[0, 0, 0], [1, 0, 0.2], [2, 0.3, 0.5], [2.5, 1, 1.4]]
    graph = PoseGraph(poses, list(pairwise(range(4))), None, np.diag([50.0, 60, 200]), ids=keys)
    actions = [
        Action([[2.4, 2, 2]], [(3, 4)], np.diag([50.0, 60, 200]), label="ahead"),
        Action([[2, 2, 3], [0.5, 1, -2]], [(3, 4), (4, 5), (5, 0), (5, 1)], np.diag([50.0, 60, 200]), label="back"),
    ]
    decision = Planner(graph, objective="map").decide(actions, proof="optimal")
    chosen = actions[decision.best]
    assert chosen.label == "back"
    new_factors, new_values = action_to_gtsam(graph, chosen)
    assert list(map(gtsam.DefaultKeyFormatter, new_values.keys())) == ["x4", "x5"]
    assert new_factors.size() == 4

    isam = gtsam.ISAM2()
    factors, values = to_gtsam(graph)
    factors.add(gtsam.PriorFactorPose2(keys[0], gtsam.Pose2(), UNIT))
    isam.update(factors, values)
    isam.update(new_factors, new_values)
    everything = isam.calculateEstimate()
    marginals = gtsam.Marginals(isam.getFactorsUnsafe(), everything)
    information = marginals.jointMarginalInformation(gtsam.KeyVector(everything.keys())).fullMatrix()[3:, 3:]
    entropy = 15 / 2 * np.log(2 * np.pi * np.e) - np.linalg.slogdet(information)[1] / 2
    assert joint_entropy(posterior(graph, chosen)) == pytest.approx(entropy, abs=1e-8)
    assert from_gtsam(isam).ids.tolist() == posterior(graph, chosen).ids.tolist()


def test_a_search_on_an_isam2_gives_factors_and_values_and_names_symbols():
    """Out of a corridor and back: the way to the goal sees x0 or its neighbours again, and the update takes its factors."""
    isam, factors, values = gtsam.ISAM2(), gtsam.NonlinearFactorGraph(), gtsam.Values()
    poses = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, np.pi / 2), (3, 1, np.pi / 2), (3, 2, np.pi / 2)]
    noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.1, 0.1, 0.05]))
    factors.add(gtsam.PriorFactorPose2(gtsam.symbol("x", 0), gtsam.Pose2(), noise))
    for k, pose in enumerate(poses):
        values.insert(gtsam.symbol("x", k), gtsam.Pose2(*pose))
    for k, (a, b) in enumerate(pairwise([gtsam.Pose2(*pose) for pose in poses])):
        factors.add(gtsam.BetweenFactorPose2(gtsam.symbol("x", k), gtsam.symbol("x", k + 1), a.between(b), noise))
    isam.update(factors, values)
    graph = from_gtsam(isam)
    hall = World.from_boxes([], bounds=(-2, -2, 5, 5))
    roadmap = build_roadmap(hall, (3, 2), (0, 1), num_vertices=60, robot_radius=0.2)
    found = search_roadmap(graph, roadmap, goal=(0, 1), closures=ClosureModel(radius=1.5), world=hall, max_evaluations=30)
    assert re.search(r"sees poses? x[0-4]", described(graph, seen_again(graph, graph.num_poses - 1, found.action)))
    new_factors, new_values = action_to_gtsam(graph, found.action)
    isam.update(new_factors, new_values)
    assert isam.calculateEstimate().size() == graph.num_poses + found.action.num_new_poses
