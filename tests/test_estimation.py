"""The maximum-likelihood estimate: known answers, laws, and agreement with independent optimisers."""

from __future__ import annotations

import math

import gtsam
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import least_squares

from data_files import RECORDED, data_file
from graphs import SE2_GROUP, SE3_GROUP, pose_graphs
from topobelief.conversions.gtsam import from_gtsam, to_gtsam
from topobelief.errors import DisconnectedGraphError, EstimationError
from topobelief.estimation import _Problem, optimize
from topobelief.geometry import Group
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.formats import read_pose_graph

GROUPS = pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP], ids=["SE(2)", "SE(3)"])


def lost(graph: PoseGraph) -> PoseGraph:
    """The same measurements with every pose but the first forgotten."""
    poses = np.tile(graph.group.identity(), (graph.num_poses, 1))
    poses[0] = graph.poses[0]
    return graph.with_poses(poses)


def noisy_graph(group: Group, seed: int, *, num_poses: int = 12, num_closures: int = 10, angle: float = 0.05) -> PoseGraph:
    """A random walk with closures; noise drawn from full information matrices with rotations of about `angle` radians."""
    rng = np.random.default_rng(seed)
    kappa, k = group.tangent_dim, group.position_dim
    poses = [group.exp(rng.normal(size=kappa))]
    for _ in range(num_poses - 1):
        poses.append(group.compose(poses[-1], group.exp(rng.normal(size=kappa))))
    edges = [(i, i + 1) for i in range(num_poses - 1)]
    edges += [tuple(rng.choice(num_poses, size=2, replace=False).tolist()) for _ in range(num_closures)]
    scale = np.r_[np.full(k, 0.1), np.full(kappa - k, angle)]
    spread = scale[:, None] * (np.eye(kappa) + 0.3 * rng.normal(size=(len(edges), kappa, kappa)))
    noise = (spread @ rng.normal(size=(len(edges), kappa, 1)))[:, :, 0]
    information = np.linalg.inv(spread @ spread.transpose(0, 2, 1))
    i, j = np.array(edges).T
    predicted = group.between(np.array(poses)[i], np.array(poses)[j])
    measured = group.compose(predicted, group.exp(noise))
    return PoseGraph(poses, edges, measured, (information + information.transpose(0, 2, 1)) / 2)


def distances(a: PoseGraph, b: PoseGraph) -> NDArray:
    """Error of each pose of `b` in the frame of the same pose of `a`, shape (n, kappa)."""
    return a.group.residual(a.poses, b.poses)


# Known answers ----------------------------------------------------------------------------------------------------------


@GROUPS
def test_two_measurements_of_one_pose_are_averaged_by_their_information(group: Group):
    """Without rotation error, weights 1 and 3 on lengths 1 and 5 give 4, and chi^2 = 1 (4 - 1)^2 + 3 (5 - 4)^2."""
    poses = np.tile(group.identity(), (2, 1))
    measured = poses.copy()
    measured[:, 0] = [1, 5]
    information = np.array([1.0, 3.0])[:, None, None] * np.eye(group.tangent_dim)
    estimate = optimize(PoseGraph(poses, [(0, 1), (0, 1)], measured, information))
    np.testing.assert_allclose(estimate.positions[1], np.eye(group.position_dim)[0] * 4, atol=1e-9)
    assert estimate.chi2 == pytest.approx(12)
    assert estimate.degrees_of_freedom == group.tangent_dim


def test_the_angle_left_over_in_a_ring_is_spread_evenly():
    """Four corners that each measure 0.02 rad too little turn: with weak positions each edge takes a quarter of 0.08 rad."""
    corner = [1.0, 0.0, math.pi / 2 - 0.02]
    graph = PoseGraph(np.zeros((4, 3)), [(0, 1), (1, 2), (2, 3), (3, 0)], [corner] * 4, np.diag([1e-6, 1e-6, 1.0]))
    estimate = optimize(graph)
    np.testing.assert_allclose(estimate.poses[:, 2], [0, math.pi / 2, -math.pi, -math.pi / 2], atol=1e-5)
    assert estimate.chi2 == pytest.approx(4 * 0.02**2, rel=1e-3)


