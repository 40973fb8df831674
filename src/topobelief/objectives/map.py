"""The entropy, after the action, of the poses that exist now (docs, the mathematics, section 11)."""

from __future__ import annotations

from topobelief.entropy import entropy_of
from topobelief.forms.protocol import Forms, TreeForms
from topobelief.linalg.estimate import Estimate, Number
from topobelief.objectives.objective import Entropy
from topobelief.signatures.spanning_trees import map_signature


class MapEntropy(Entropy):
    """J_map = (n_0 - 1) kappa / 2 ln(2 pi e) - 1/2 [ln det I - ln det I_nn], free of units; nats.

    n_0 are the poses before the action, I_nn the block of the new ones with the prior held fixed, which is exact.
    """

    quantity = "map entropy"
    description = "entropy of the poses that exist now, after the action"

    def of(self, log_det: Estimate[Number], forms: Forms[Number]) -> Estimate[Number]:
        gain = log_det - forms.log_det("joint", part="new")
        return entropy_of(gain, forms.dimension - float(forms.tangent_dim) * forms.num_new)

    def trees(self, forms: TreeForms[Number]) -> Estimate[Number]:
        return map_signature(forms)


OBJECTIVE = MapEntropy()
