"""What signatures, bounds and objectives are made of: log-determinants of the theory's forms, traces of their inverses, counts.

A form is a matrix M = sum over edges of R^T R with one anchored pose left out (docs, the mathematics, sections 2 to 5):

    trees_p, trees_r            Laplacians with the weights w_p = |O_pp|^(1/k) and w_r = |O_r|p|^(1/q)
    positions, rotations        I_pp and I_rr, blocks of the information matrix
    rotations_given_positions   L_r|p, the Laplacian of the rotations with weights O_r|p
    joint                       I, the information matrix itself

Traces of an inverse are taken over the positions of a sample S of the poses that existed before the action (all of them, up to
a size), with a projection that takes out what moves all of them together (docs, the mathematics, section 12):

    mean_resistance             1/|S| tr(Pi_n M^-1 Pi_n), M "trees_p", Pi_n takes out the mean: the same for whatever is held
    aligned_trace               1/|S| tr(Pi M^-1 Pi), M "positions" or "joint", Pi takes out the best rigid alignment
    coupled_trace               1/|S| tr(Pi N K^-1 N^T Pi), N = I_pp^-1 I_pr, K "rotations" or "rotations_given_positions"

An engine supplies them after one action (numbers are floats) or after each of K actions at once (arrays of shape (K,), nan
where it cannot). Formulas are written once, for both. Signatures see `TreeForms` only: topology and noise, no geometry.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Generic, Literal

import numpy as np

from topobelief.arrays import BoolArray, FloatArray
from topobelief.graph.information import SAME_NOISE, tangent_split
from topobelief.graph.topology import Topology
from topobelief.graph.variable_kinds import LANDMARK, POSE
from topobelief.linalg.estimate import Estimate, Number

TreeName = Literal["trees_p", "trees_r"]
FormName = Literal["trees_p", "trees_r", "positions", "rotations", "rotations_given_positions", "joint"]

PositionsName = Literal["positions", "joint"]
RotationsName = Literal["rotations", "rotations_given_positions"]

Part = Literal["all", "new"] | tuple[int, ...]
"""The whole matrix; the block of the new poses with all existing ones held; or what is left when these existing poses are held.

