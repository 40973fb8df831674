"""What is done today to evaluate one action, as lean as it can be made: prepared once, then called for each action.

Each method has its quantity as a number, so that a benchmark can check that all methods of one quantity agree. What does not
depend on the method is prepared outside the clock: the posterior graph for the methods that evaluate it from scratch (for
GTSAM its factors and values too).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import qdldl
from scipy import linalg

from topobelief.arrays import FloatArray, IntArray
from topobelief.conversions.gtsam import load_gtsam, to_gtsam
from topobelief.graph.action import Action, posterior
from topobelief.graph.alignment import DEFAULT_SAMPLE_SIZE, Alignment
from topobelief.graph.fisher import fisher_rows
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg.block_pattern import BlockPattern
from topobelief.linalg.edge_form import EdgeForm, laplacian_form
from topobelief.position_errors import expected_errors
from topobelief.signatures.von_neumann import von_neumann_entropy, von_neumann_entropy_approx

_QDLDL: Any = qdldl  # ships no types

Quantity = Literal["log det I", "tau", "s_VN", "s_VN by degrees", "E"]

BaselineKind = Literal["standard", "lemma", "topology", "error"]

Evaluate = Callable[[], float]
"""The clock runs while it is called."""


@dataclass(frozen=True, slots=True)
class Baseline:
    """A way to evaluate actions one by one.

    Attributes
    ----------
    name
    quantity
        What it computes.
    kind
        "standard": standard belief space planning, from scratch; "lemma": the same by the determinant lemma; "topology":
        signatures from scratch; "error": the expected error of the map, from scratch.
    largest_graph
        Poses of the prior above which it would take minutes or more memory than there is.
    with_landmarks
        Whether it takes graphs with landmarks, too.
    prepare
        Called with the prior, on the clock of what is paid once per session; gives what makes an action, outside the clock,
        ready to be evaluated.
    """

    name: str
    quantity: Quantity
    kind: BaselineKind
    largest_graph: float
    prepare: Callable[[PoseGraph], Callable[[Action], Evaluate]]
    with_landmarks: bool = True

    def takes(self, graph: PoseGraph) -> bool:
        """Whether it suits the graph."""
        return graph.num_poses <= self.largest_graph and (self.with_landmarks or not graph.num_landmarks)


def baselines() -> tuple[Baseline, ...]:
    """All of them, the standard ones first."""
    return (
        Baseline("standard BSP, GTSAM, COLAMD", "log det I", "standard", math.inf, _gtsam_elimination("COLAMD")),
        Baseline("standard BSP, GTSAM, METIS", "log det I", "standard", math.inf, _gtsam_elimination("METIS")),
        Baseline("standard BSP, sparse LDLᵀ", "log det I", "standard", math.inf, _sparse_information),
        Baseline("rAMDL on iSAM2's joint marginals", "log det I", "lemma", math.inf, _ramdl_on_isam2, with_landmarks=False),
        Baseline("rAMDL on the dense covariance", "log det I", "lemma", 3500, _ramdl_on_dense_covariance, with_landmarks=False),
        Baseline("t-BSP from scratch, s_ST", "tau", "topology", math.inf, _spanning_trees),
        Baseline("t-BSP from scratch, ŝ_VN", "s_VN by degrees", "topology", math.inf, _von_neumann_approx),
        Baseline("t-BSP from scratch, exact s_VN", "s_VN", "topology", 2000, _von_neumann),
        Baseline("E from GTSAM's marginals", "E", "error", math.inf, _gtsam_marginals, with_landmarks=False),
        Baseline("E from scratch", "E", "error", math.inf, lambda graph: lambda action: lambda: _error(graph, action)),
    )


def anchor_of(graph: PoseGraph) -> int:
    """The pose that all methods hold."""
    return graph.last_pose


# Standard belief space planning


def _gtsam_elimination(ordering: str) -> Callable[[PoseGraph], Callable[[Action], Evaluate]]:
    """Linearise the whole posterior and eliminate it into a Bayes tree."""

    def prepare(graph: PoseGraph) -> Callable[[Action], Evaluate]:
        ordering_type = getattr(load_gtsam().Ordering.OrderingType, ordering)

        def ready(action: Action) -> Evaluate:
            factors, values = _held_factors(posterior(graph, action), anchor_of(graph))

            def evaluate() -> float:
                return 2 * float(factors.linearize(values).eliminateMultifrontal(ordering_type).logDeterminant())

            return evaluate

        return ready

    return prepare


def _sparse_information(graph: PoseGraph) -> Callable[[Action], Evaluate]:
    """Information matrix of the whole posterior, assembled in compressed columns, and its L D L^T factor."""
    prior_rows = fisher_rows(graph)

    def ready(action: Action) -> Evaluate:
        after = posterior(graph, action)

        def evaluate() -> float:
            rows = prior_rows.joined(fisher_rows(after, first_edge=graph.num_edges))
            return _log_det(rows.joint(), after.num_nodes, anchor_of(graph))

        return evaluate

    return ready


# Standard belief space planning by the augmented matrix determinant lemma (Kopitkov and Indelman, IJRR 2017)


def _ramdl_on_isam2(graph: PoseGraph) -> Callable[[Action], Evaluate]:
    gtsam = load_gtsam()
    factors, values = _held_factors(graph, anchor_of(graph))
    inference = gtsam.ISAM2()
    inference.update(factors, values)
    log_det = 2 * float(factors.linearize(values).eliminateMultifrontal(gtsam.Ordering.OrderingType.COLAMD).logDeterminant())

    def covariance(touched: IntArray) -> FloatArray:
        inference.deleteCachedShortcuts()  # else later actions would reuse the marginals of earlier ones
        return _joint_covariance(graph, touched, inference)

    return lambda action: _ramdl(graph, action, log_det, covariance)


def _ramdl_on_dense_covariance(graph: PoseGraph) -> Callable[[Action], Evaluate]:
    """The whole covariance matrix of the prior, once."""
    kappa, anchor = graph.tangent_dim, anchor_of(graph)
    free = np.arange(graph.num_poses) != anchor
    form = fisher_rows(graph).joint()
    upper = BlockPattern.build(graph.edges, free, form.block_size).upper(form).toarray()
    factor, _ = linalg.cho_factor(upper, lower=False, overwrite_a=True, check_finite=False)
    log_det = 2 * float(np.log(np.diag(factor)).sum())
    inverse, _ = linalg.lapack.dpotri(factor, lower=0, overwrite_c=1)
    position = np.cumsum(free) - 1

    def covariance(touched: IntArray) -> FloatArray:
        places, known = position[touched], touched != anchor
        indices = (places[known][:, None] * kappa + np.arange(kappa)).ravel()
        within = (np.flatnonzero(known)[:, None] * kappa + np.arange(kappa)).ravel()
        matrix = np.zeros((len(touched) * kappa, len(touched) * kappa))
        part = inverse[np.minimum(indices[:, None], indices), np.maximum(indices[:, None], indices)]
        matrix[np.ix_(within, within)] = part
        return matrix

    return lambda action: _ramdl(graph, action, log_det, covariance)


def _joint_covariance(graph: PoseGraph, nodes: IntArray, source: Any) -> FloatArray:
    """Of some poses in the world, shape (len(nodes) kappa, len(nodes) kappa), from GTSAM, whose is in each pose's own frame."""
    k, kappa, keys = graph.group.position_dim, graph.tangent_dim, graph.ids[nodes].tolist()
    joint = source.jointMarginalCovariance(keys)
    order = np.arange(3) if kappa == 3 else np.array([3, 4, 5, 0, 1, 2])
    ranks = np.argsort(np.argsort(keys))  # GTSAM sorts keys
    indices = (ranks[:, None] * kappa + order).ravel()
    matrix: FloatArray = joint.fullMatrix()[np.ix_(indices, indices)]
    turn = np.tile(np.eye(kappa), (len(nodes), 1, 1))
    turn[:, :k, :k] = graph.group.rotation_matrix(graph.poses[nodes])
    if kappa == 6:
        turn[:, k:, k:] = turn[:, :k, :k]
    blocks = matrix.reshape(len(nodes), kappa, len(nodes), kappa)
    return np.einsum("iab,ibjd,jcd->iajc", turn, blocks, turn, optimize=True).reshape(matrix.shape)


