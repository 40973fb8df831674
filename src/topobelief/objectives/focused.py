"""The entropy, after the action, of some of the poses that exist now, relative to the anchor."""

from __future__ import annotations

from topobelief.entropy import entropy_of
from topobelief.forms.protocol import Forms, TreeForms
from topobelief.linalg.estimate import LOG_2_PI_E, Estimate, Number
from topobelief.objectives.objective import Entropy
from topobelief.signatures.spanning_trees import weighted_trees


class FocusedEntropy(Entropy):
    """J_F = |F| kappa / 2 ln(2 pi e) - 1/2 [ln det I - ln det I_rest], nats.

    F are the poses in focus but for the anchor, which is held; I_rest is the block of all others with F held too, so that the
    difference is ln det of the Schur complement of I onto F (docs, the mathematics, section 11).

    Parameters
    ----------
    held
        The poses in focus and the anchor, each once.
    """

    quantity = "entropy of the poses in focus"
    description = "entropy of the poses in focus after the action"

    def __init__(self, held: tuple[int, ...]) -> None:
        self._held = held

    def of(self, log_det: Estimate[Number], forms: Forms[Number]) -> Estimate[Number]:
        marginal = log_det - forms.log_det("joint", part=self._held)
        return entropy_of(marginal, self._count(forms), forms.tangent_dim, what=self.quantity)

    def trees(self, forms: TreeForms[Number]) -> Estimate[Number]:
        trees = 0.5 * (weighted_trees(forms) - weighted_trees(forms, self._held))
        return trees.plus(-(forms.tangent_dim / 2 * LOG_2_PI_E) * self._count(forms))

    def _count(self, forms: TreeForms[Number]) -> Number:
        """|F|, for each action."""
        return 0.0 * forms.num_free + (len(self._held) - 1.0)