@pytest.mark.parametrize("edges", [[], [(0, 1)], [(1, 0)], [(0, 1), (0, 2), (3, 1)]], ids=str)
@GROUPS
def test_a_tree_is_fitted_exactly(edges: list, group: Group):
    """One pose, two poses, a tree: as many measurements as unknowns, chi^2 = 0."""
    rng = np.random.default_rng(5)
    n = len(edges) + 1
    poses, measured = (group.exp(rng.normal(size=(count, group.tangent_dim))) for count in (n, len(edges)))
    graph = PoseGraph(poses, edges, measured, np.diag(rng.uniform(1, 100, group.tangent_dim)))
    estimate = optimize(graph)
    assert estimate.chi2 < 1e-24
    assert estimate.degrees_of_freedom == 0
    assert np.array_equal(estimate.poses[0], graph.poses[0])


CHI2_HALVED = {  # filed, optimised
    "intel.g2o": (2.57486e6, 107.9151),
    "csail.g2o": (6.55326e5, 19.47814),
    "csail.toro": (6.55326e5, 19.47814),
    "manhattan3500.g2o": (3.45715e4, 73.03831),
    "city10000.g2o": (3.27081e8, 255.9926),
    "ais2klinik.g2o": (6.48697e5, 86.40779),
    "kitti_05.g2o": (1.83792e6, 78.55218),
    "parking-garage.g2o": (8362.72, 0.6341922),
    "sphere2500.g2o": (1.292612e6, 675.6812),
    "smallGrid3D.g2o": (6.165911e4, 516.9472),
}


@pytest.mark.parametrize("name", CHI2_HALVED)
def test_public_graphs_reach_their_minimum(name: str):
    """The best chi^2 / 2 known of each file, from dead reckoning that is off by orders of magnitude; the first pose stays."""
    graph = read_pose_graph(data_file(name))
    estimate = optimize(graph)
    filed, optimised = CHI2_HALVED[name]
    assert graph.chi2 / 2 == pytest.approx(filed, rel=1e-5)
    assert estimate.chi2 / 2 == pytest.approx(optimised, rel=1e-6)
    assert np.array_equal(estimate.poses[0], graph.poses[0])
    assert estimate.edges is graph.edges or np.array_equal(estimate.edges, graph.edges)
    assert np.array_equal(estimate.ids, graph.ids)


# Laws -------------------------------------------------------------------------------------------------------------------


@given(graph=pose_graphs())
def test_consistent_measurements_give_the_poses_back(graph: PoseGraph):
    """Whatever the noise model, measurements without error lead from nothing but the first pose to all poses."""
    estimate = optimize(lost(graph))
    k = graph.group.position_dim
    error = np.abs(distances(graph, estimate))
    size = 1 + np.abs(graph.positions).max()
    assert error[:, :k].max(initial=0) < 1e-6 * size
    assert error[:, k:].max(initial=0) < 1e-6


@given(group=st.sampled_from([SE2_GROUP, SE3_GROUP]), seed=st.integers(0, 10**6), angle=st.sampled_from([1e-4, 0.01, 0.1]))
def test_no_small_move_lowers_chi2(group: Group, seed: int, angle: float):
    """The estimate is a minimum: its gradient is nothing beside the curvature, in every direction that is tried."""
    estimate = optimize(lost(noisy_graph(group, seed, angle=angle)))
    rng = np.random.default_rng(seed)
    for size in (1e-2, 1e-4):
        move = size * angle * rng.normal(size=(estimate.num_poses, group.tangent_dim))
        moved = estimate.with_poses(group.compose(estimate.poses, group.exp(move)))
        assert moved.chi2 > estimate.chi2


