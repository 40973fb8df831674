"""The joint entropy of all poses after the action, the paper's objective (Kitanov and Indelman, arXiv 1903.00927, eq. 14)."""

from __future__ import annotations

from topobelief.entropy import entropy_of
from topobelief.forms.protocol import Forms, TreeForms
from topobelief.linalg.estimate import Estimate, Number
from topobelief.objectives.objective import Entropy
from topobelief.signatures.spanning_trees import joint_signature


class JointEntropy(Entropy):
    """J = (n - 1) kappa / 2 ln(2 pi e) - 1/2 ln det I, n the poses after the action, kappa the tangent dimension; nats."""

    quantity = "joint entropy"
    description = "joint entropy of all poses after the action"

    def of(self, log_det: Estimate[Number], forms: Forms[Number]) -> Estimate[Number]:
        return entropy_of(log_det, forms.dimension)

    def trees(self, forms: TreeForms[Number]) -> Estimate[Number]:
        return joint_signature(forms)


OBJECTIVE = JointEntropy()
