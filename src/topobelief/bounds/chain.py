"""Bounds of ln det I by the chain rule of entropy along the path, anchored in the prior.

z_1 … z_c are the whitened closures in the order of the path and S = I + R their predicted covariance (see `anchored`). With a
window of m closures (docs, the mathematics, section 8),

    ln det S  =  sum over l of ln det cov(z_l | z_1 … z_(l-1))  <=  sum over l of ln det cov(z_l | z_(l-m) … z_(l-1)),

because a covariance given fewer closures is at least as large. Exact for m >= c. Only blocks of I_b^-1 between closures of one
window are needed; the lower bound is that of `anchored`, which needs the rotations of all.
"""

from __future__ import annotations

from topobelief.bounds import anchored
from topobelief.bounds.options import BoundOptions
from topobelief.forms.protocol import Forms
from topobelief.linalg.estimate import Estimate, Number


def chain(forms: Forms[Number], options: BoundOptions) -> tuple[Estimate[Number], Estimate[Number]]:
    """(lower, upper) bounds of ln det I; from scratch both are the exact value, which costs less."""
    increments = forms.increments
    if increments is None:
        return forms.log_det("joint"), forms.log_det("joint")
    chained = increments.chained_closures(options.window)  # first: it has the rotation rows too
    base = increments.base()
    return anchored.least(forms, increments), base + chained
