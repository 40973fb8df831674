"""Objectives as functions of a gain that is concave in the plan, and of what is linear in it.

    map         J_0 - gain                        + costs
    joint       J_0 - gain + L kappa/2 ln (2 pi e) + (T - L) 1/2 ln det V_idle + costs,   L the new poses of the walk
    error       (E_0^2 - gain)^1/2                + costs
    per_pose    joint / (n_0 - 1 + L)             + costs

A gain at y is bounded by its gradient at x. With D = <gradient, y - x> the gain is at most gain(x) + D; but more is true.
The root of order d of det (for a matrix of size d) and 1 / tr (K I^-1) are concave too, so that

    map, joint  gain(y) <= gain(x) + d/2 ln (1 + 2 D / d),            error  E(y)^2 >= E(x)^2 / (1 + D / E(x)^2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.search.information_gain import Kind
from topobelief.search.plans import Mixture, Plan
from topobelief.search.topological_prior import SeenPrior

_KINDS: dict[str, Kind] = {"map": "map", "joint": "joint", "per_pose": "joint", "error": "error"}


@dataclass(frozen=True, slots=True)
class Criterion:
    """What is minimised over plans, in units of the objective.

    "per_pose" is minimised as J + costs (n_0 - 1 + L_min) - reference (n_0 - 1 + L): it is negative exactly for the walks that
    are better than the reference, and `to_objective` turns a lower bound of it into one of the objective.

    Attributes
    ----------
    kind
        Which gain.
    start
        J_0, or E_0^2.
    size
        d of the concave root.
    per_new_pose, per_idle_pose
        What each adds, beside costs.
    price
        By which costs are multiplied.
    free_poses
        n_0 - 1 for "per_pose", else 0.
    num_new, fewest
        T, and the least number of new poses that any walk has.
    reference
        Value that "per_pose" is compared with.
    """

    kind: Kind
    start: float
    size: int
    per_new_pose: float
    per_idle_pose: float
    price: float
    free_poses: int
    num_new: int
    fewest: int
    reference: float

    @staticmethod
    def of(objective: str, prior: SeenPrior, idle: FloatArray, num_new: int, fewest: int) -> Criterion:
        """The criterion of an objective.

        Parameters
        ----------
        objective
            "error", "map", "joint" or "per_pose".
        prior
        idle : shape (kappa, kappa)
            Odometry of idle poses.
        num_new, fewest
        """
        kind, kappa = _KINDS[objective], prior.tangent_dim * prior.multiplicity
        each = kappa / 2 * math.log(2 * math.pi * math.e)
        start = prior.mean_square if kind == "error" else prior.dimension * each / kappa - prior.log_det / 2
        is_joint, per_pose = kind == "joint", objective == "per_pose"
        size = kappa * (len(prior.closures) + (num_new if is_joint else 0))
        per_idle = prior.multiplicity * float(np.linalg.slogdet(idle)[1]) / 2 if is_joint else 0.0
        free_poses = prior.num_free if per_pose else 0
        price = float(free_poses + fewest) if per_pose else 1.0
        reference = start / max(free_poses, 1) if per_pose else 0.0
        return Criterion(kind, start, size, each if is_joint else 0.0, per_idle, price, free_poses, num_new, fewest, reference)

    @property
    def is_ratio(self) -> bool:
        """Whether the objective is "per_pose"."""
        return self.free_poses > 0

    @property
    def counts_poses(self) -> bool:
        """Whether the number of new poses counts."""
        return self.kind == "joint"

    def compared_with(self, reference: float) -> Criterion:
        """The same with another reference; only "per_pose" has one."""
        return replace(self, reference=reference) if self.is_ratio and math.isfinite(reference) else self

    def at_end(self, *, with_idle: bool = True) -> FloatArray:
        """What is linear in the plan, costs aside, by the number of a walk's new poses, shape (T + 1,)."""
        count = np.arange(self.num_new + 1)
        value = count * self.per_new_pose + (self.num_new - count) * self.per_idle_pose * with_idle
        return value - self.reference * (self.free_poses + count)

    def linear(self, plan: Plan | Mixture) -> float:
        """What is linear in the plan."""
        value = plan.num_poses * self.per_new_pose + (self.num_new - plan.num_poses) * self.per_idle_pose
        return value - self.reference * (self.free_poses + plan.num_poses) + self.price * plan.cost

    def of_gain(self, gain: float) -> float:
        """The rest."""
        return math.sqrt(max(self.start - gain, 0.0)) if self.kind == "error" else self.start - gain

    def rate(self, gain: float) -> float:
        """How much the rest falls with the gain; 0 where there is no error to lose, as on a single pose."""
        if self.kind == "error":
            left = max(self.start - gain, 1e-30 * self.start)
            return 0.5 / math.sqrt(left) if left > 0 else 0.0
        return 1.0

    def least(self, gain: float, ahead: FloatArray) -> FloatArray:
        """Lower bound of the rest where the linear function is D = `ahead` above the gain; convex and falling in D."""
        left = max(self.start - gain, 0.0) if self.kind == "error" else 0.5 * self.size
        if left == 0:
            return np.zeros(len(ahead))
        share = 1 + ahead / left
        some = np.where(share > 0, share, 1.0)
        value = np.sqrt(left / some) if self.kind == "error" else self.start - gain - left * np.log(some)
        return np.where(share <= 0, math.inf, value)

    def least_rate(self, gain: float, ahead: float) -> float:
        """How fast that falls with D."""
        if self.kind == "error":
            left = self.start - gain
            return 0.5 * left**-0.5 * (1 + ahead / left) ** -1.5 if left > 0 else 0.0
        return 1 / (1 + 2 * ahead / self.size)

    def needed(self, gain: float, value: float) -> float:
        """D from which on `least` is at most `value`."""
        if self.kind == "error":
            left = self.start - gain
            return math.inf if value <= 0 else left * (left / value**2 - 1)
        return self.size / 2 * (math.exp(min(2 * (self.start - gain - value) / self.size, 500.0)) - 1)

    def to_objective(self, value: FloatArray) -> FloatArray:
        """Lower bound of the objective from one of what is minimised."""
        if not self.is_ratio:
            return value
        return self.reference + value / (self.free_poses + np.where(value < 0, self.fewest, self.num_new))

    def from_objective(self, value: float) -> float:
        """What is minimised is at least this for every walk whose objective is at least `value`, and below for better ones."""
        if not self.is_ratio:
            return value
        return (value - self.reference) * (self.free_poses + (self.num_new if value > self.reference else self.fewest))
