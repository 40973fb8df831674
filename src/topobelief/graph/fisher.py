"""The Fisher information of a pose graph as whitened rows, whole and split into positions and rotations.

At the estimate, with each measurement taken as the one that the estimate predicts, the error of the edge i -> j is, in the
world frame and for perturbations (dp, dphi) of positions and of rotations (both in the world frame),

    e_p = dp_j - dp_i + C(d) dphi_i,   e_r = dphi_j - dphi_i,   d = p_j - p_i,   C(d) dphi = d x dphi,

and its information is Omega turned from the frame of the measured pose (that of j) into the world. The change of
variables from body-frame tangents has determinant 1, so log-determinants are those of H^T Omega H in any of them.
Omega = U^T U with U upper triangular, positions first: U = [[U_pp, U_pr], [0, U_rr]], so the rows of U_rr carry
O_r|p = O_rr - O_rp O_pp^-1 O_pr (docs, the mathematics, section 4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.geometry import Group
from topobelief.graph.information import SAME_NOISE, isotropic_weights, shared_information
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg.edge_form import EdgeForm, laplacian_form
from topobelief.linalg.estimate import UNIT_ROUNDOFF

_may_overflow = np.errstate(over="ignore", invalid="ignore")  # log-determinants of what is not finite are refused


@dataclass(frozen=True, slots=True)
class FisherRows:
    """Whitened rows of edges, from which the four matrices of the theory are made."""

    group: Group
    edges: IntArray
    root: FloatArray  # (m, kappa, kappa): U turned into the world frame, Omega_world = root^T root
    lever: FloatArray  # (m, k, q): C(d)
    row_scale: FloatArray  # (m, 2): root of the traces of O_pp and O_rr, which bound every entry of Omega_world
    root_errors: FloatArray  # (m,): what rounding in the root adds to the error of a log-determinant, nats
    weights: tuple[FloatArray, FloatArray] | None  # (w_p, w_r) where all noise is block-isotropic

    @_may_overflow
    def joint(self) -> EdgeForm:
        """I: kappa variables a pose."""
        k, root = self.group.position_dim, self.root
        rows_i = -root
        rows_i[:, :, k:] += root[:, :, :k] @ self.lever
        scale_p, scale_r = self.row_scale[:, :1], self.row_scale[:, 1:]
        magnitude_j = np.concatenate([np.repeat(scale_p, k, 1), np.repeat(scale_r, self.group.rotation_dim, 1)], axis=1)
        magnitude_i = magnitude_j.copy()
        magnitude_i[:, k:] += scale_p * np.sqrt(self.squared_lengths())[:, None]
        return EdgeForm(self.edges, rows_i, root, magnitude_i, magnitude_j, self.root_errors, gauge_free=True)

    def positions(self) -> EdgeForm:
        """I_pp: the positions with all rotations held; a scalar Laplacian w_p L where the noise allows."""
        k = self.group.position_dim
        if self.weights is not None:
            return laplacian_form(self.edges, self.weights[0], multiplicity=k)
        root = self.root[:, :k, :k]
        magnitude = np.repeat(self.row_scale[:, :1], k, 1)
        return EdgeForm(self.edges, -root, root, magnitude, magnitude, self.root_errors, gauge_free=True)

    @_may_overflow
    def rotations(self) -> EdgeForm:
        """I_rr: the rotations with all positions held; with equal noise w_r (L + xi^2 D)."""
        k, q = self.group.position_dim, self.group.rotation_dim
        rows_j = self.root[:, :, k:]
        rows_i = -rows_j
        if self.weights is not None:  # the root is diagonal
            rows_i[:, :k] = np.sqrt(self.weights[0])[:, None, None] * self.lever
        else:
            rows_i += self.root[:, :, :k] @ self.lever
        magnitude_j = np.repeat(self.row_scale[:, 1:], q, 1)
        magnitude_i = magnitude_j + (self.row_scale[:, 0] * np.sqrt(self.squared_lengths()))[:, None]
        return EdgeForm(self.edges, rows_i, rows_j, magnitude_i, magnitude_j, self.root_errors)

    def rotations_given_positions(self) -> EdgeForm:
        """L_r|p: the Laplacian with weights O_r|p; scalar, w_r L, where the noise allows."""
        k, q = self.group.position_dim, self.group.rotation_dim
        if self.weights is not None:
            return laplacian_form(self.edges, self.weights[1], multiplicity=q)
        root = self.root[:, k:, k:]
        magnitude = np.repeat(self.row_scale[:, 1:], q, 1)
        return EdgeForm(self.edges, -root, root, magnitude, magnitude, self.root_errors, gauge_free=True)

    def joined(self, more: FisherRows) -> FisherRows:
        """These edges and then the others', of the same nodes."""
        weights = None
        if self.weights is not None and more.weights is not None:
            weights = (
                np.concatenate([self.weights[0], more.weights[0]]),
                np.concatenate([self.weights[1], more.weights[1]]),
            )
        return FisherRows(
            self.group,
            np.concatenate([self.edges, more.edges]),
            np.concatenate([self.root, more.root]),
            np.concatenate([self.lever, more.lever]),
            np.concatenate([self.row_scale, more.row_scale]),
            np.concatenate([self.root_errors, more.root_errors]),
            weights,
        )

    def weight_ratio(self) -> float | None:
        """w_r / w_p where the noise is block-isotropic and the ratio is the same on all edges, else None."""
        if self.weights is None or len(self.edges) == 0:
            return None
        ratios = self.weights[1] / self.weights[0]
        return float(ratios[0]) if np.ptp(ratios) <= SAME_NOISE * ratios[0] else None

    @_may_overflow
    def squared_lengths(self) -> FloatArray:
        """|d|^2, shape (m,): |C(d)|^2 counts it once in SE(2) and twice in SE(3)."""
        return np.sum(self.lever**2, axis=(1, 2)) / max(1, self.group.rotation_dim - 1)


