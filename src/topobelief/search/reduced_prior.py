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

import math

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.errors import IllConditionedError
from topobelief.forms.prior_factors import PriorFactors, form_of
from topobelief.geometry import Group
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg.elimination_paths import FormFactor
from topobelief.linalg.elimination_tree import EliminationTree
from topobelief.linalg.selected_inverse import inverse_diagonal
from topobelief.linalg.solutions import solutions


class ReducedPrior:
    """The prior on the poses that can be seen.

    Covariances with a pose are computed when they are first asked for, and kept: a plan touches few of many poses.

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
    closures : shape (m, kappa, kappa)
        W of a closure with each of them, or of an observation; its probability included.
    earliest : shape (m,)
        The first new pose that is far enough away along the way to close a loop with it.
    variances : shape (m, kappa, kappa)
        Covariance of each of them in world twists; 0 for the pose that is held.
    mean_square
        Expected mean square error of the map now, square metres; nan where it is not asked for.
    kernel_variances : shape (m, kappa, kappa)
        Diagonal blocks of K; nothing where errors are not asked for.
    multiplicity
        By which half a log-determinant is multiplied for an entropy (see `topological_prior`).
    """

    multiplicity = 1

    def __init__(
        self,
        graph: PoseGraph,
        pose: int,
        seen: IntArray,
        information: FloatArray,
        *,
        probability: float,
        min_index_gap: int,
        with_errors: bool,
        observed: FloatArray | None = None,
        factors: PriorFactors | None = None,
    ) -> None:
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
        factors
            Of the graph, which hold the same pose and are used where they are precise. Default: new ones.
        """
        group, kappa = graph.group, graph.tangent_dim
        factors = PriorFactors(graph, pose) if factors is None else factors
        factor = factors.factor("joint", 0.0)
        holds_pose = factor.tree.held == pose
        if not holds_pose:
            form = form_of("joint", factors)
            tree = EliminationTree.build(graph.edges, graph.num_nodes, pose)
            factor = FormFactor.of(tree, form).or_with_strong_rows_last(form)
        if not np.isfinite(factor.log_det.error):
            raise IllConditionedError("covariance of the map", factor.log_det.error)
        self._factor, self._seen = factor, seen
        is_landmark = graph.is_landmark[seen]
        self._twists = to_twists(group, graph.positions[seen] - graph.positions[pose])
        self._twists[is_landmark, :, group.position_dim :] = 0.0  # it has no rotation
        self.tangent_dim, self.num_free, self.log_det = kappa, graph.num_nodes - 1, factor.log_det.value
        self.dimension = kappa * self.num_free - group.rotation_dim * graph.num_landmarks
        adjoint = world_to_body(group, graph.poses[seen], graph.positions[pose])
        self.closures = probability * adjoint.transpose(0, 2, 1) @ information @ adjoint
        if observed is not None and is_landmark.any():
            moves = _twists_to_moves(group, graph.positions[seen[is_landmark]] - graph.positions[pose])
            k = group.position_dim
            self.closures[is_landmark] = moves.transpose(0, 2, 1) @ observed[:k, :k] @ moves
        rank: IntArray = np.cumsum(~graph.is_landmark, dtype=np.int64)  # steps of odometry are counted over poses
        self.earliest = np.where(is_landmark, 1, earliest_numbers(rank[seen], int(rank[pose]), min_index_gap))
        self.variances = self._twists @ inverse_diagonal(factor, seen) @ self._twists.transpose(0, 2, 1)
        self.mean_square, self._effects = np.nan, np.zeros((len(seen) * kappa, 0))
        if with_errors:
            alignment = factors.alignment
            solved = (
                factors.solutions("joint")
                if holds_pose
                else solutions(factor, alignment.nodes, alignment.projection.columns(kappa))
            )
            self.mean_square = float(solved.trace.value) / len(alignment.nodes)
            effects = self._twists @ solved.values[seen] / math.sqrt(len(alignment.nodes))
            self._effects = effects.reshape(len(seen) * kappa, -1)
        by_pose = self._effects.reshape(len(seen), kappa, -1)
        self.kernel_variances = by_pose @ by_pose.transpose(0, 2, 1)
        self._place = np.full(len(seen), -1)  # of the rows of each seen pose in the tables
        self._sigma = self._kernel = np.zeros((0, len(seen) * kappa))

    def sigma(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """Covariance between some seen poses and others, in world twists, shape (rows kappa, columns kappa)."""
        return self._part(self._tables(rows)[0], rows, columns)

    def kernel(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """K likewise, square metres."""
        return self._part(self._tables(rows)[1], rows, columns)

    def _part(self, table: FloatArray, rows: IntArray, columns: IntArray) -> FloatArray:
        return table[np.ix_(in_blocks(self._place[rows], self.tangent_dim), in_blocks(columns, self.tangent_dim))]

    def _tables(self, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        """Both tables, with the rows of some poses."""
        new = rows[self._place[rows] < 0]
        if len(new):
            kappa, count = self.tangent_dim, len(new) * self.tangent_dim
            unit = np.eye(count).reshape(len(new), kappa, count)
            solved = self._twists @ solutions(self._factor, self._seen[new], unit).values[self._seen]
            turned = self._twists[new] @ solved.reshape(-1, len(new), kappa).transpose(1, 2, 0)
            self._sigma = np.concatenate([self._sigma, turned.reshape(count, -1)])
            self._kernel = np.concatenate([self._kernel, self._effects[in_blocks(new, kappa)] @ self._effects.T])
            self._place[new] = np.arange(len(self._sigma) // kappa - len(new), len(self._sigma) // kappa)
        return self._sigma, self._kernel


def in_blocks(poses: IntArray, kappa: int) -> IntArray:
    """Indices of the kappa variables of each of some poses."""
    return (poses[:, None] * kappa + np.arange(kappa)).ravel()


def earliest_numbers(seen: IntArray, pose: int, min_index_gap: int) -> IntArray:
    """The first new pose that is far enough away along the way to close a loop with each seen one."""
    return np.where(seen > pose, 1, np.maximum(min_index_gap - (pose - seen), 1))


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
