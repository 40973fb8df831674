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
from topobelief.search.reduced_prior import ReducedPrior, earliest_numbers, inverse_root

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


def topological_prior(
    graph: PoseGraph,
    pose: int,
    seen: IntArray,
    information: FloatArray,
    form: WeightForm,
    *,
    probability: float,
    min_index_gap: int,
    with_errors: bool,
) -> ReducedPrior:
    """The prior on some poses; parameters as for `reduced_prior`, and the form."""
    factors = PriorFactors(graph, pose)
    sample = sample_of(graph.num_poses, DEFAULT_SAMPLE_SIZE) if with_errors else np.zeros(0, dtype=np.int64)
    wanted = np.union1d(seen, sample)
    size, count = len(form.parts), len(seen)
    sigma = np.zeros((count, size, count, size))
    log_det, kernel, mean_square = 0.0, None, math.nan
    k, q = tangent_split(graph.tangent_dim)
    for index, part in enumerate(form.parts):
        factor = factors.factor("trees_r" if part == "rotations" else "trees_p", 0.0)
        if not np.isfinite(factor.log_det.error):
            raise IllConditionedError("number of spanning trees", factor.log_det.error)
        scale = 1.0
        if part == "both":
            w_p, w_r = (float(weights[0]) for weights in factors.scalar_weights)
            scale = (w_r / w_p) ** (q / (k + q))
        rows = inverse_root(factor, wanted)[:, 0] / math.sqrt(scale)  # L^-1 of the wanted poses is rows rows^T
        log_det += factor.log_det.value + (graph.num_poses - 1) * math.log(scale)
        flat = rows[np.searchsorted(wanted, seen)]
        sigma[:, index, :, index] = flat @ flat.T
        if with_errors:
            aligned = centring(len(sample)) @ rows[np.searchsorted(wanted, sample)]
            mean_square = k * float(np.sum(aligned**2)) / len(sample)
            mixed = flat @ aligned.T
            kernel = k * (mixed @ mixed.T) / len(sample)
    closure = probability * form.matrix(information)
    return ReducedPrior(
        size,
        graph.num_poses - 1,
        form.multiplicity * log_det,
        sigma.reshape(count * size, count * size),
        np.broadcast_to(closure, (count, size, size)),
        earliest_numbers(seen, pose, min_index_gap),
        kernel,
        mean_square,
        form.multiplicity,
    )
