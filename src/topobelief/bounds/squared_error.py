"""Bounds of the squared expected error of the map, n E^2 = tr(Pi C Pi), for any noise, in SE(2) and SE(3).

With positions p, rotations r and N = I_pp^-1 I_pr, the law of total variance splits the covariance of positions into what is
left when rotations are known and what rotations add, K = I_rr - I_rp I_pp^-1 I_pr (docs, the mathematics, section 12):

    C = I_pp^-1 + N K^-1 N^T,        L_r|p <= K <= I_rr,

    tr Pi (I_pp^-1 + N I_rr^-1 N^T) Pi  <=  n E^2  <=  tr Pi (I_pp^-1 + N L_r|p^-1 N^T) Pi.

L_r|p and I_rr are those of Fischer's bounds of ln det I. By increments, and on large graphs with compiled kernels, E itself
costs less than these bounds, so both are it.
"""

from __future__ import annotations

from topobelief.bounds.options import BoundOptions
from topobelief.forms.protocol import Forms
from topobelief.linalg.estimate import Estimate, Number


def fischer(forms: Forms[Number], options: BoundOptions) -> tuple[Estimate[Number], Estimate[Number]]:
    """(lower, upper) bounds of E^2, m^2."""
    if forms.has_fast_traces:
        return exact(forms, options)
    known_rotations = forms.aligned_trace("positions")
    lower = known_rotations + forms.coupled_trace("rotations")
    return lower, known_rotations + forms.coupled_trace("rotations_given_positions")


def exact(forms: Forms[Number], options: BoundOptions) -> tuple[Estimate[Number], Estimate[Number]]:
    """E^2 itself, twice."""
    square = forms.aligned_trace("joint")
    return square, square
