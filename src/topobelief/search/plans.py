"""What a walk, or a mixture of walks, adds to the information of the prior (docs, the mathematics, section 13).

The new pose number t = 1 … T is one variable wherever a walk has put it. With n_tj closures between it and pose j of the
map and odometry of information V_t from the pose before, all in world twists,

    I = I_0 + sum_t sum_j n_tj W_j (x) e(t, j) + sum_t V_t (x) e(t - 1, t),

e(i, j) the Laplacian of one edge and pose 0 the one where the robot is, which is held. It is linear in (n, V): the plan of
a mixture is the mixture of the plans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from topobelief.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class Plan:
    """A walk or a mixture of walks.

    Attributes
    ----------
    closures : shape (T, m)
        n_tj: how many closures of new pose t with each of the seen poses, as a rule 0 or 1.
    odometry : shape (T, kappa, kappa)
        V_t.
    num_poses
        New poses that the walk has; those beyond are idle.
    length
        Metres driven.
    cost
        In the unit of the objective.
    """

    closures: FloatArray
    odometry: FloatArray
    num_poses: float
    length: float
    cost: float


def mixture(plans: Sequence[Plan], weights: FloatArray) -> Plan:
    """The mean of some plans; weights of shape (number of plans,) that sum to 1."""

    def mean(values: list[FloatArray] | list[float]) -> FloatArray:
        return np.tensordot(weights, np.array(values), 1)

    return Plan(
        mean([plan.closures for plan in plans]),
        mean([plan.odometry for plan in plans]),
        float(mean([plan.num_poses for plan in plans])),
        float(mean([plan.length for plan in plans])),
        float(mean([plan.cost for plan in plans])),
    )