@settings(max_examples=25)
@given(group=st.sampled_from([SE2_GROUP, SE3_GROUP]), seed=st.integers(0, 10**6))
def test_where_the_first_pose_lies_does_not_matter(group: Group, seed: int):
    """Moving the first pose moves the estimate as a rigid body and leaves chi^2 alone."""
    graph = noisy_graph(group, seed)
    shift = group.exp(np.random.default_rng(seed).normal(size=group.tangent_dim))
    moved = graph.with_poses(group.compose(shift, graph.poses))
    here, there = optimize(graph), optimize(moved)
    assert there.chi2 == pytest.approx(here.chi2, rel=1e-9)
    expected = here.with_poses(group.compose(shift, here.poses))
    assert np.abs(distances(expected, there)).max() < 1e-6


@settings(max_examples=25)
@given(group=st.sampled_from([SE2_GROUP, SE3_GROUP]), seed=st.integers(0, 10**6), angle=st.sampled_from([0.05, 0.5]))
@example(group=SE2_GROUP, seed=6, angle=1.2)
def test_chi2_never_rises(group: Group, seed: int, angle: float):
    """However well the given poses fit, the estimate fits no worse, and a second time changes nothing."""
    graph = noisy_graph(group, seed, angle=angle)
    estimate = optimize(graph)
    assert estimate.chi2 <= graph.chi2
    again = optimize(estimate)
    assert again.chi2 <= estimate.chi2
    assert again.chi2 == pytest.approx(estimate.chi2, rel=1e-6)


def test_given_poses_that_fit_better_are_refined():
    """With lengths known to a millimetre and turns to 0.7 rad, measurements alone lead into a worse fold of the map than
    the one that the given poses lie in; the estimate is the minimum of the better fold."""
    better = 0
    for seed in range(10, 16):
        rng = np.random.default_rng(seed)
        walk = noisy_graph(SE2_GROUP, seed, num_poses=20, num_closures=6)
        noise = rng.normal(size=(walk.num_edges, 3)) * [1e-3, 1e-3, 0.7]
        i, j = walk.edges.T
        measured = SE2_GROUP.compose(SE2_GROUP.between(walk.poses[i], walk.poses[j]), SE2_GROUP.exp(noise))
        graph = PoseGraph(walk.poses, walk.edges, measured, np.diag([1e6, 1e6, 2.0]))
        fold = graph.with_poses(_Problem(graph).minimum_from(graph.poses, 300))
        near = graph.with_poses(fold.poses + 1e-6 * rng.normal(size=fold.poses.shape))
        if optimize(lost(graph)).chi2 > 1.01 * near.chi2:
            better += 1
            assert optimize(near).chi2 == pytest.approx(fold.chi2, rel=1e-6)
    assert better > 0


def test_the_estimate_is_repeatable():
    graph = noisy_graph(SE3_GROUP, 8)
    assert np.array_equal(optimize(graph).poses, optimize(graph).poses)


# Agreement --------------------------------------------------------------------------------------------------------------


@GROUPS
def test_jacobians_are_finite_differences(group: Group):
    """Rows of the linearisation are central differences of whitened residuals, rotation errors near pi included."""
    graph = noisy_graph(group, 2, num_poses=6, num_closures=5, angle=0.8)
    problem = _Problem(graph)
    errors, _ = problem._residuals(graph.poses)
    rows = np.stack(problem._rows(graph.poses, errors), axis=1)
    step = 1e-6
    for pose in range(graph.num_poses):
        for axis in range(group.tangent_dim):
            sides = []
            for sign in (1, -1):
                move = np.zeros((graph.num_poses, group.tangent_dim))
                move[pose, axis] = sign * step
                sides.append(problem._residuals(group.compose(graph.poses, group.exp(move)))[1])
            numeric = (sides[0] - sides[1]) / (2 * step)
            analytic = np.einsum("mer,me->mr", rows[..., axis], graph.edges == pose)
            np.testing.assert_allclose(numeric, analytic, atol=1e-6 * np.abs(rows).max())