def _held_factors(graph: PoseGraph, anchor: int) -> tuple[Any, Any]:
    """Factors and values, measurements as the poses predict them.

    Relative measurements leave a rigid motion free, so that a unit prior on one pose multiplies the determinant by 1.
    """
    gtsam = load_gtsam()
    fitting = PoseGraph(graph.poses, graph.edges, None, graph.noise, graph.kinds, ids=graph.ids, readings=graph.readings)
    factors, values = to_gtsam(fitting)
    key = int(graph.ids[anchor])
    prior, pose = (
        (gtsam.PriorFactorPose2, values.atPose2) if graph.tangent_dim == 3 else (gtsam.PriorFactorPose3, values.atPose3)
    )
    factors.add(prior(key, pose(key), gtsam.noiseModel.Unit.Create(graph.tangent_dim)))
    return factors, values


def _ramdl(graph: PoseGraph, action: Action, log_det: float, covariance: Callable[[IntArray], FloatArray]) -> Evaluate:
    """ln det I' = ln det I + ln det D + ln det (A_n^T D^-1 A_n), D = 1 + A_o Sigma A_o^T; o old poses touched, n new ones."""
    after = posterior(graph, action)

    def evaluate() -> float:
        form = fisher_rows(after, first_edge=graph.num_edges).joint()
        touched = np.unique(action.edges[action.edges < graph.num_poses])
        columns = np.concatenate([touched, np.arange(graph.num_poses, after.num_poses)])
        num_edges, num_rows, b = form.rows_i.shape
        rows = np.zeros((num_edges, num_rows, len(columns), b))
        for ends, values in zip(form.edges.T, (form.rows_i, form.rows_j), strict=True):
            rows[np.arange(num_edges), :, np.searchsorted(columns, ends)] = values
        dense = rows.reshape(num_edges * num_rows, -1)
        old, new = dense[:, : b * len(touched)], dense[:, b * len(touched) :]
        seen = np.eye(len(dense)) + old @ covariance(touched) @ old.T
        factor = linalg.cholesky(seen, lower=True, overwrite_a=True, check_finite=False)
        whitened = linalg.solve_triangular(factor, new, lower=True, check_finite=False)
        gain = linalg.cholesky(whitened.T @ whitened, lower=True, overwrite_a=True, check_finite=False)
        return log_det + 2 * float(np.log(np.diag(factor)).sum() + np.log(np.diag(gain)).sum())

    return evaluate


