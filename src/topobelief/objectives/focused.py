"""The entropy, after the action, of some of the poses and landmarks that exist now, relative to the anchor."""

from __future__ import annotations

from topobelief.entropy import entropy_of
from topobelief.forms.protocol import Forms, TreeForms
from topobelief.linalg.estimate import LOG_2_PI_E, Estimate, Number
from topobelief.objectives.objective import Entropy
from topobelief.signatures.spanning_trees import weighted_trees


class FocusedEntropy(Entropy):
    """J_F = d / 2 ln(2 pi e) - 1/2 [ln det I - ln det I_rest], nats.

    F are the poses and landmarks in focus but for the anchor, which is held; d their numbers, kappa for a pose, k for a
    landmark; I_rest is the block of all others with F held too, so that the difference is ln det of the Schur complement of I
    onto F (docs, the mathematics, section 11).

    Parameters
    ----------
    held
        The poses and landmarks in focus and the anchor, each once.
    """

    quantity = "entropy of the poses in focus"
    description = "entropy of the poses in focus after the action"

    def __init__(self, held: tuple[int, ...]) -> None:
        self._held = held

    def of(self, log_det: Estimate[Number], forms: Forms[Number]) -> Estimate[Number]:
        marginal = log_det - forms.log_det("joint", part=self._held)
        return entropy_of(marginal, self._dimension(forms), what=self.quantity)

    def trees(self, forms: TreeForms[Number]) -> Estimate[Number]:
        trees = 0.5 * (weighted_trees(forms) - weighted_trees(forms, self._held))
        return trees.plus(-(LOG_2_PI_E / 2) * self._dimension(forms))

    def _dimension(self, forms: TreeForms[Number]) -> Number:
        """Numbers in focus, for each action."""
        return 0.0 * forms.num_free + float(forms.existing_dimension(self._held))
