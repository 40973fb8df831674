"""The expected error of the map after the action, in metres (docs, the mathematics, section 12).

    E^2 = 1/n tr(Pi C Pi)

C is the covariance, after the action, of the positions of the n poses that exist now; Pi takes out the best rigid alignment.
Where there are many poses, a sample of them stands for all.
"""

from __future__ import annotations

from topobelief.bounds.options import BoundOptions
from topobelief.forms.protocol import Forms, TreeForms
from topobelief.linalg.estimate import Estimate, Number
from topobelief.objectives.objective import Family, Objective
from topobelief.signatures.spanning_trees import map_signature


class ExpectedError(Objective):
    """E, an increasing function of its square, a trace."""

    unit = "m"
    argument = "squared_error"
    cheap_bounds = tight_bounds = "anchored"  # exact, and cheaper than any other family

    def exact(self, forms: Forms[Number]) -> Estimate[Number]:
        return _error(forms.aligned_trace("joint"))

    def bounds(
        self, family: Family[Number], options: BoundOptions, forms: Forms[Number]
    ) -> tuple[Estimate[Number], Estimate[Number]]:
        low, high = family(forms, options)
        return _error(low), _error(high)

    def known(self, forms: Forms[Number]) -> bool:
        return forms.knows_trace("joint")

    def trees(self, forms: TreeForms[Number]) -> Estimate[Number]:
        """Of the poses that exist now."""
        return map_signature(forms)


def _error(square: Estimate[Number]) -> Estimate[Number]:
    return square.root().known_length("expected error of the map")


OBJECTIVE = ExpectedError()