@pytest.mark.parametrize("seed", range(3))
@GROUPS
def test_a_general_optimiser_finds_the_same_minimum(group: Group, seed: int):
    """SciPy's trust-region solver with numerical derivatives, started at the truth, ends at the same poses."""
    graph = noisy_graph(group, seed, num_poses=6, num_closures=4)
    estimate = optimize(lost(graph))
    roots = np.linalg.cholesky(graph.information).transpose(0, 2, 1)
    i, j = graph.edges.T

    def poses_at(tangents: NDArray) -> NDArray:
        steps = np.concatenate([np.zeros(group.tangent_dim), tangents]).reshape(-1, group.tangent_dim)
        return group.compose(graph.poses, group.exp(steps))

    def residuals(tangents: NDArray) -> NDArray:
        poses = poses_at(tangents)
        errors = group.residual(graph.measurements, group.between(poses[i], poses[j]))
        return np.einsum("eab,eb->ea", roots, errors).ravel()

    found = least_squares(residuals, np.zeros((graph.num_poses - 1) * group.tangent_dim), xtol=1e-12, ftol=1e-14, gtol=1e-12)
    assert estimate.chi2 == pytest.approx(2 * found.cost, rel=1e-8)
    assert np.abs(distances(graph.with_poses(poses_at(found.x)), estimate)).max() < 1e-4


@pytest.mark.parametrize(
    "name", [RECORDED, "csail.g2o", "manhattan3500.g2o", "kitti_05.g2o", "parking-garage.g2o", "smallGrid3D.g2o"]
)
def test_gtsam_agrees_where_it_runs(name: str):
    """Levenberg-Marquardt of GTSAM from our estimate gains next to nothing in its chi^2 and moves by next to nothing.

    Its residual differs from ours in second order, so its minimum does too: by less than a percent of chi^2.
    """
    estimate = optimize(read_pose_graph(data_file(name)))
    factors, values = to_gtsam(estimate)
    anchor = values.atPose2(0) if estimate.group is SE2_GROUP else values.atPose3(0)
    prior = gtsam.PriorFactorPose2 if estimate.group is SE2_GROUP else gtsam.PriorFactorPose3
    anchored = gtsam.NonlinearFactorGraph(factors)
    anchored.add(prior(0, anchor, gtsam.noiseModel.Isotropic.Sigma(estimate.tangent_dim, 1e-4)))
    params = gtsam.LevenbergMarquardtParams()
    params.setRelativeErrorTol(1e-12)
    found = gtsam.LevenbergMarquardtOptimizer(anchored, values, params).optimize()
    assert factors.error(found) <= factors.error(values) <= 1.01 * factors.error(found)
    theirs = from_gtsam(factors, found)
    assert estimate.chi2 <= theirs.chi2 <= 1.01 * estimate.chi2


# Errors -----------------------------------------------------------------------------------------------------------------


def test_a_disconnected_graph_names_what_is_not_reached():
    graph = PoseGraph(np.zeros((4, 3)), [(0, 1), (2, 3)], None, np.eye(3), ids=[10, 20, 30, 40])
    with pytest.raises(DisconnectedGraphError, match="node 10 does not reach: 30, 40"):
        optimize(graph)


def test_too_few_iterations_are_an_error():
    with pytest.raises(
        EstimationError, match=r"expected Gauss-Newton to converge in 1 iterations, got chi\^2 = .* still falling"
    ):
        optimize(lost(noisy_graph(SE2_GROUP, 1, angle=0.3)), max_iterations=1)


def test_information_beyond_double_precision_is_an_error():
    """Ten kilometres measured to 0.1 mm beside turns known to 10 rad: nothing is left of the turns in the normal equations."""
    rng = np.random.default_rng(0)
    n = 14
    edges = [(i, (i + 1) % n) for i in range(n)] + [(0, n // 2)]
    measured = np.column_stack([1e4 * rng.normal(size=(n + 1, 2)), rng.uniform(-3, 3, n + 1)])
    with pytest.raises(EstimationError, match="check the units and the information matrices for extreme ratios"):
        optimize(PoseGraph(np.zeros((n, 3)), edges, measured, np.diag([1e8, 1e8, 1e-2])))
