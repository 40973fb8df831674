"""The paper's bounds of ln det I (Kitanov and Indelman, arXiv 1903.00927, eqs. 11, 16 to 21), after Khosoussi et al.

With one noise diag(w_p I_k, w_r I_q) on all edges, xi^2 = w_p / w_r and Psi = xi^2 max_i of the squared lengths of the
edges that leave i, in SE(2) and, with q for 1, in SE(3):

    kappa tau  <=  ln det I - (n - 1) ln |Omega|  <=  k tau + q ln det(L_tilde + Psi I).

w_r Psi is the largest lever sum, so w_r (L_tilde + Psi I) is the Laplacian with the weights w_r plus that.
"""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.bounds.options import BoundOptions
from topobelief.errors import InvalidGraphError
from topobelief.forms.protocol import Forms
from topobelief.graph.information import SAME_NOISE, isotropic_weights
from topobelief.linalg.estimate import Estimate, Number
from topobelief.signatures.spanning_trees import weighted_trees
from topobelief.wording import counted


def paper(forms: Forms[Number], options: BoundOptions) -> tuple[Estimate[Number], Estimate[Number]]:
    """(lower, upper) bounds of ln det I; Hadamard's determinant replaces ln det(L_tilde + Psi I) by the sum of ln(d(i) + Psi).

    Raises
    ------
    InvalidGraphError
        Where the noise is not one block-isotropic Omega on all edges, or there are landmarks.
    """
    require_poses_alone(int(np.count_nonzero(forms.landmarks)))
    _require_equal_weights(forms.weights, isotropic=forms.isotropic)
    k, q = forms.split
    determinant = forms.hadamard if options.hadamard else forms.log_det
    shifted = determinant("trees_r", shift=forms.largest_lever_sum())
    return weighted_trees(forms), float(k) * forms.log_det("trees_p") + float(q) * shifted


def require_poses_alone(num_landmarks: int) -> None:
    """Raise where there are landmarks.

    Raises
    ------
    InvalidGraphError
        The paper derives its bounds for relative poses.
    """
    if num_landmarks:
        raise InvalidGraphError(
            f"the paper's bounds expect a graph of poses alone, got {counted(num_landmarks, 'landmark')}, "
            'which have no rotations; use family="fischer"'
        )


def require_equal_noise(information: FloatArray) -> None:
    """Raise where edges do not share one block-isotropic Omega.

    Parameters
    ----------
    information : shape (num_edges, kappa, kappa)

    Raises
    ------
    InvalidGraphError
        Names the edge that differs.
    """
    weights = isotropic_weights(information)
    _require_equal_weights(weights or (information[:, 0, 0], information[:, 0, 0]), isotropic=weights is not None)


def _require_equal_weights(weights: tuple[FloatArray, FloatArray], *, isotropic: bool) -> None:
    if not isotropic:
        raise InvalidGraphError(
            "the paper's bounds expect one block-isotropic information matrix diag(w_p I, w_r I) on all edges, "
            'got one that is not block-isotropic; use family="fischer"'
        )
    for name, w in zip(("position", "rotation"), weights, strict=True):
        different = np.flatnonzero(np.abs(w - w[:1]) > SAME_NOISE * w[:1])
        if different.size:
            raise InvalidGraphError(
                f"the paper's bounds expect the same noise on all edges, got {name} information {w[0]:.6g} at edge 0 and "
                f'{w[different[0]]:.6g} at edge {different[0]}; use family="fischer"'
            )
