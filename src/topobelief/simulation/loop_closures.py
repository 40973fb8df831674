"""Loop closures: which key poses may have seen the same place, which matches to believe, and which of them agree.

A match is believed where three tests pass. It fits: RMSE and share of matched points. It stays near the estimate. And it
agrees with others: pairwise consistency (Mangelson, Dominic, Eustice and Vasudevan, ICRA 2018), because rooms that look alike
match well and wrongly.

Pairwise consistency here is measured in the frame of the dead-reckoned chain X of odometry, which is never re-estimated. A
closure z from i to j moves that chain by D = X_i z X_j^-1, the identity for a closure that odometry confirms. Two closures
ought to move it alike: conjugating their cycle z_a T_jl z_b^-1 T_ki by X_i gives D_a D_b^-1. Steps of odometry are
independent, so with their covariances added up in that frame, S_n = sum Ad(X) Sigma Ad(X)^T, the part of the cycle that is
odometry has covariance |S_l - S_j| + |S_k - S_i|, and all pairs are compared at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.geometry import SE2_GROUP
from topobelief.simulation.factor import Factor
from topobelief.simulation.occupancy import OccupancyMap


def closure_candidates(
    poses: FloatArray, occupancy: OccupancyMap | None, *, search_radius: float, min_index_gap: int
) -> IntArray:
    """Key poses that the newest one may close a loop with, nearest first.

    Parameters
    ----------
    poses : shape (n, 3)
        Estimate of all key poses.
    occupancy
        The map so far, in which nothing may stand between the two; None: no such test.
    search_radius
        They are nearer than this, metres.
    min_index_gap
        Least difference of their indices.
    """
    newest = poses[-1]
    earlier = poses[: max(0, len(poses) - min_index_gap)]
    distances = np.linalg.norm(earlier[:, :2] - newest[:2], axis=1)
    near = np.flatnonzero(distances < search_radius)
    if occupancy is not None and near.size:
        near = near[occupancy.line_of_sight(earlier[near, :2], newest[:2])]
    return near[np.argsort(distances[near], kind="stable")]


class OdometryChain:
    """The dead-reckoned chain of odometry factors, and its covariances added up in one frame."""

    def __init__(self) -> None:
        self.poses = SE2_GROUP.identity()[None]
        self.covariances = np.zeros((1, 3, 3))

    def append(self, odometry: Factor) -> None:
        """One more step."""
        pose = SE2_GROUP.compose(self.poses[-1], odometry.measurement)
        adjoint = SE2_GROUP.adjoint(pose)
        step = adjoint @ np.linalg.inv(odometry.information) @ adjoint.T
        self.poses = np.concatenate([self.poses, pose[None]])
        self.covariances = np.concatenate([self.covariances, (self.covariances[-1] + step)[None]])


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    factor: Factor
    moved: FloatArray  # D
    covariance: FloatArray  # of the closure, in the frame of the chain


class PairwiseConsistency:
    """Decides which closures to believe, as they come.

    Parameters
    ----------
    confidence
        Share of right pairs that count as consistent.
    min_agreeing
        Closures that must agree before any of them is believed.
    window
        Key poses back to which closures are compared; a closure that agrees with too few others by then is dropped.
    """

    def __init__(self, *, confidence: float, min_agreeing: int, window: int) -> None:
        self.chain = OdometryChain()
        self._threshold = float(chi2.ppf(confidence, 3))
        self._min_agreeing, self._window = min_agreeing, window
        self._candidates: list[_Candidate] = []
        self._believed: list[bool] = []

    def believed(self, closures: list[Factor]) -> list[Factor]:
        """Those that can be believed now: of the new ones, and of earlier ones that these confirm.

        Parameters
        ----------
        closures
            Matches of the newest key pose. Those that odometry contradicts are left out for good.
        """
        newest = len(self.chain.poses) - 1
        self._forget_before(newest - self._window)
        for closure in closures:
            candidate = self._candidate(closure)
            span = self.chain.covariances[closure.j] - self.chain.covariances[closure.i]
            if self._distances(candidate.moved, candidate.covariance + span) <= self._threshold:
                self._candidates.append(candidate)
                self._believed.append(False)
        if not closures or not self._candidates:
            return []
        agreeing = _largest_clique(self._consistent_pairs())
        if len(agreeing) < self._min_agreeing:
            return []
        fresh = [n for n in agreeing if not self._believed[n]]
        for n in fresh:
            self._believed[n] = True
        return [self._candidates[n].factor for n in fresh]

    def _forget_before(self, first: int) -> None:
        recent = [n for n, candidate in enumerate(self._candidates) if candidate.factor.j >= first]
        self._candidates = [self._candidates[n] for n in recent]
        self._believed = [self._believed[n] for n in recent]

    def _candidate(self, closure: Factor) -> _Candidate:
        poses = self.chain.poses
        seen = SE2_GROUP.compose(poses[closure.i], closure.measurement)
        adjoint = SE2_GROUP.adjoint(seen)
        return _Candidate(
            factor=closure,
            moved=SE2_GROUP.compose(seen, SE2_GROUP.inverse(poses[closure.j])),
            covariance=adjoint @ np.linalg.inv(closure.information) @ adjoint.T,
        )

    def _consistent_pairs(self) -> BoolArray:
        """Shape (C, C)."""
        candidates, sums = self._candidates, self.chain.covariances
        moved = np.array([each.moved for each in candidates])
        own = np.array([each.covariance for each in candidates])
        i = np.array([each.factor.i for each in candidates])
        j = np.array([each.factor.j for each in candidates])
        cycles = SE2_GROUP.compose(moved[:, None], SE2_GROUP.inverse(moved)[None])
        spans = sum(sums[np.maximum(n[:, None], n[None])] - sums[np.minimum(n[:, None], n[None])] for n in (i, j))
        return self._distances(cycles, own[:, None] + own[None] + spans) <= self._threshold

    @staticmethod
    def _distances(cycles: FloatArray, covariances: FloatArray) -> FloatArray:
        """Squared Mahalanobis distances of cycles from the identity."""
        tangent = SE2_GROUP.log(cycles)[..., None]
        return (tangent * np.linalg.solve(covariances, tangent)).sum(axis=(-2, -1))


def _largest_clique(consistent: BoolArray) -> list[int]:
    """Members of a large set that are consistent with one another, in order; greedily, the best connected first."""
    open_to = np.ones(len(consistent))
    links = consistent.astype(np.float64)
    np.fill_diagonal(links, 0.0)
    members: list[int] = []
    while open_to.any():
        taken = int(np.argmax(np.where(open_to > 0, links @ open_to, -1.0)))
        members.append(taken)
        open_to *= links[taken]
    return sorted(members)
