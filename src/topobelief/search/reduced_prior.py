"""What a session needs to know of the prior: the joint covariance of the poses that can be seen, in world twists.

A world twist xi moves a pose x to exp(xi) x, about an origin at the pose where the robot is, which is held. In it a
measurement i -> j with noise Omega sees Ad(x_j)^-1 (xi_j - xi_i): its information W_j = Ad(x_j)^-T Omega Ad(x_j)^-1 depends
on the pose where it ends alone (docs, the mathematics, section 13). Closures are stored new -> old, so what one adds is
known before any walk is. An observation of a landmark whose noise has no direction adds A^T A / sigma^2, which depends on the
place of the landmark alone.

For the expected error of the map, K = Sigma_mS Pi Sigma_Sm / |S| too: Sigma_mS the covariance of the seen poses with the
positions of a sample S of the poses, Pi what is left of them after the best rigid alignment (section 12).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.errors import IllConditionedError
from topobelief.forms.prior_factors import PriorFactors
from topobelief.geometry import Group
from topobelief.graph.alignment import DEFAULT_SAMPLE_SIZE, Alignment
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg.elimination_paths import FormFactor


@dataclass(frozen=True, slots=True)
class ReducedPrior:
    """The prior on the poses that can be seen.

    Attributes
    ----------
    tangent_dim
        kappa.
    num_free
        Nodes of the prior that are not held.
    dimension
        Their numbers: kappa for a pose, k for a landmark.
    log_det
        ln det of the prior's information.
    sigma : shape (m kappa, m kappa)
        Covariance of what is seen, poses in world twists and landmarks as positions; rows of the pose that is held are 0, and
        those of the rotations that landmarks have not.
    closures : shape (m, kappa, kappa)
        W of a closure with each of them, or of an observation; its probability included.
    earliest : shape (m,)
        The first new pose that is far enough away along the way to close a loop with it.
    kernel : shape (m kappa, m kappa), or None
        K, square metres.
    mean_square
        Expected mean square error of the map now, square metres; nan without a kernel.
    """

    tangent_dim: int
    num_free: int
    dimension: int
    log_det: float
    sigma: FloatArray
    closures: FloatArray
    earliest: IntArray
    kernel: FloatArray | None
    mean_square: float


def reduced_prior(
    graph: PoseGraph,
    pose: int,
    seen: IntArray,
    information: FloatArray,
    *,
    probability: float,
    min_index_gap: int,
    with_errors: bool,
    observed: FloatArray | None = None,
) -> ReducedPrior:
    """The prior on some poses.

    Parameters
    ----------
    graph
        At its estimate.
    pose
        Which is held.
    seen : shape (m,)
        Poses, ascending, then landmarks.
    information : shape (kappa, kappa)
        Of a closure.
    probability
        By which it is scaled.
    min_index_gap
    with_errors
        Whether the expected error of the map is asked for.
    observed : shape (kappa, kappa), optional
        Expected information of an observation, the same along every direction; needed where landmarks are seen.
    """
    factor = PriorFactors(graph, pose).factor("joint", 0.0)
    if not np.isfinite(factor.log_det.error):
        raise IllConditionedError("covariance of the map", factor.log_det.error)
    alignment = Alignment.of(graph.positions, DEFAULT_SAMPLE_SIZE)
    sample = alignment.nodes if with_errors else np.zeros(0, dtype=np.int64)
    wanted = np.union1d(seen, sample)
    rows = _inverse_root(factor, wanted)  # covariance of the wanted poses is rows rows^T, in (dp, dphi)
    group, kappa, k = graph.group, graph.tangent_dim, graph.group.position_dim
    of_seen, is_landmark = rows[np.searchsorted(wanted, seen)], graph.is_landmark[seen]
    of_seen[is_landmark, k:] = 0.0
    seen_rows = to_twists(group, graph.positions[seen] - graph.positions[pose]) @ of_seen
    flat = seen_rows.reshape(len(seen) * kappa, -1)
    kernel, mean_square = None, np.nan
    if with_errors:
        positions = rows[np.searchsorted(wanted, sample), :k].reshape(len(sample) * k, -1)
        aligned = alignment.columns(k)[:, :k].reshape(len(positions), -1) @ positions
        mean_square = float(np.sum(aligned**2)) / len(sample)
        mixed = flat @ aligned.T
        kernel = mixed @ mixed.T / len(sample)
    adjoint = world_to_body(group, graph.poses[seen], graph.positions[pose])
    closures = probability * adjoint.transpose(0, 2, 1) @ information @ adjoint
    if observed is not None and is_landmark.any():
        moved = _twists_to_moves(group, graph.positions[seen[is_landmark]] - graph.positions[pose])
        closures[is_landmark] = moved.transpose(0, 2, 1) @ observed[:k, :k] @ moved
    rank = np.cumsum(~graph.is_landmark)  # steps of odometry are counted over poses
    apart = rank[pose] - rank[seen]
    later = is_landmark | (seen > pose)
    return ReducedPrior(
        kappa,
        graph.num_nodes - 1,
        kappa * (graph.num_nodes - 1) - group.rotation_dim * graph.num_landmarks,
        factor.log_det.value,
        flat @ flat.T,
        closures,
        np.where(later, 1, np.maximum(min_index_gap - apart, 1)),
        kernel,
        mean_square,
    )


def to_twists(group: Group, offsets: FloatArray) -> FloatArray:
    """From (dp, dphi) of poses at these offsets from the origin to world twists about it, shape (n, kappa, kappa).

    exp(xi) x with xi = (v, phi) moves the position p of x by dp = v + phi x p, so that v = dp + C(p) phi.
    """
    k, kappa = group.position_dim, group.tangent_dim
    result = np.broadcast_to(np.eye(kappa), (len(offsets), kappa, kappa)).copy()
    result[:, :k, k:] = group.lever(offsets)
    return result


def _twists_to_moves(group: Group, offsets: FloatArray) -> FloatArray:
    """A with dp = A xi for points at these offsets from the origin, shape (n, k, kappa): dp = v - C(p) phi.

    An observation of a point from a pose of twist xi_t has the residual R^T A (xi - xi_t), xi = (dp, 0) the point's own.
    """
    k = group.position_dim
    moves = np.zeros((len(offsets), k, group.tangent_dim))
    moves[:, :, :k] = np.eye(k)
    moves[:, :, k:] = -group.lever(offsets)
    return moves


def world_to_body(group: Group, poses: FloatArray, origin: FloatArray) -> FloatArray:
    """Ad(x)^-1 of poses, for world twists about an origin; shape (n, kappa, kappa)."""
    moved = poses.copy()
    moved[:, : group.position_dim] -= origin
    return group.adjoint(group.inverse(moved))


def _inverse_root(factor: FormFactor, nodes: IntArray) -> FloatArray:
    """X with X_s X_t^T = (M^-1)_st for some nodes of a form's matrix M, shape (w, b, c); the held node's is 0."""
    tree, b = factor.tree, factor.block_size
    at = tree.position[nodes]
    places = np.sort(at[at >= 0])
    paths = factor.paths(places)
    ancestors = np.zeros(tree.num_free, dtype=bool)
    chains: list[IntArray] = []
    for place in places.tolist():
        chain: list[int] = []
        node = place
        while node >= 0:
            chain.append(node)
            node = int(tree.parent[node])
        chains.append(np.array(chain[::-1]))
        ancestors[chains[-1]] = True
    column = np.cumsum(ancestors) - 1
    result = np.zeros((len(nodes), b, int(ancestors.sum()), b))
    index = np.searchsorted(places, at)
    for row in np.flatnonzero(at >= 0).tolist():
        path = int(index[row])
        length, start = int(paths.lengths[path]), int(paths.start[path])
        values = paths.values[start : start + b * b * length].reshape(b, length, b)
        result[row][:, column[chains[path]]] = values
    return result.reshape(len(nodes), b, -1)
