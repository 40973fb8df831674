"""What a plan gains, and what each further closure and each piece of odometry would add: concave functions and their gradients.

With Sigma the prior's covariance of the seen poses, and the new poses eliminated, a plan adds A = D - B^T I_nn^-1 B to their
information (D and I_nn its diagonal blocks, B the block between). Three gains, each a concave function of the plan:

    map      1/2 ln det (I + Sigma A)                    entropy that the map loses, nats
    joint    1/2 ln det (I + Sigma A) + 1/2 ln det I_nn  its new poses counted too
    error    tr (I + A Sigma)^-1 A K                     mean square error that the map loses, m^2

The gradient at (i, j) with a weight w on a measurement of information W is, P the covariance after the plan,

    joint    1/2 tr W (P_ii + P_jj - P_ij - P_ji)
    map      the same with P less I_nn^-1 on the new poses
    error    the same with P Pi P in place of P / 2

Only poses of the map that a plan closes loops with enter A, so that matrices are as large as their number.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from topobelief.arrays import FloatArray, IntArray
from topobelief.errors import IllConditionedError
from topobelief.search.plans import Plan
from topobelief.search.reduced_prior import ReducedPrior

Kind = Literal["map", "joint", "error"]
_JITTER = 1e-13  # relative; added to a covariance that is singular to rounding
_LARGEST_JITTER = 1e-7


@dataclass(frozen=True, slots=True)
class Slopes:
    """The gradient of a gain.

    Attributes
    ----------
    closures : shape (T, m)
        Of each closure of a new pose with a seen pose.
    odometry : shape (T, kappa, kappa)
        G_t: odometry V of new pose t counts tr G_t V.
    """

    closures: FloatArray
    odometry: FloatArray

    def of(self, plan: Plan) -> float:
        """The linear function at a plan."""
        return float(np.vdot(self.closures, plan.closures) + np.vdot(self.odometry, plan.odometry))


def gain(prior: ReducedPrior, kind: Kind, plan: Plan) -> float:
    """What a plan gains."""
    return _Posterior(prior, kind, plan).gain


def gain_and_slopes(prior: ReducedPrior, kind: Kind, plan: Plan, *, among: IntArray | None = None) -> tuple[float, Slopes]:
    """What a plan gains, and the gradient there.

    Parameters
    ----------
    prior, kind, plan
    among : shape (w,), optional
        Seen poses, ascending, among them all that the plan closes loops with: closures with others count 0. Default: all.
    """
    posterior = _Posterior(prior, kind, plan)
    return posterior.gain, posterior.slopes(np.arange(len(prior.closures)) if among is None else among)


class _Posterior:
    """Information after a plan, the new poses eliminated; notation as above."""

    def __init__(self, prior: ReducedPrior, kind: Kind, plan: Plan) -> None:
        self.prior, self.kind, self.plan = prior, kind, plan
        kappa, self.num_new = prior.tangent_dim, len(plan.closures)
        self.touched = np.flatnonzero(plan.closures.any(axis=0))
        number = plan.closures[:, self.touched]
        closures = prior.closures[self.touched]
        weighted = number[:, :, None, None] * closures  # (T, m', kappa, kappa)
        own, other = np.zeros((2, self.num_new, self.num_new, kappa, kappa))
        at = np.arange(self.num_new)
        own[at, at] = weighted.sum(axis=1) + plan.odometry
        own[at[:-1], at[:-1]] += plan.odometry[1:]
        other[at[1:], at[:-1]] = -plan.odometry[1:]
        blocks = own + other + other.transpose(1, 0, 3, 2)
        size, columns = self.num_new * kappa, len(self.touched) * kappa
        self.root_new = np.linalg.cholesky(blocks.transpose(0, 2, 1, 3).reshape(size, size))
        self.between = -weighted.transpose(0, 2, 1, 3).reshape(size, columns)
        half = solve_triangular(self.root_new, self.between, lower=True, check_finite=False)
        added = -half.T @ half
        diagonal = added.reshape(len(self.touched), kappa, len(self.touched), kappa)
        every = np.arange(len(self.touched))
        diagonal[every, :, every, :] += number.sum(axis=0)[:, None, None] * closures
        self.index = (self.touched[:, None] * kappa + np.arange(kappa)).ravel()
        self.sigma = prior.sigma[np.ix_(self.index, self.index)]
        root = _root(self.sigma)
        self.spread = added @ root
        core = root.T @ self.spread
        core[np.diag_indices_from(core)] += 1.0
        self.root_core = cho_factor(core, lower=True, check_finite=False)
        self.effect = added - self.spread @ cho_solve(self.root_core, self.spread.T, check_finite=False)  # (I + A Sigma)^-1 A

    @property
    def gain(self) -> float:
        if self.kind == "error":
            assert self.prior.kernel is not None
            return float(np.vdot(self.effect, self.prior.kernel[np.ix_(self.index, self.index)]))
        result = float(np.log(np.diagonal(self.root_core[0])).sum())
        if self.kind == "joint":
            result += float(np.log(np.diagonal(self.root_new)).sum())
        return result

    def slopes(self, seen: IntArray) -> Slopes:
        prior, kappa = self.prior, self.prior.tangent_dim
        columns = (seen[:, None] * kappa + np.arange(kappa)).ravel()
        own = np.searchsorted(columns, self.index)
        rows = prior.sigma[np.ix_(self.index, columns)]
        known = self.effect @ rows  # F: P_:: = Sigma_:: - Sigma_:m' F
        if self.kind == "error":
            assert prior.kernel is not None
            kernel = prior.kernel[np.ix_(self.index, columns)]
            inner = prior.kernel[np.ix_(self.index, self.index)]
            mixed = kernel - inner @ known
            among = mixed - (self.sigma @ self.effect) @ mixed  # Q_m',:
            alone = _diagonal_blocks(prior.kernel, seen, kappa) - _products(known, kernel, kappa, twice=True)
            alone += _products(known, inner @ known, kappa)
            scale = 1.0
        else:
            among = rows - self.sigma @ known  # P_m',:
            alone = _diagonal_blocks(prior.sigma, seen, kappa) - _products(rows, known, kappa)
            scale = 0.5
        lever = cho_solve((self.root_new, True), self.between, check_finite=False)  # I_nn^-1 B
        cross = -lever @ among  # new poses with seen ones
        new = lever @ among[:, own] @ lever.T
        if self.kind == "joint":
            new = new + cho_solve((self.root_new, True), np.eye(len(self.root_new)), check_finite=False)
        count = self.num_new
        new = new.reshape(count, kappa, count, kappa).transpose(0, 2, 1, 3)
        cross = cross.reshape(count, kappa, len(seen), kappa)
        at = np.arange(count)
        each = new[at, at]
        weight = prior.closures[seen]
        slope = np.einsum("jab,jab->j", weight, alone)[None, :] + np.tensordot(each, weight, axes=([1, 2], [1, 2]))
        slope -= 2 * (cross.transpose(0, 2, 1, 3) * weight).sum(axis=(2, 3))
        odometry = each.copy()
        odometry[1:] += each[:-1] - new[at[1:], at[:-1]] - new[at[:-1], at[1:]]
        if len(seen) == len(prior.closures):
            return Slopes(scale * slope, scale * odometry)
        full = np.zeros(self.plan.closures.shape)
        full[:, seen] = scale * slope
        return Slopes(full, scale * odometry)


def _root(covariance: FloatArray) -> FloatArray:
    """Lower triangle L with L L^T the covariance; rows of a pose that is held are 0."""
    variances = np.diagonal(covariance)
    free = np.flatnonzero(variances > 0)
    result = np.zeros_like(covariance)
    part = covariance[np.ix_(free, free)]
    jitter = 0.0
    while True:
        try:
            result[np.ix_(free, free)] = np.linalg.cholesky(part + jitter * np.diag(np.diagonal(part)))
        except np.linalg.LinAlgError:
            jitter = max(10 * jitter, _JITTER)
            if jitter > _LARGEST_JITTER:
                raise IllConditionedError("covariance of the map", math.inf) from None
            continue
        return result


def _diagonal_blocks(matrix: FloatArray, nodes: IntArray, kappa: int) -> FloatArray:
    """Of some nodes, shape (w, kappa, kappa)."""
    index = nodes[:, None] * kappa + np.arange(kappa)
    return matrix[index[:, :, None], index[:, None, :]]


def _products(left: FloatArray, right: FloatArray, kappa: int, *, twice: bool = False) -> FloatArray:
    """X_j^T Y_j for the columns of each node j, shape (w, kappa, kappa); twice: plus its transpose."""
    shape = (left.shape[0], left.shape[1] // kappa, kappa)
    x, y = left.reshape(shape).transpose(1, 2, 0), right.reshape(shape).transpose(1, 0, 2)
    product = x @ y
    return product + product.transpose(0, 2, 1) if twice else product
