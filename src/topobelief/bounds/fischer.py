"""Bounds of ln det I by Fischer's inequality, for any noise, in SE(2) and SE(3).

With the tangent split into positions p and rotations r (docs, the mathematics, section 4),

    ln det I_pp + ln det L_r|p  <=  ln det I  <=  ln det I_pp + ln det I_rr.

Right: Fischer's inequality. Left: I's Schur complement of the positions is at least the Laplacian of the rotations with
weights O_r|p, because the minimum over positions of a sum is at least the sum of the minima. With equal noise in SE(2) they
are 3 tau and 2 tau + ln det(L_tilde + xi^2 D), plus (n - 1) ln |Omega|, D_ii the squared lengths of the edges that leave i.
"""

from __future__ import annotations

from topobelief.bounds.options import BoundOptions
from topobelief.forms.protocol import Forms
from topobelief.linalg.estimate import Estimate, Number
from topobelief.signatures.spanning_trees import weighted_trees


def fischer(forms: Forms[Number], options: BoundOptions) -> tuple[Estimate[Number], Estimate[Number]]:
    """(lower, upper) bounds of ln det I; Hadamard's determinant replaces ln det I_rr by the sum over its diagonal blocks."""
    rotations = forms.hadamard("rotations") if options.hadamard else forms.log_det("rotations")
    return least(forms), positions(forms) + rotations


def positions(forms: Forms[Number]) -> Estimate[Number]:
    """ln det I_pp."""
    return float(forms.split[0]) * forms.log_det("trees_p") if forms.isotropic else forms.log_det("positions")


def least(forms: Forms[Number]) -> Estimate[Number]:
    """ln det I_pp + ln det L_r|p, the lower bound of ln det I."""
    if forms.isotropic:
        return weighted_trees(forms)
    return forms.log_det("positions") + forms.log_det("rotations_given_positions")
