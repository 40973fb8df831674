"""The prior as its topology alone, in place of `reduced_prior`: each measurement is a weight, and no pose has a lever.

Notation: an edge's weights w_p = |O_pp|^(1/k) and w_r = |O_r|p|^(1/q); L_p and L_r the Laplacians with them; k and q the
dimensions of positions and rotations, kappa = k + q. What is minimised is the objective as its
signature estimates it:

    error   -s_R = (k/n tr Pi_n L_p^+ Pi_n)^(1/2)
    joint   -s_ST, the joint entropy with k ln det L_p + q ln det L_r in place of ln det I
    map     -s_map + n_0 kappa/2 ln (2 pi e), the map's entropy likewise; n_0 existing poses that are not held

A new pose has one variable for each Laplacian that counts, as many times as it counts: k / g for L_p and q / g for L_r, with a
gain that is multiplied by the greatest common divisor g. Where w_r / w_p is the same for all measurements, the geometric mean
w = |Omega|^(1/kappa) alone does for both, with kappa in place of g.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.errors import IllConditionedError
from topobelief.forms.prior_factors import PriorFactors
from topobelief.graph.alignment import DEFAULT_SAMPLE_SIZE, centring, sample_of
from topobelief.graph.information import scalar_weights, tangent_split
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg.estimate import LOG_2_PI_E
from topobelief.linalg.solutions import solutions
from topobelief.search.reduced_prior import ReducedPrior, earliest_numbers, in_blocks

OBJECTIVES = ("error", "map", "joint")
"""Those that have a signature which estimates them."""


def constant(objective: str, graph: PoseGraph) -> float:
    """What an objective's estimate has beyond minus its signature; only s_map leaves it out."""
    return (graph.num_poses - 1) * graph.tangent_dim / 2 * LOG_2_PI_E if objective == "map" else 0.0


_SAME_RATIO = 1e-12  # relative; more than rounding of determinants makes of one ratio
_Part = Literal["positions", "rotations", "both"]


@dataclass(frozen=True, slots=True)
class WeightForm:
    """Which weights stand for an information matrix.

    Attributes
    ----------
    parts
        One for each variable of a pose.
    multiplicity
        By which gains are multiplied.
    """

    parts: tuple[_Part, ...]
    multiplicity: int

    @staticmethod
    def of(objective: str, graph: PoseGraph, *information: FloatArray) -> WeightForm:
        """The form for an objective, and for the graph's noise and that of what may be added, each of shape (kappa, kappa)."""
        k, q = tangent_split(graph.tangent_dim)
        if objective == "error":
            return WeightForm(("positions",), k)
        w_p, w_r = scalar_weights(np.concatenate([graph.information, np.stack(information)]))
        ratio = w_r / w_p
        if np.ptp(ratio) <= _SAME_RATIO * ratio[0]:
            return WeightForm(("both",), k + q)
        common = math.gcd(k, q)
        return WeightForm(("positions",) * (k // common) + ("rotations",) * (q // common), common)

    def matrix(self, information: FloatArray) -> FloatArray:
        """Of one measurement, shape (parts, parts)."""
        k, q = tangent_split(information.shape[-1])
        w_p, w_r = (float(weights[0]) for weights in scalar_weights(information[None]))
        weights = {"positions": w_p, "rotations": w_r, "both": (w_p**k * w_r**q) ** (1 / (k + q))}
        return np.diag([weights[part] for part in self.parts])

    def odometry_powers(self, information: FloatArray, num_ways: int) -> FloatArray:
        """As `rewards.odometry_powers`: the same all along every way."""
        size = len(self.parts)
        powers = np.zeros((3, num_ways, size, size))
        powers[0] = self.matrix(information)
        return powers


@dataclass(frozen=True, eq=False, slots=True)
class TopologicalPrior:
    """The prior on the poses that can be seen, by topology; attributes and methods as of `ReducedPrior`."""

    tangent_dim: int
    num_free: int
    dimension: int
    log_det: float
    closures: FloatArray
    earliest: IntArray
    mean_square: float
    multiplicity: int
    _sigma: FloatArray
    _kernel: FloatArray

    @classmethod
    def of(
        cls,
        graph: PoseGraph,
        pose: int,
        seen: IntArray,
        information: FloatArray,
        form: WeightForm,
        *,
        probability: float,
        min_index_gap: int,
        with_errors: bool,
    ) -> TopologicalPrior:
        """The prior on some poses; parameters as for `ReducedPrior`, and the form."""
        factors = PriorFactors(graph, pose)
        sample = sample_of(graph.num_poses, DEFAULT_SAMPLE_SIZE) if with_errors else np.zeros(0, dtype=np.int64)
        wanted = np.union1d(seen, sample)
        of_seen, of_sample = np.searchsorted(wanted, seen), np.searchsorted(wanted, sample)
        size, count = len(form.parts), len(seen)
        sigma = np.zeros((count, size, count, size))
        log_det, kernel, mean_square = 0.0, np.zeros((count * size, count * size)), math.nan
        k, q = tangent_split(graph.tangent_dim)
        unit = np.eye(len(wanted))[:, None]
        for index, part in enumerate(form.parts):
            factor = factors.factor("trees_r" if part == "rotations" else "trees_p", 0.0)
            if not np.isfinite(factor.log_det.error):
                raise IllConditionedError("number of spanning trees", factor.log_det.error)
            scale = 1.0
            if part == "both":
                w_p, w_r = (float(weights[0]) for weights in factors.scalar_weights)
                scale = (w_r / w_p) ** (q / (k + q))
            inverse = solutions(factor, wanted, unit).values[wanted, 0] / scale  # of the wanted poses
            log_det += factor.log_det.value + (graph.num_poses - 1) * math.log(scale)
            sigma[:, index, :, index] = inverse[np.ix_(of_seen, of_seen)]
            if with_errors:
                centre = centring(sample).columns(1)[:, 0]
                mean_square = k * float(np.trace(centre @ inverse[np.ix_(of_sample, of_sample)] @ centre.T)) / len(sample)
                mixed = inverse[np.ix_(of_seen, of_sample)] @ centre.T
                kernel = k * (mixed @ mixed.T) / len(sample)
        return cls(
            size,
            graph.num_poses - 1,
            (graph.num_poses - 1) * size * form.multiplicity,
            form.multiplicity * log_det,
            np.broadcast_to(probability * form.matrix(information), (count, size, size)),
            earliest_numbers(seen, pose, min_index_gap),
            mean_square,
            form.multiplicity,
            sigma.reshape(count * size, count * size),
            kernel,
        )

    @property
    def variances(self) -> FloatArray:
        return _diagonal_blocks(self._sigma, self.tangent_dim)

    @property
    def kernel_variances(self) -> FloatArray:
        return _diagonal_blocks(self._kernel, self.tangent_dim)

    def sigma(self, rows: IntArray, columns: IntArray) -> FloatArray:
        return self._sigma[np.ix_(in_blocks(rows, self.tangent_dim), in_blocks(columns, self.tangent_dim))]

    def kernel(self, rows: IntArray, columns: IntArray) -> FloatArray:
        return self._kernel[np.ix_(in_blocks(rows, self.tangent_dim), in_blocks(columns, self.tangent_dim))]


SeenPrior = ReducedPrior | TopologicalPrior
"""What a bound needs to know of the prior."""


def _diagonal_blocks(matrix: FloatArray, size: int) -> FloatArray:
    """Blocks on the diagonal, shape (m, size, size)."""
    count = len(matrix) // size
    every = np.arange(count)
    return matrix.reshape(count, size, count, size)[every, :, every, :]
