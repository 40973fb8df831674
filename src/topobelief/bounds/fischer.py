"""Bounds of ln det I by Fischer's inequality, for any noise, in SE(2) and SE(3).

With the tangent split into positions p and rotations r (docs, the mathematics, section 4),

    ln det I_pp + ln det L_r|p  <=  ln det I  <=  ln det I_pp + ln det I_rr.

Right: Fischer's inequality. Left: I's Schur complement of the positions is at least the Laplacian of the rotations with
weights O_r|p, because the minimum over positions of a sum is at least the sum of the minima. With equal noise in SE(2) they
are 3 tau and 2 tau + ln det(L_tilde + xi^2 D), plus (n - 1) ln |Omega|, D_ii the squared lengths of the edges that leave i.
"""

from __future__ import annotations

import math

from topobelief.graph.fisher import FisherRows
from topobelief.linalg import LogDet, LogDetSolver


def fischer_bounds(rows: FisherRows, solver: LogDetSolver, *, hadamard: bool) -> tuple[LogDet, LogDet]:
    """(lower, upper) bounds of ln det I.

    Parameters
    ----------
    rows
        The graph's whitened rows.
    solver
        Holds the anchor; matrices of one block size share its ordering and symbolic factor. The upper bound depends on
        the anchor.
    hadamard
        Replace ln det I_rr by the sum over its diagonal blocks: looser, and one factorisation less.
    """
    positions = solver.log_det(rows.positions())
    ratio = rows.weight_ratio()
    if ratio is None:
        lower = positions + solver.log_det(rows.rotations_given_positions())
    else:  # L_r|p is a multiple of I_pp's Laplacian
        k, q = rows.group.position_dim, rows.group.rotation_dim
        lower = ((k + q) / k * positions).plus(q * solver.num_free * math.log(ratio))
    rotations = solver.hadamard(rows.rotations()) if hadamard else solver.log_det(rows.rotations())
    return lower, positions + rotations