@_may_overflow
def fisher_rows(graph: PoseGraph, *, first_edge: int = 0) -> FisherRows:
    """Rows of a graph's edges at its poses, from `first_edge` on."""
    group, information, edges = graph.group, graph.information[first_edge:], graph.edges[first_edge:]
    k, kappa = group.position_dim, group.tangent_dim
    i, j = edges.T
    offset = graph.positions[j] - graph.positions[i]
    weights = isotropic_weights(information)
    diagonal = np.diagonal(information, axis1=1, axis2=2)
    if weights is not None:
        root = np.zeros(information.shape)
        axes = np.arange(kappa)
        root[:, axes, axes] = np.sqrt(diagonal)
        root_errors = np.zeros(len(edges))
    else:
        upper = np.linalg.cholesky(information).transpose(0, 2, 1)
        rotation = graph.group.rotation_matrix(graph.poses[j])
        turn = np.broadcast_to(np.eye(kappa), information.shape).copy()
        turn[:, :k, :k] = rotation.transpose(0, 2, 1)
        if group.rotation_dim == k:
            turn[:, k:, k:] = turn[:, :k, :k]
        root = upper @ turn
        root_errors = _root_errors(information)
    traces = np.stack([diagonal[:, :k].sum(axis=1), diagonal[:, k:].sum(axis=1)], axis=1)
    return FisherRows(group, edges, root, group.lever(offset), np.sqrt(traces), root_errors, weights)


def _root_errors(information: FloatArray) -> FloatArray:
    """What rounding in the root of each edge's noise adds to the error of a log-determinant, nats, shape (m,).

    A root is that of Omega + E with |E_ij| <= kappa u sqrt(Omega_ii Omega_jj), which moves ln |Omega| by tr(Omega^-1 E).
    """
    if shared_information(information) is not None:
        return np.repeat(_root_error_terms(information[:1]), len(information))
    return _root_error_terms(information)


def _root_error_terms(information: FloatArray) -> FloatArray:
    scale = 1 / np.sqrt(np.diagonal(information, axis1=1, axis2=2))
    inverse = np.linalg.inv(information * scale[:, :, None] * scale[:, None, :])
    deviations = np.sqrt(np.abs(np.diagonal(inverse, axis1=1, axis2=2)))
    return UNIT_ROUNDOFF * information.shape[-1] * deviations.sum(axis=1) ** 2