The information of some poses alone has ln det M of all less ln det with these poses and the anchor held.
"""

Rows = Literal["all", "positions", "rotations"]
"""Which whitened rows of each loop closure."""


class TreeForms(ABC, Generic[Number]):
    """Topology and noise after one action, or after each of K."""

    @property
    @abstractmethod
    def tangent_dim(self) -> int:
        """kappa: 3 in SE(2), 6 in SE(3)."""

    @property
    @abstractmethod
    def num_existing(self) -> int:
        """Nodes before the action."""

    @property
    @abstractmethod
    def landmarks(self) -> BoolArray:
        """Which nodes before the action are landmarks, shape (num_existing,); new ones are poses."""

    @property
    @abstractmethod
    def num_new(self) -> Number:
        """Poses that the action adds."""

    @abstractmethod
    def of_topology(self, quantity: Callable[[Topology], float]) -> Number:
        """A quantity of the graph after each action."""

    @abstractmethod
    def degree_sum(self) -> Number:
        """Sum over the edges of the simple graph of 1 / (d(i) d(j)), d the degrees."""

    @abstractmethod
    def mean_log_noise(self) -> Number:
        """Mean over the edges of ln |Omega|; 0 without edges."""

    @property
    @abstractmethod
    def weights(self) -> tuple[FloatArray, FloatArray]:
        """(w_p, w_r) of all edges, those of all actions among them."""

    @abstractmethod
    def log_det(self, form: TreeName, *, shift: float | Number = 0.0, part: Part = "all") -> Estimate[Number]:
        """ln det of a form plus `shift` times I."""

    @abstractmethod
    def mean_resistance(self) -> Estimate[Number]:
        """1/|S| tr(Pi_n L^-1 Pi_n), L the Laplacian "trees_p": the sum of effective resistances between pairs of S / |S|^2."""

    @property
    def split(self) -> tuple[int, int]:
        """(k, q): tangent dimensions that are positions, and rotations."""
        return tangent_split(self.tangent_dim)

    @property
    def num_free(self) -> Number:
        """Nodes after the action but for the anchor."""
        return self.num_new + float(self.num_existing - 1)

    @property
    def dimension(self) -> Number:
        """Numbers of all nodes after the action but for the anchor: kappa for a pose, k for a landmark."""
        return float(self.tangent_dim) * self.num_new + float(self.existing_dimension())

    def existing_dimension(self, nodes: tuple[int, ...] | None = None) -> int:
        """Numbers of some existing nodes, the anchor, a pose, among them but not counted. Default: all existing nodes."""
        landmarks = self.landmarks if nodes is None else self.landmarks[list(nodes)]
        num_landmarks = int(np.count_nonzero(landmarks))
        num_poses = len(landmarks) - num_landmarks
        return POSE.dimension(*self.split) * (num_poses - 1) + LANDMARK.dimension(*self.split) * num_landmarks

    @property
    def weight_ratio(self) -> float | None:
        """w_r / w_p where it is the same on all edges, else None, as where there are landmarks."""
        w_p, w_r = self.weights
        if self.landmarks.any():
            return None
        if len(w_p) == 0:
            return 1.0
        ratios = w_r / w_p
        return float(ratios[0]) if np.ptp(ratios) <= SAME_NOISE * ratios[0] else None


class ClosureForms(ABC, Generic[Number]):
    """What loop closures add to the prior extended by the trees of edges that attach the new poses, form "joint" I_b.

    z_l are the whitened residuals of the l-th closure, l in the order of the path, and S = I + R their predicted covariance.
    """

    @abstractmethod
    def base(self) -> Estimate[Number]:
        """ln det I_b."""

    @abstractmethod
    def closures(self, form: FormName, rows: Rows = "all") -> Estimate[Number]:
        """ln det S of some rows of all closures, in a form extended as I_b is."""

    @abstractmethod
    def chained_closures(self, window: int) -> Estimate[Number]:
        """Sum over l of ln det cov(z_l | z_(l - window) … z_(l-1))."""


class Forms(TreeForms[Number]):
    """All forms after one action, or after each of K."""

    @property
    @abstractmethod
    def isotropic(self) -> bool:
        """Whether all noise is block-isotropic, so that I_pp and L_r|p are scalar Laplacians."""

    @abstractmethod
    def largest_lever_sum(self) -> Number:
        """The largest sum over the edges i -> j that leave a pose i of w_p |x_i - x_j|^2."""

    @abstractmethod
    def log_det(self, form: FormName, *, shift: float | Number = 0.0, part: Part = "all") -> Estimate[Number]:
        """ln det of a form plus `shift` times I."""

    @abstractmethod
    def hadamard(self, form: FormName, *, shift: float | Number = 0.0) -> Estimate[Number]:
        """Sum of ln det of a form's diagonal blocks, each plus `shift` times I: an upper bound of `log_det`."""

    @abstractmethod
    def sheared_rotations(self, step: float, *, hadamard: bool) -> Estimate[Number]:
        """ln det of I_rr after the change of variables p -> p - step D^-1 I_pr r, D the block diagonal of I_pp.

        With `hadamard`, the sum of ln det of the diagonal blocks of I_rr - 2 step (1 - step) I_rp D^-1 I_pr, which is larger.
        """

    @abstractmethod
    def aligned_trace(self, form: PositionsName) -> Estimate[Number]:
        """1/|S| tr(Pi M^-1 Pi) over positions, m^2; "joint" is the squared expected error of the map."""

    @abstractmethod
    def coupled_trace(self, rotations: RotationsName) -> Estimate[Number]:
        """1/|S| tr(Pi N K^-1 N^T Pi) with N = I_pp^-1 I_pr: what rotations of covariance K^-1 add to `aligned_trace`, m^2."""

    def knows(self, form: FormName) -> bool:
        """Whether `log_det` of a form has been computed along the way."""
        return False

    def knows_trace(self, form: PositionsName) -> bool:
        """Whether `aligned_trace` of a form has been computed along the way."""
        return False

    @property
    def has_fast_traces(self) -> bool:
        """Whether the joint form's trace costs less than the traces by which it can be bounded."""
        return self.increments is not None

    @property
    @abstractmethod
    def increments(self) -> ClosureForms[Number] | None:
        """What closures add, where the prior is known apart from the action; None from scratch."""
