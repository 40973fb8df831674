"""The estimate as it grows: one iSAM2 update for each key pose, and a robust batch estimate at each goal.

Between goals loop closures carry a Cauchy kernel, so a wrong one bends the estimate a little and does not break it. At a goal
graduated non-convexity (Yang, Antonante, Tzoumas and Carlone, RA-L 2020; truncated least squares, here GTSAM's) sorts all
closures ever added into those that fit and those that do not. The latter leave the graph, and the former lose their kernel.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from topobelief.arrays import BoolArray, FloatArray
from topobelief.conversions.gtsam import load_gtsam
from topobelief.errors import InvalidInputError
from topobelief.geometry import SE2_GROUP
from topobelief.graph.pose_graph import PoseGraph
from topobelief.simulation.factor import CLOSURE, Factor

_PRIOR_SIGMA = 1e-4  # m and rad
_OUTLIER_WEIGHT = 0.5


class BackEnd:
    """Poses from factors.

    Parameters
    ----------
    start : shape (3,)
        The first pose, held.
    cauchy_width
        Of the kernel on closures, standard deviations: residuals much shorter count as with Gaussian noise.
    inlier_probability
        Share of right closures that are to be kept at a goal.
    """

    def __init__(self, start: FloatArray, *, cauchy_width: float = 2.4, inlier_probability: float = 0.9999) -> None:
        self._gtsam: Any = load_gtsam()
        self._start = np.array(start, dtype=np.float64)
        self._cauchy_width, self._inlier_probability = cauchy_width, inlier_probability
        self._factors: list[Factor] = []
        self._kept: list[bool] = []
        self._num_settled = 0
        self._poses = self._start[None].copy()
        self._isam: Any = None
        self._restart()

    @property
    def poses(self) -> FloatArray:
        """The estimate, shape (n, 3)."""
        return self._poses.copy()

    @property
    def factors(self) -> tuple[Factor, ...]:
        """All ever added, in order."""
        return tuple(self._factors)

    @property
    def kept(self) -> BoolArray:
        """Which of them are in the graph, shape (number of factors,)."""
        return np.array(self._kept, dtype=np.bool_)

    @property
    def newest_covariance(self) -> FloatArray:
        """Of the newest pose, in its own frame, shape (3, 3)."""
        return np.asarray(self._isam.marginalCovariance(len(self._poses) - 1), dtype=np.float64)

    def add(self, factors: Sequence[Factor]) -> None:
        """Take in the factors of a key pose; one update.

        Parameters
        ----------
        factors
            Between poses that exist and at most the next one, to which its odometry factor leads.

        Raises
        ------
        InvalidInputError
            For a pose that no odometry leads to.
        """
        poses = self._poses
        for factor in factors:
            if factor.kind != CLOSURE and factor.j == len(poses):
                poses = np.concatenate([poses, SE2_GROUP.compose(poses[factor.i], factor.measurement)[None]])
        for factor in factors:
            if max(factor.i, factor.j) >= len(poses) or min(factor.i, factor.j) < 0:
                raise InvalidInputError(
                    f"expected factors among {len(poses)} poses, got one from {factor.i} to {factor.j}; add its odometry first"
                )
        self._factors += factors
        self._kept += [True] * len(factors)
        self._update([self._between(factor, robust=factor.kind == CLOSURE) for factor in factors], poses)

    def robustify(self) -> None:
        """Separate right closures from wrong ones, all of them anew, and start again from the right ones' estimate."""
        if not any(factor.kind == CLOSURE for factor in self._factors):
            return
        gtsam = self._gtsam
        graph = gtsam.NonlinearFactorGraph()
        graph.add(self._prior())
        for factor in self._factors:
            graph.add(self._between(factor, robust=False))
        params = gtsam.GncLMParams()
        params.setLossType(gtsam.GncLossType.TLS)
        params.setKnownInliers([0, *(n for n, factor in enumerate(self._factors, start=1) if factor.kind != CLOSURE)])
        optimizer = gtsam.GncLMOptimizer(graph, self._values(self._poses, first=0), params)
        optimizer.setInlierCostThresholdsAtProbability(self._inlier_probability)
        estimate = optimizer.optimize()
        self._kept = (np.asarray(optimizer.getWeights())[1:] > _OUTLIER_WEIGHT).tolist()
        self._poses = self._rows(estimate)
        self._num_settled = len(self._factors)
        self._restart()

    def pose_graph(self) -> PoseGraph:
        """The factors that are in the graph, at the estimate."""
        factors = [factor for factor, kept in zip(self._factors, self._kept, strict=True) if kept]
        return PoseGraph(
            self._poses,
            np.array([(factor.i, factor.j) for factor in factors], dtype=np.int64).reshape(-1, 2),
            np.array([factor.measurement for factor in factors]).reshape(-1, 3),
            np.array([factor.information for factor in factors]) if factors else np.eye(3),
        )

    def _restart(self) -> None:
        """A fresh iSAM2 with the factors kept, at the poses as they are."""
        params = self._gtsam.ISAM2Params()
        params.setRelinearizeThreshold(0.01)
        params.relinearizeSkip = 1
        self._isam = self._gtsam.ISAM2(params)
        factors = [
            self._between(factor, robust=factor.kind == CLOSURE and number >= self._num_settled)
            for number, factor in enumerate(self._factors)
            if self._kept[number]
        ]
        poses, self._poses = self._poses, self._poses[:0]
        self._update([self._prior(), *factors], poses)

    def _update(self, factors: list[Any], poses: FloatArray) -> None:
        graph = self._gtsam.NonlinearFactorGraph()
        for factor in factors:
            graph.add(factor)
        self._isam.update(graph, self._values(poses, first=len(self._poses)))
        self._poses = self._rows(self._isam.calculateEstimate())

    def _values(self, poses: FloatArray, *, first: int) -> Any:
        """GTSAM's values of the poses from the first given on; keys are indices."""
        values = self._gtsam.Values()
        for key, pose in enumerate(poses[first:].tolist(), start=first):
            values.insert(key, self._gtsam.Pose2(*pose))
        return values

    def _rows(self, values: Any) -> FloatArray:
        rows = np.asarray(self._gtsam.utilities.extractPose2(values), dtype=np.float64)  # in the order of the keys
        return SE2_GROUP.normalized(rows.reshape(-1, 3))

    def _prior(self) -> Any:
        noise = self._gtsam.noiseModel.Isotropic.Sigma(3, _PRIOR_SIGMA)
        return self._gtsam.PriorFactorPose2(0, self._gtsam.Pose2(*self._start.tolist()), noise)

    def _between(self, factor: Factor, *, robust: bool) -> Any:
        model = self._gtsam.noiseModel
        noise = model.Gaussian.Information(np.ascontiguousarray(factor.information))
        if robust:
            noise = model.Robust.Create(model.mEstimator.Cauchy.Create(self._cauchy_width), noise)
        return self._gtsam.BetweenFactorPose2(factor.i, factor.j, self._gtsam.Pose2(*factor.measurement.tolist()), noise)
