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
from scipy.linalg import cho_factor, cho_solve_banded, cholesky_banded, solve_triangular

from topobelief.arrays import FloatArray, IntArray
from topobelief.errors import IllConditionedError
from topobelief.search.plans import Background, Mixture, Plan, alone
from topobelief.search.reduced_prior import in_blocks
from topobelief.search.topological_prior import SeenPrior

Kind = Literal["map", "joint", "error"]
_JITTER = 1e-13  # relative; added to a covariance that is singular to rounding
_LARGEST_JITTER = 1e-7


@dataclass(frozen=True, slots=True)
class Slopes:
    """The gradient of a gain; variables are numbered as in `Background`.

    Attributes
    ----------
    closures : shape (T C, m)
        Of each closure of a new pose in a cell with a seen pose.
    odometry : shape (T, C, C, kappa, kappa)
        G_tbc: odometry V from cell b to new pose t in cell c counts tr G_tbc V. The pose where the robot is counts as in any.
    """

    closures: FloatArray
    odometry: FloatArray

    def of(self, plan: Plan) -> float:
        """The linear function at a plan."""
        at = np.arange(len(plan.closures))
        variables = at * self.odometry.shape[1] + plan.cells
        before = np.concatenate([np.zeros(1, np.int64), plan.cells[:-1]])[: len(at)]
        of_closures = float(np.vdot(self.closures[variables], plan.closures))
        return of_closures + float(np.vdot(self.odometry[at, before, plan.cells], plan.odometry))

    def of_background(self, background: Background) -> float:
        """The linear function at a background."""
        variable, cells = background.target, background.num_cells
        before = np.where(background.source >= 0, background.source % cells, 0)
        of_odometry = np.vdot(self.odometry[variable // cells, before, variable % cells], background.odometry)
        return float(np.vdot(self.closures, background.closures) + of_odometry)


def gain(prior: SeenPrior, kind: Kind, plan: Plan | Mixture) -> float:
    """What a plan gains."""
    return _Posterior(prior, kind, plan).gain


def gain_and_slopes(
    prior: SeenPrior, kind: Kind, plan: Plan | Mixture, *, among: IntArray | None = None
) -> tuple[float, Slopes]:
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

    def __init__(self, prior: SeenPrior, kind: Kind, plan: Plan | Mixture) -> None:
        self.prior, self.kind = prior, kind
        mixture = alone(plan) if isinstance(plan, Plan) else plan
        kappa, background = prior.tangent_dim, mixture.background
        self.num_cells, self.shape = background.num_cells, background.closures.shape
        source, target, odometry, number = _joined(mixture)
        self.variables = np.unique(target)
        count = len(self.variables)
        number = number[self.variables]
        self.touched = np.flatnonzero(number.any(axis=0))
        number = number[:, self.touched]
        closures = prior.closures[self.touched]
        weighted = number[:, :, None, None] * closures  # (N, m', kappa, kappa)
        head = np.searchsorted(self.variables, target)
        inner = source >= 0
        tail = np.searchsorted(self.variables, source[inner])
        blocks = weighted.sum(axis=1)
        np.add.at(blocks, head, odometry)
        np.add.at(blocks, tail, odometry[inner])
        at = np.arange(count)
        rows, columns = np.concatenate([at, head[inner]]), np.concatenate([at, tail])
        self.root_new = _banded_root(rows, columns, np.concatenate([blocks, -odometry[inner]]), count, kappa)
        size = len(self.touched) * kappa
        self.between = -weighted.transpose(0, 2, 1, 3).reshape(count * kappa, size)
        self.lever = cho_solve_banded((self.root_new, True), self.between, check_finite=False)  # I_nn^-1 B
        added = -self.between.T @ self.lever
        added = (added + added.T) / 2
        diagonal = added.reshape(len(self.touched), kappa, len(self.touched), kappa)
        every = np.arange(len(self.touched))
        diagonal[every, :, every, :] += number.sum(axis=0)[:, None, None] * closures
        self.sigma = prior.sigma(self.touched, self.touched)
        root = _root(self.sigma)
        self.spread = added @ root
        core = root.T @ self.spread
        core[np.diag_indices_from(core)] += 1.0
        self.root_core = cho_factor(core, lower=True, check_finite=False)
        half = solve_triangular(self.root_core[0], self.spread.T, lower=True, check_finite=False)
        self.effect = added - half.T @ half  # (I + A Sigma)^-1 A

    @property
    def gain(self) -> float:
        if self.kind == "error":
            return float(np.vdot(self.effect, self.prior.kernel(self.touched, self.touched)))
        result = float(np.log(np.diagonal(self.root_core[0])).sum())
        if self.kind == "joint":
            result += float(np.log(self.root_new[0]).sum())
        return self.prior.multiplicity * result

    def slopes(self, seen: IntArray) -> Slopes:
        prior, kappa = self.prior, self.prior.tangent_dim
        own = in_blocks(np.searchsorted(seen, self.touched), kappa)
        rows = prior.sigma(self.touched, seen)
        known = self.effect @ rows  # F: P_:: = Sigma_:: - Sigma_:m' F
        if self.kind == "error":
            kernel, inner = prior.kernel(self.touched, seen), prior.kernel(self.touched, self.touched)
            rows = kernel - inner @ known
            free = prior.kernel_variances[seen] - _products(known, kernel, kappa, twice=True)
            free += _products(known, inner @ known, kappa)
            scale = 1.0
        else:
            free = prior.variances[seen] - _products(rows, known, kappa)
            scale = 0.5 * prior.multiplicity
        cross = np.linalg.multi_dot([self.lever, self.sigma, self.effect, rows]) - self.lever @ rows  # new poses with seen ones
        each, odometry = self._among_new(-cross[:, own])
        cross = cross.reshape(len(self.variables), kappa, len(seen), kappa)
        weight = prior.closures[seen]
        slope = np.einsum("jab,jab->j", weight, free)[None, :] + np.tensordot(each, weight, axes=([1, 2], [1, 2]))
        slope -= 2 * (cross.transpose(0, 2, 1, 3) * weight).sum(axis=(2, 3))
        full = np.zeros(self.shape)
        full[np.ix_(self.variables, seen)] = scale * slope
        return Slopes(full, scale * odometry)

    def _among_new(self, among: FloatArray) -> tuple[FloatArray, FloatArray]:
        """X of each new pose, shape (N, kappa, kappa); and what odometry from any cell to any other counts, as in `Slopes`."""
        kappa, cells = self.prior.tangent_dim, self.num_cells
        count = self.shape[0] // cells
        inverse = None
        if self.kind == "joint":
            identity = np.eye(len(self.variables) * kappa)
            inverse = cho_solve_banded((self.root_new, True), identity, check_finite=False)
        first_of_each: IntArray = np.arange(count + 1, dtype=np.int64) * cells
        begin: list[int] = np.searchsorted(self.variables, first_of_each).tolist()
        each = np.zeros((len(self.variables), kappa, kappa))
        odometry = np.zeros((count, cells, cells, kappa, kappa))
        before = slice(0, 0)
        for t in range(count):
            here = slice(begin[t], begin[t + 1])
            both = slice(before.start if t else here.start, here.stop)
            flat, to = (slice(part.start * kappa, part.stop * kappa) for part in (here, both))
            block = among[flat] @ self.lever[to].T
            if inverse is not None:
                block = block + inverse[flat, to]
            block = block.reshape(here.stop - here.start, kappa, both.stop - both.start, kappa).transpose(0, 2, 1, 3)
            mine = self.variables[here] - t * cells
            older = both.stop - both.start - len(mine)
            at = np.arange(len(mine))
            each[here] = block[at, older + at]
            part = np.broadcast_to(each[here][None], (cells, len(mine), kappa, kappa)).copy()
            if older:
                cross = block[:, :older].transpose(1, 0, 2, 3)
                part[self.variables[before] - (t - 1) * cells] += each[before][:, None] - cross - cross.transpose(0, 1, 3, 2)
            odometry[t][:, mine] = part
            before = here
        return each, odometry


def _joined(mixture: Mixture) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Odometry: variables that it joins, and information; and the closures of each variable, shape (T C, m)."""
    background, cells = mixture.background, mixture.background.num_cells
    number = np.zeros_like(background.closures) if mixture.plans else mixture.share * background.closures
    sources, targets, odometry = list[IntArray](), list[IntArray](), list[FloatArray]()
    for plan, weight in zip(mixture.plans, mixture.weights.tolist(), strict=True):
        variables = np.arange(len(plan.closures)) * cells + plan.cells
        number[variables] += weight * plan.closures
        sources.append(np.concatenate([[-1], variables[:-1]])[: len(variables)])
        targets.append(variables)
        odometry.append(weight * plan.odometry)
    kept = np.ones(len(background.source), dtype=bool)
    if mixture.only_used:
        used = np.zeros(len(number) + 1, dtype=bool)  # the last one, with index -1, is the pose where the robot is
        used[np.concatenate([[-1], *targets])] = True
        kept = used[background.source] & used[background.target]
    sources.append(background.source[kept])
    targets.append(background.target[kept])
    odometry.append(mixture.share * background.odometry[kept])
    return np.concatenate(sources), np.concatenate(targets), np.concatenate(odometry), number


def _banded_root(rows: IntArray, columns: IntArray, blocks: FloatArray, count: int, kappa: int) -> FloatArray:
    """Cholesky factor, as lower bands, of a symmetric matrix given by the blocks of its lower half; those in one place add."""
    at = np.arange(kappa)
    i = (rows[:, None, None] * kappa + at[:, None]) + np.zeros(kappa, np.int64)
    j = (columns[:, None, None] * kappa + at) + np.zeros((kappa, 1), np.int64)
    lower = i >= j
    band = i[lower] - j[lower]
    matrix = np.zeros((int(band.max(initial=0)) + 1, count * kappa))
    np.add.at(matrix, (band, j[lower]), blocks[lower])
    return cholesky_banded(matrix, lower=True, check_finite=False)


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


def _products(left: FloatArray, right: FloatArray, kappa: int, *, twice: bool = False) -> FloatArray:
    """X_j^T Y_j for the columns of each node j, shape (w, kappa, kappa); twice: plus its transpose."""
    shape = (left.shape[0], left.shape[1] // kappa, kappa)
    x, y = left.reshape(shape).transpose(1, 2, 0), right.reshape(shape).transpose(1, 0, 2)
    product = x @ y
    return product + product.transpose(0, 2, 1) if twice else product
