"""The joint entropy over the number of free poses: the order of candidates does not depend on units."""

from __future__ import annotations

from topobelief.forms.protocol import Forms, TreeForms
from topobelief.linalg.estimate import Estimate, Number
from topobelief.objectives import joint
from topobelief.objectives.objective import Entropy


class EntropyPerPose(Entropy):
    """J / (n - 1), n the poses after the action; nats per pose."""

    def of(self, log_det: Estimate[Number], forms: Forms[Number]) -> Estimate[Number]:
        return _per_pose(joint.OBJECTIVE.of(log_det, forms), forms)

    def trees(self, forms: TreeForms[Number]) -> Estimate[Number]:
        return _per_pose(joint.OBJECTIVE.trees(forms), forms)


def _per_pose(estimate: Estimate[Number], forms: TreeForms[Number]) -> Estimate[Number]:
    """A single pose, which is held, leaves nothing free and an entropy of 0."""
    free = forms.num_free
    return (1.0 / (free + (free == 0.0))) * estimate


OBJECTIVE = EntropyPerPose()
