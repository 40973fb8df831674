"""What is minimised: the joint entropy, the entropy of the map that exists now, or the joint entropy per pose.

With n poses after an action, n_0 of them before it, kappa the tangent dimension and I_nn the block of the new poses with the
prior held fixed (docs, the mathematics, section 11):

    joint      J     = (n - 1) kappa / 2 ln(2 pi e) - 1/2 ln det I                                 the paper's
    map        J_map = (n_0 - 1) kappa / 2 ln(2 pi e) - 1/2 [ln det I - ln det I_nn]               free of units
    per_pose   J / (n - 1)

Each is a decreasing function of ln det I with the rest exact, so bounds of ln det I bound all three.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from topobelief.entropy import entropy_of
from topobelief.linalg import LogDet

ObjectiveName = Literal["joint", "map", "per_pose"]


NOTHING_NEW = LogDet(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class PosteriorSize:
    """How many poses an action leaves, and what its new part holds.

    Attributes
    ----------
    num_existing
        n_0, poses before the action.
    num_new
        L, poses that it adds.
    new_log_det
        ln det I_nn; 0 where nothing is new. Only the map objective asks for it.
    """

    num_existing: int
    num_new: int
    tangent_dim: int
    new_log_det: LogDet = NOTHING_NEW


def objective_value(objective: ObjectiveName, log_det: LogDet, size: PosteriorSize) -> LogDet:
    """The objective where ln det I is `log_det`, in nats (per pose for "per_pose"), with its rounding error.

    Raises
    ------
    IllConditionedError
        If double precision cannot give the entropy to 0.1 nats.
    """
    if objective == "map":
        return entropy_of(log_det - size.new_log_det, size.num_existing - 1, size.tangent_dim)
    num_free = size.num_existing + size.num_new - 1
    joint = entropy_of(log_det, num_free, size.tangent_dim)
    if objective == "per_pose" and num_free:
        return (1 / num_free) * joint
    return joint
