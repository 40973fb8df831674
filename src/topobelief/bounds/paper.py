"""The paper's bounds of ln det I (Kitanov and Indelman, arXiv 1903.00927, eqs. 11, 16 to 21), after Khosoussi et al.

With one noise diag(w_p I_k, w_r I_q) on all edges, xi^2 = w_p / w_r and Psi = xi^2 max_i of the squared lengths of the
edges that leave i, in SE(2) and, with q for 1, in SE(3):

    kappa tau  <=  ln det I - (n - 1) ln |Omega|  <=  k tau + q ln det(L_tilde + Psi I).

L_tilde and L_tilde + Psi I share their sparsity: one ordering and one symbolic factor serve both.
"""

from __future__ import annotations

import math

import numpy as np

from topobelief.errors import InvalidGraphError
from topobelief.graph.fisher import FisherRows
from topobelief.graph.information import SAME_NOISE
from topobelief.linalg import LogDet, LogDetSolver, laplacian_form


def paper_bounds(rows: FisherRows, solver: LogDetSolver, *, hadamard: bool) -> tuple[LogDet, LogDet]:
    """(lower, upper) bounds of ln det I.

    Parameters
    ----------
    rows
        The graph's whitened rows.
    solver
        Holds the anchor, on which the upper bound depends.
    hadamard
        Replace ln det(L_tilde + Psi I) by the sum of ln(d(i) + Psi), d the diagonal of L_tilde.

    Raises
    ------
    InvalidGraphError
        Where the noise is not one block-isotropic Omega on all edges.
    """
    w_p, w_r = require_equal_noise(rows)
    k, q = rows.group.position_dim, rows.group.rotation_dim
    num_edges = len(rows.edges)
    laplacian = laplacian_form(rows.edges, np.ones(num_edges))
    tau = solver.log_det(laplacian)
    ln_w_p, ln_w_r = solver.num_free * math.log(w_p), solver.num_free * math.log(w_r)
    lower = (float(k + q) * tau).plus(k * ln_w_p + q * ln_w_r)
    shifted = solver.hadamard(laplacian, shift=psi(rows)) if hadamard else solver.log_det(laplacian, shift=psi(rows))
    return lower, (float(k) * tau + float(q) * shifted).plus(k * ln_w_p + q * ln_w_r)


def psi(rows: FisherRows) -> float:
    """Psi = xi^2 max over i of the sum of |x_i - x_j|^2 over the edges i -> j."""
    w_p, w_r = require_equal_noise(rows)
    if len(rows.edges) == 0:
        return 0.0
    return w_p / w_r * float(np.max(np.bincount(rows.edges[:, 0], weights=rows.squared_lengths())))


def require_equal_noise(rows: FisherRows) -> tuple[float, float]:
    """(w_p, w_r) of the one block-isotropic Omega that all edges share.

    Raises
    ------
    InvalidGraphError
        Names the edge that differs.
    """
    if len(rows.edges) == 0:
        return 1.0, 1.0
    if rows.weights is None:
        raise InvalidGraphError(
            "the paper's bounds expect one block-isotropic information matrix diag(w_p I, w_r I) on all edges, "
            'got one that is not block-isotropic; use family="fischer"'
        )
    w_p, w_r = rows.weights
    for name, w in (("position", w_p), ("rotation", w_r)):
        different = np.flatnonzero(np.abs(w - w[0]) > SAME_NOISE * w[0])
        if different.size:
            raise InvalidGraphError(
                f"the paper's bounds expect the same noise on all edges, got {name} information {w[0]:.6g} at edge 0 and "
                f'{w[different[0]]:.6g} at edge {different[0]}; use family="fischer"'
            )
    return float(w_p[0]), float(w_r[0])
