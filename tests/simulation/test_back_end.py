"""The back end: the maximum-likelihood estimate as it grows, and what wrong closures do to it."""

from __future__ import annotations

import math

import numpy as np
import pytest

import topobelief as tb
from topobelief.arrays import FloatArray
from topobelief.errors import InvalidInputError
from topobelief.geometry import SE2_GROUP
from topobelief.graph.pose_graph import PoseGraph
from topobelief.simulation.back_end import BackEnd
from topobelief.simulation.factor import CLOSURE, ODOMETRY, Factor

SIGMAS = np.array([0.02, 0.02, 0.01])
OMEGA = np.diag(SIGMAS**-2)


def drive_around_a_block(laps: int = 4) -> FloatArray:
    """True poses, a metre apart, along a square of 8 m."""
    side = [np.array([1.0, 0.0, 0.0])] * 7 + [np.array([1.0, 0.0, math.pi / 2])]
    poses = [np.zeros(3)]
    for step in side * 4 * laps:
        poses.append(SE2_GROUP.compose(poses[-1], step))
    return np.array(poses)


def factors_of(truth: FloatArray, *, false_share: float, seed: int) -> tuple[list[list[Factor]], set[tuple[int, int]]]:
    """Factors of each key pose, and the (i, j) of the false closures among them."""
    rng = np.random.default_rng(seed)

    def measured(i: int, j: int) -> FloatArray:
        noise = SE2_GROUP.exp(SIGMAS * rng.standard_normal(3))
        return SE2_GROUP.compose(SE2_GROUP.between(truth[i], truth[j]), noise)

    steps: list[list[Factor]] = []
    false: set[tuple[int, int]] = set()
    for j in range(1, len(truth)):
        step = [Factor(j - 1, j, measured(j - 1, j), OMEGA, ODOMETRY)]
        same_place = np.flatnonzero(np.linalg.norm(truth[: max(0, j - 5), :2] - truth[j, :2], axis=1) < 0.5)
        step += [Factor(i, j, measured(i, j), OMEGA, CLOSURE) for i in same_place.tolist()]
        if j > 5 and rng.random() < false_share:
            i = int(rng.integers(0, j - 5))
            wrong = np.array([*rng.uniform(-2, 2, 2), rng.uniform(-1, 1)])
            step.append(Factor(i, j, wrong, OMEGA, CLOSURE))
            false.add((i, j))
        steps.append(step)
    return steps, false


def rms(poses: FloatArray, truth: FloatArray) -> float:
    return float(np.sqrt(np.mean(((poses - truth)[:, :2] ** 2).sum(axis=1))))


def grown(steps: list[list[Factor]], **settings: float) -> BackEnd:
    back_end = BackEnd(np.zeros(3), **settings)
    for step in steps:
        back_end.add(step)
    return back_end


def test_growing_pose_by_pose_ends_at_the_batch_estimate() -> None:
    steps, _ = factors_of(drive_around_a_block(2), false_share=0.0, seed=0)
    back_end = grown(steps, cauchy_width=1e4)
    np.testing.assert_allclose(back_end.poses, tb.optimize(back_end.pose_graph()).poses, atol=2e-3)


def test_ten_percent_false_closures_neither_break_the_growing_nor_the_settled_estimate() -> None:
    for seed in range(3):
        truth = drive_around_a_block()
        steps, false = factors_of(truth, false_share=0.22, seed=seed)
        closures = [factor for step in steps for factor in step if factor.kind == CLOSURE]
        assert 0.05 < len(false) / len(closures) < 0.2
        back_end = grown(steps)
        growing = rms(back_end.poses, truth)
        trusting = rms(tb.optimize(back_end.pose_graph()).poses, truth)
        back_end.robustify()
        settled = rms(back_end.poses, truth)
        dropped = {(f.i, f.j) for f, kept in zip(back_end.factors, back_end.kept, strict=True) if not kept}
        assert dropped == false
        assert trusting > 0.5
        assert growing < 0.2
        assert settled < 0.08
        assert back_end.pose_graph().num_edges == len(back_end.factors) - len(false)


def test_right_closures_survive_settling_and_the_estimate_goes_on_from_there() -> None:
    truth = drive_around_a_block(2)
    steps, _ = factors_of(truth, false_share=0.0, seed=5)
    back_end = grown(steps[:50])
    back_end.robustify()
    assert back_end.kept.all()
    for step in steps[50:]:
        back_end.add(step)
    back_end.robustify()
    assert back_end.kept.all()
    np.testing.assert_allclose(back_end.poses, tb.optimize(back_end.pose_graph()).poses, atol=1e-3)


def test_the_graph_is_whole_at_any_time_and_the_first_pose_stays() -> None:
    start = np.array([3.0, -1.0, 2.0])
    back_end = BackEnd(start)
    alone = back_end.pose_graph()
    assert (alone.num_poses, alone.num_edges) == (1, 0)
    back_end.robustify()
    back_end.add([Factor(0, 1, np.array([1.0, 0.0, 0.1]), OMEGA, ODOMETRY)])
    graph = back_end.pose_graph()
    assert isinstance(graph, PoseGraph)
    np.testing.assert_allclose(graph.poses, [start, SE2_GROUP.compose(start, np.array([1.0, 0.0, 0.1]))], atol=1e-9)
    np.testing.assert_allclose(back_end.newest_covariance, np.diag(SIGMAS**2), rtol=0.1, atol=1e-6)


def test_the_same_factors_give_the_same_bits() -> None:
    steps, _ = factors_of(drive_around_a_block(2), false_share=0.2, seed=3)
    runs = [grown(steps) for _ in range(2)]
    for run in runs:
        run.robustify()
    assert runs[0].poses.tobytes() == runs[1].poses.tobytes()


def test_a_closure_to_a_pose_without_odometry_is_refused_and_changes_nothing() -> None:
    back_end = BackEnd(np.zeros(3))
    with pytest.raises(InvalidInputError, match="add its odometry first"):
        back_end.add([Factor(0, 1, np.array([1.0, 0.0, 0.0]), OMEGA, CLOSURE)])
    assert len(back_end.factors) == 0
    assert len(back_end.poses) == 1
