"""The Fisher information of a pose graph as whitened rows, whole and split into positions and rotations.

At the estimate, with each measurement taken as the one that the estimate predicts, the error of the edge i -> j is, in the
world frame and for perturbations (dp, dphi) of positions and of rotations (both in the world frame),

    e_p = dp_j - dp_i + C(d) dphi_i,   e_r = dphi_j - dphi_i,   d = p_j - p_i,   C(d) dphi = d x dphi,

and its information is Omega turned from the frame of the measured pose (that of j) into the world. The change of
variables from body-frame tangents has determinant 1, so log-determinants are those of H^T Omega H in any of them.
Omega = U^T U with U upper triangular, positions first: U = [[U_pp, U_pr], [0, U_rr]], so the rows of U_rr carry
O_r|p = O_rr - O_rp O_pp^-1 O_pr (docs, the mathematics, section 4). An observation of a landmark has the first k of these rows
alone, turned from the frame of the pose that sees (`observations`); a landmark's missing rotation is padded (`variable_kinds`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.geometry import Group
from topobelief.graph.information import SAME_NOISE, cholesky_roots, isotropic_weights, shared_information, tangent_split
from topobelief.graph.observations import roots_of_positions
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
    observing: BoolArray | None = None  # (m,): which edges lead to landmarks; None: none does
    pads: BoolArray | None = None  # (m,): which of these carry the pad of their landmark

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
        return self._padded(EdgeForm(self.edges, rows_i, root, magnitude_i, magnitude_j, self.root_errors, gauge_free=True))

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
        return self._padded(EdgeForm(self.edges, rows_i, rows_j, magnitude_i, magnitude_j, self.root_errors))

    def rotations_given_positions(self) -> EdgeForm:
        """L_r|p: the Laplacian with weights O_r|p; scalar, w_r L, where the noise allows."""
        k, q = self.group.position_dim, self.group.rotation_dim
        if self.weights is not None:
            return self._padded(laplacian_form(self.edges, self.weights[1], multiplicity=q))
        root = self.root[:, k:, k:]
        magnitude = np.repeat(self.row_scale[:, 1:], q, 1)
        return self._padded(EdgeForm(self.edges, -root, root, magnitude, magnitude, self.root_errors, gauge_free=True))

    def trees(self, weights: FloatArray, *, rotations: bool) -> EdgeForm:
        """The Laplacian with these weights of positions or rotations."""
        form = laplacian_form(self.edges, weights)
        return self._padded(form) if rotations else form

    def _padded(self, form: EdgeForm) -> EdgeForm:
        """A form of rotations, or of all variables, with unit rows in place of the rotations that landmarks have not."""
        if self.observing is None:
            return form
        padding = min(form.block_size, self.group.rotation_dim)
        return form.padded(self.observing, self.pads, padding)

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
            *(_joined_marks(self, more) if self.observing is not None or more.observing is not None else ()),
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


def _joined_marks(first: FisherRows, second: FisherRows) -> list[BoolArray]:
    """`observing` and `pads` of both."""
    none = [np.zeros(len(rows.edges), dtype=np.bool_) for rows in (first, second)]
    return [
        np.concatenate([a if x is None else x for x, a in zip(pair, none, strict=True)])
        for pair in ((first.observing, second.observing), (first.pads, second.pads))
    ]


def fisher_rows(graph: PoseGraph, *, first_edge: int = 0) -> FisherRows:
    """Rows of a graph's edges at its poses, from `first_edge` on."""
    marks = (graph.is_landmark, graph.carries_pad[first_edge:]) if graph.num_landmarks else None
    return rows_between(graph.group, graph.poses, graph.edges[first_edge:], graph.information[first_edge:], marks)


@_may_overflow
def rows_between(
    group: Group,
    poses: FloatArray,
    edges: IntArray,
    information: FloatArray,
    marks: tuple[BoolArray, BoolArray] | None = None,
) -> FisherRows:
    """Rows of edges between poses, or from poses to landmarks.

    Parameters
    ----------
    group
    poses : shape (n, pose_size)
    edges : shape (m, 2)
    information : shape (m, kappa, kappa)
    marks : (shape (n,), shape (m,)), optional
        Which nodes are landmarks, and which edges carry the pad of theirs (`variable_kinds`). Default: none.
    """
    k, kappa = group.position_dim, group.tangent_dim
    i, j = edges.T
    offset = group.position(poses[j]) - group.position(poses[i])
    observing = None if marks is None else marks[0][j]
    weights = isotropic_weights(information)
    diagonal = np.diagonal(information, axis1=1, axis2=2)
    if weights is not None:
        root = np.zeros(information.shape)
        axes = np.arange(kappa)
        root[:, axes, axes] = np.sqrt(diagonal)
        root_errors = np.zeros(len(edges))
    else:
        upper, root_errors = _roots(information, observing)
        rotation = group.rotation_matrix(poses[j if observing is None else np.where(observing, i, j)])
        turn = np.broadcast_to(np.eye(kappa), information.shape).copy()
        turn[:, :k, :k] = rotation.transpose(0, 2, 1)
        if group.rotation_dim == k:
            turn[:, k:, k:] = turn[:, :k, :k]
        root = upper @ turn
    traces = np.stack([diagonal[:, :k].sum(axis=1), diagonal[:, k:].sum(axis=1)], axis=1)
    rows = FisherRows(group, edges, root, group.lever(offset), np.sqrt(traces), root_errors, weights)
    return rows if marks is None else replace(rows, observing=observing, pads=marks[1])


def _roots(information: FloatArray, observing: BoolArray | None) -> tuple[FloatArray, FloatArray]:
    """U with U^T U = Omega, upper triangular but for observations of fewer than k numbers, and its `root_errors`."""
    if observing is None or not observing.any():
        return cholesky_roots(information), _root_errors(information)
    roots, errors = np.zeros(information.shape), np.zeros(len(information))
    between = ~observing
    if between.any():
        roots[between], errors[between] = _roots(information[between], None)
    k = tangent_split(information.shape[-1])[0]
    blocks = information[observing, :k, :k]
    roots[observing, :k, :k], partial = roots_of_positions(blocks)
    errors[observing] = np.where(
        partial, UNIT_ROUNDOFF * k, _root_error_terms(np.where(partial[:, None, None], np.eye(k), blocks))
    )
    return roots, errors


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
