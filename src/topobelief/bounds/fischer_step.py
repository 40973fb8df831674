"""Fischer's bounds of ln det I with the rotations' part one step closer, for any noise, without the prior's factor.

For any N the change of variables p -> p + N r has determinant one (docs, the mathematics, section 4), so

    ln det I  <=  ln det I_pp + ln det (I_rr + N^T I_pr + I_rp N + N^T I_pp N).

N = -step D^-1 I_pr, D the block diagonal of I_pp, makes it never looser than Fischer's for a step in [0, 1], because
I_pp <= 2 D. The lower bound of ln det I is Fischer's. Evaluated from scratch, action by action.
"""

from __future__ import annotations

from topobelief.bounds.fischer import least, positions
from topobelief.bounds.options import BoundOptions
from topobelief.forms.protocol import Forms
from topobelief.linalg.estimate import Estimate, Number

_STEP = 0.8  # the tightest of a few on 500-pose graphs
_DIAGONAL_STEP = 0.5  # minimises the diagonal blocks


def fischer_step(forms: Forms[Number], options: BoundOptions) -> tuple[Estimate[Number], Estimate[Number]]:
    """(lower, upper) bounds of ln det I; Hadamard's determinant replaces the second one by the sum over diagonal blocks."""
    step = _DIAGONAL_STEP if options.hadamard else _STEP
    return least(forms), positions(forms) + forms.sheared_rotations(step, hadamard=options.hadamard)