# The expected error of the map, over a sample of its poses


def _gtsam_marginals(graph: PoseGraph) -> Callable[[Action], Evaluate]:
    """Linearise and eliminate the whole posterior; the joint covariance of the sample gives E."""
    gtsam, alignment = load_gtsam(), Alignment.of(graph.positions, DEFAULT_SAMPLE_SIZE)
    k, kappa, count = graph.group.position_dim, graph.tangent_dim, alignment.count
    projection = alignment.projection.columns(k).reshape(count * k, count * k)
    positions = (kappa * np.arange(count)[:, None] + np.arange(k)).ravel()

    def ready(action: Action) -> Evaluate:
        factors, values = _held_factors(posterior(graph, action), anchor_of(graph))

        def evaluate() -> float:
            covariance = _joint_covariance(graph, alignment.nodes, gtsam.Marginals(factors, values))
            return math.sqrt(float(np.sum(projection * covariance[np.ix_(positions, positions)])) / count)

        return evaluate

    return ready


def _error(graph: PoseGraph, action: Action) -> float:
    """A factor of the posterior's information matrix, and the diagonal blocks of its inverse at the sample."""
    return expected_errors(graph, action).map_rmse


# t-BSP from scratch, as in the paper


def _spanning_trees(graph: PoseGraph) -> Callable[[Action], Evaluate]:
    """Reduced Laplacian of the posterior, without weights, and its L D L^T factor."""

    def ready(action: Action) -> Evaluate:
        after = posterior(graph, action)

        def evaluate() -> float:
            return _log_det(laplacian_form(after.edges, np.ones(after.num_edges)), after.num_nodes, anchor_of(graph))

        return evaluate

    return ready


def _von_neumann_approx(graph: PoseGraph) -> Callable[[Action], Evaluate]:
    def ready(action: Action) -> Evaluate:
        topology = posterior(graph, action).topology
        return lambda: von_neumann_entropy_approx(topology)

    return ready


def _von_neumann(graph: PoseGraph) -> Callable[[Action], Evaluate]:
    def ready(action: Action) -> Evaluate:
        topology = posterior(graph, action).topology
        return lambda: von_neumann_entropy(topology)

    return ready


def _log_det(form: EdgeForm, num_nodes: int, held: int) -> float:
    """Sum of the logarithms of D in a fresh L D L^T factorisation."""
    pattern = BlockPattern.build(form.edges, np.arange(num_nodes) != held, form.block_size)
    _, diagonal, _ = _QDLDL.Solver(pattern.upper(form), upper=True).factors()
    return float(np.log(diagonal).sum())
