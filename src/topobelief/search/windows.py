"""What a new pose adds at most, given what the one before it may have closed a loop with.

With the pose where the robot is held, odometry is independent of the map, and the gain of a walk with one closure a pose is

    sum over t of  h(z_t | z_1 … z_t-1) - h(z_t | map, z_1 … z_t-1),        h = 1/2 ln det of the predicted covariance,

z_t the closure of pose t (docs, the mathematics, section 13). Knowing less makes h larger, knowing more makes it smaller. So

    1/2 ln [ det (S + Q_t + R_j) / det (P + Q_t + R_j) ]

is at least the summand: Q_t and R_j are the covariances of odometry and of a closure with pose j, S is that of xi_j - xi_t-1
given the closure of pose t - 1 with pose i alone, and P that of xi_t-1 given the same closure, the map and pose t - 2. For the
joint entropy the first term counts alone, with odometry: 1/2 ln [det (S + Q_t + R_j) / (det R_j det Q_t)]."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.geometry import Group
from topobelief.linalg.compiled import compiled
from topobelief.search.reduced_prior import ReducedPrior
from topobelief.search.rewards import odometry_powers
from topobelief.search.ways import Sightings, Ways

_CLASS = 4  # poses up to a power of this have the drift of the last of them


@dataclass(frozen=True, slots=True)
class Odometry:
    """Odometry between new poses, as far as a piece of a way determines it.

    Attributes
    ----------
    least : shape (P, kappa, kappa)
        Covariance, the smallest, of the odometry of a pose that stands on each piece.
    log_det : shape (P,)
        ln det of its inverse.
    before : shape (P, kappa, kappa)
        Information, the largest, of the odometry of the pose before.
    per_metre : shape (2, kappa)
        Largest variances of odometry about the origin: constant, and per squared metre from there.
    """

    least: FloatArray
    log_det: FloatArray
    before: FloatArray
    per_metre: FloatArray

    def drift(self, count: int, spacing: float) -> FloatArray:
        """Largest covariance of pose number `count`, closures aside, shape (kappa, kappa)."""
        metres = spacing * np.arange(1, count + 1)
        return np.diag(count * self.per_metre[0] + np.sum(metres**2) * self.per_metre[1])


def find_odometry(
    group: Group,
    ways: Ways,
    origin: FloatArray,
    information: FloatArray,
    first: IntArray,
    delta: float,
    spacing: float,
) -> Odometry:
    """Odometry on the pieces of all ways.

    Parameters
    ----------
    group, ways
    origin
        Of the twists.
    information
        Of odometry, in the frame of the pose where it ends.
    first
        Of `Sightings`.
    delta, spacing
        Metres.
    """
    k, kappa = group.position_dim, group.tangent_dim
    largest = [float(np.linalg.eigvalsh(block)[-1]) for block in (information[:k, :k], information[k:, k:])]
    scale = np.repeat(np.sqrt(largest), [k, kappa - k])
    low, high = np.linalg.eigvalsh(information / np.outer(scale, scale))[[0, -1]].tolist()
    way = np.repeat(np.arange(len(ways.lengths)), np.diff(first))
    piece = np.arange(int(first[-1])) - first[way]
    length = ways.lengths[way]
    end = np.minimum((piece + 1) * delta, length)
    begin = np.where(piece == np.diff(first)[way] - 1, length, np.minimum(piece * delta, length))

    def at(powers: FloatArray, u: FloatArray) -> FloatArray:
        along = u[:, None, None]
        return powers[0, way] + along * (powers[1, way] + along * powers[2, way])

    powers = odometry_powers(group, ways, origin, information)
    middle = at(powers, (begin + end) / 2)
    ends = np.stack([at(powers, begin), at(powers, end)])
    ratios: FloatArray = np.real(np.linalg.eigvals(np.linalg.solve(middle, ends))).astype(np.float64)
    excess: FloatArray = np.max(ratios, axis=(0, 2))  # V at both ends is no more than this V
    information_here = np.maximum(excess, 1.0)[:, None, None] * (1 + 1e-9) * middle
    equal = np.diag(high * scale**2)  # at least the information
    lever = (spacing + 2 * delta) * scale[0] / scale[k]
    sheared = 1 + lever**2 / 2 + lever * np.sqrt(1 + lever**2 / 4)
    largest_excess = float(np.max(excess, initial=1.0)) * (1 + 1e-9)
    before = largest_excess * sheared * at(odometry_powers(group, ways, origin, equal), (begin + end) / 2)
    variances = 1 / (low * scale**2)  # at least the covariance
    about = np.zeros((2, kappa))
    about[0, :k], about[0, k:], about[1, :k] = variances[:k], 2 * variances[k:], 2 * variances[k]
    return Odometry(_inverse(information_here), np.linalg.slogdet(information_here)[1], before, about)


def _inverse(matrices: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.inv(matrices), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Windows:
    """What is known of a pose by where the one before it stands.

    Attributes
    ----------
    prior, sightings, odometry
    labels : shape (P,)
        Where a pose stands, from 0 on.
    first, members : shapes (C + 1,), (M,)
        Compressed lists: seen poses with which a pose at each label may close a loop.
    may_see_nothing : shape (C,)
        Whether it may close none.
    spacing
        Metres.
    of_poses
        Whether the new poses count, as for the joint entropy.
    """

    prior: ReducedPrior
    sightings: Sightings
    odometry: Odometry
    labels: IntArray
    first: IntArray
    members: IntArray
    may_see_nothing: BoolArray
    spacing: float
    of_poses: bool

    @staticmethod
    def of(
        prior: ReducedPrior, sightings: Sightings, odometry: Odometry, cells: IntArray, spacing: float, *, of_poses: bool
    ) -> Windows:
        """Windows with labels by cells and by whether anything is sure to be seen.

        Parameters
        ----------
        prior, sightings, odometry
        cells : shape (P,)
            From 0 on.
        spacing, of_poses
        """
        count = np.diff(sightings.start)
        piece = np.repeat(np.arange(len(count)), count)
        always = np.zeros(len(count), dtype=bool)
        always[piece[prior.earliest[sightings.poses] <= 1]] = True
        kind = np.where(count == 0, 0, np.where(always, 1, 2))
        found, labels = np.unique(3 * cells.astype(np.int64) + kind, return_inverse=True)
        pairs = np.unique(labels[piece] * len(prior.earliest) + sightings.poses)
        first = np.searchsorted(pairs, np.arange(len(found) + 1) * len(prior.earliest))
        return Windows(
            prior, sightings, odometry, labels, first, pairs % len(prior.earliest), found % 3 != 1, spacing, of_poses
        )

    def keys(self, number: IntArray, place: IntArray, before: IntArray) -> tuple[IntArray, IntArray]:
        """Different rows of a number that stands for that of the pose, its piece and the label before; and which is whose."""
        last = int(number.max(initial=1))
        stands_for = np.arange(last + 1)
        free = int(self.prior.earliest.max(initial=1)) + 1  # from this pose on all closures are allowed
        power = 1
        while power < last:
            power *= _CLASS
            between = (stands_for > max(power // _CLASS, free)) & (stands_for <= power)
            stands_for[between] = min(power, last)
        size = len(self.may_see_nothing)
        each = (stands_for[number] * len(self.labels) + place) * size + before
        different, which = np.unique(each, return_inverse=True)
        rest = different // size
        columns: list[IntArray] = [rest // len(self.labels), rest % len(self.labels), different % size]
        return np.stack(columns, axis=1), which

    def values(self, keys: IntArray) -> FloatArray:
        """The most that a pose with each of some keys adds, nats."""
        prior, sightings = self.prior, self.sightings
        every = np.arange(len(prior.earliest))
        sigma = prior.sigma(every, every)
        noise = _inverse(prior.closures)
        worth = np.empty(len(keys))
        axes = (0,) * prior.tangent_dim
        for number in np.unique(keys[:, 0]).tolist():
            those = np.flatnonzero(keys[:, 0] == number)
            drift = self.odometry.drift(number - 1, self.spacing)
            known = _inverse(prior.variances + drift + noise)
            worth[those] = _most_added(
                axes, keys[those, 1], keys[those, 2], number, sigma, known, noise, prior.closures, drift,
                self.odometry.least, self.odometry.before, sightings.start, sightings.poses, self.first, self.members,
                self.may_see_nothing, prior.earliest, self.of_poses,
            )  # fmt: skip
        return worth + self.odometry.log_det[keys[:, 1]] / 2 if self.of_poses else worth


@compiled
def _most_added(
    axes: tuple[int, ...],
    places: IntArray,
    before: IntArray,
    number: int,
    sigma: FloatArray,
    known: FloatArray,
    noise: FloatArray,
    closures: FloatArray,
    drift: FloatArray,
    odometry: FloatArray,
    odometry_before: FloatArray,
    start: IntArray,
    poses: IntArray,
    first: IntArray,
    members: IntArray,
    may_see_nothing: BoolArray,
    earliest: IntArray,
    of_poses: bool,
) -> FloatArray:
    """Over all closures that the pose and the one before may make; notation as above, `known` (Sigma_ii + drift + R_i)^-1."""
    b = len(axes)
    worth = np.zeros(len(places))
    s, p, x, y = np.empty((b, b)), np.empty((b, b)), np.empty((b, b)), np.empty((b, b))
    for n in range(len(places)):
        place, label = places[n], before[n]
        any_before = False
        for o in range(first[label], first[label + 1] + 1):
            is_none = o == first[label + 1]
            if is_none:
                if any_before and not may_see_nothing[label]:
                    break
            elif number == 1 or earliest[members[o]] > number - 1:
                continue
            any_before = True
            i = 0 if is_none else members[o]
            for c in range(b):
                for d in range(b):
                    p[c, d] = odometry_before[place, c, d] + (0.0 if is_none else closures[i, c, d])
            _invert(axes, p, x)
            for q in range(start[place], start[place + 1]):
                j = poses[q]
                if earliest[j] > number:
                    continue
                for c in range(b):
                    for d in range(b):
                        s[c, d] = sigma[j * b + c, j * b + d] + drift[c, d]
                if not is_none:
                    for c in range(b):
                        for d in range(b):
                            x[c, d] = sigma[j * b + c, i * b + d] + drift[c, d]
                    for c in range(b):
                        for d in range(b):
                            y[c, d] = 0.0
                            for m in range(b):
                                y[c, d] += x[c, m] * known[i, m, d]
                    for c in range(b):
                        for d in range(b):
                            for m in range(b):
                                s[c, d] -= y[c, m] * x[d, m]
                for c in range(b):
                    for d in range(b):
                        rest = noise[j, c, d]
                        s[c, d] += odometry[place, c, d] + rest
                        if not of_poses:
                            rest += odometry[place, c, d] + (0.0 if number == 1 else p[c, d])
                        y[c, d] = rest
                worth[n] = max(worth[n], 0.5 * (_log_det(axes, s) - _log_det(axes, y)))
    return worth


@compiled
def _log_det(axes: tuple[int, ...], matrix: FloatArray) -> float:
    """Of a positive definite matrix, whose lower triangle becomes its Cholesky factor."""
    b, product = len(axes), 1.0
    for j in range(b):
        for i in range(j, b):
            total = matrix[i, j]
            for m in range(j):
                total -= matrix[i, m] * matrix[j, m]
            if i == j:
                product *= total
                matrix[j, j] = np.sqrt(total)
            else:
                matrix[i, j] = total / matrix[j, j]
    return np.log(product)


@compiled
def _invert(axes: tuple[int, ...], matrix: FloatArray, work: FloatArray) -> None:
    """Replace a positive definite matrix by its inverse."""
    b = len(axes)
    _log_det(axes, matrix)
    for c in range(b):  # columns of the inverse of the factor
        for i in range(b):
            total = 1.0 if i == c else 0.0
            for m in range(i):
                total -= matrix[i, m] * work[m, c]
            work[i, c] = total / matrix[i, i]
    for i in range(b):
        for j in range(b):
            total = 0.0
            for m in range(b):
                total += work[m, i] * work[m, j]
            matrix[i, j] = total
