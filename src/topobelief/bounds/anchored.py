"""Bounds of ln det I anchored in the prior, whose log-determinant is known: the increment alone is bounded.

With I_b the prior extended by the trees of edges by which an action's new poses are attached, exact, and R = U H I_b^-1 H^T U^T
of its closures, whose whitened rows U H have positions first (docs, the mathematics, section 8),

    ln det I_b + ln det (I + R_pp|r) + ln det (I + R_rr)  <=  ln det I  <=  ln det I_b + ln det (I + R_pp) + ln det (I + R_rr).

I + R is the covariance of what the closures will measure. Right: Fischer's inequality. Left: its Schur complement, the
covariance of the position rows given the rotation rows, is at least their covariance given all rotations; then the position
rows are those of I_pp, whose own increment by the closures is ln det (I + R_pp|r). Without closures all three are equal.

From scratch the exact value costs less than these bounds, so that both are the exact value.
"""

from __future__ import annotations

from topobelief.bounds.options import BoundOptions
from topobelief.forms.protocol import ClosureForms, Forms
from topobelief.linalg.estimate import Estimate, Number


def anchored(forms: Forms[Number], options: BoundOptions) -> tuple[Estimate[Number], Estimate[Number]]:
    """(lower, upper) bounds of ln det I."""
    increments = forms.increments
    if increments is None:
        return forms.log_det("joint"), forms.log_det("joint")
    upper = increments.base() + increments.closures("joint", "positions") + increments.closures("joint", "rotations")
    return least(forms, increments), upper


def least(forms: Forms[Number], increments: ClosureForms[Number]) -> Estimate[Number]:
    """ln det I_b + ln det (I + R_pp|r) + ln det (I + R_rr), the lower bound of ln det I."""
    given_rotations = (
        float(forms.split[0]) * increments.closures("trees_p") if forms.isotropic else increments.closures("positions")
    )
    return increments.base() + given_rotations + increments.closures("joint", "rotations")
