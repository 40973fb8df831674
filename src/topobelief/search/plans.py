"""What a walk, or a mixture of walks, adds to the information of the prior (docs, the mathematics, section 13).

The plane is cut into cells, and the new pose number t = 1 … T in cell c is one variable, whichever walk has put it there. A
walk whose poses stand in the cells c_1, c_2, … adds, with n_tj closures between its t-th pose and pose j of the map and
odometry of information V_t from the pose before, all in world twists,

    sum_t sum_j n_tj W_j (x) e((t, c_t), j) + sum_t V_t (x) e((t - 1, c_t-1), (t, c_t)),

e(i, j) the Laplacian of one edge and the pose before the first one that where the robot is, which is held. What a mixture
adds is the mixture of what its walks add. One cell in all would be valid too, but then poses of several walks are one pose,
which sees what is far apart at once; the smaller the cells, the less of that a mixture gains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from topobelief.arrays import FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class Plan:
    """What a walk adds.

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
    cells : shape (T,)
        c_t, from 0 on. Default: one cell for all.
    """

    closures: FloatArray
    odometry: FloatArray
    num_poses: float
    length: float
    cost: float
    cells: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))

    def __post_init__(self) -> None:
        if len(self.cells) < len(self.closures):
            object.__setattr__(self, "cells", np.zeros(len(self.closures), np.int64))


@dataclass(frozen=True, slots=True)
class Background:
    """The mean of everything that walks may add: where the optimisation begins. A little of its odometry is added to each
    mixture of walks, so that each variable has some information.

    Attributes
    ----------
    num_cells
        C; pose t in cell c is the variable (t - 1) C + c.
    closures : shape (T C, m)
        Closures of each variable.
    source, target : shape (L,)
        Variables that odometry joins; -1 for the pose where the robot is.
    odometry : shape (L, kappa, kappa)
    """

    num_cells: int
    closures: FloatArray
    source: IntArray
    target: IntArray
    odometry: FloatArray


@dataclass(frozen=True, slots=True)
class Mixture:
    """Some plans with weights, and a share of the background.

    Attributes
    ----------
    plans
    weights : shape (number of plans,)
        They sum to 1, or there are none.
    background
    share
        By which the background is multiplied.
    only_used
        Whether only variables that the plans have are kept, and of the background only the odometry between them.
    """

    plans: Sequence[Plan]
    weights: FloatArray
    background: Background
    share: float
    only_used: bool = False

    @property
    def num_poses(self) -> float:
        """Mean number of new poses."""
        return float(sum(w * plan.num_poses for w, plan in zip(self.weights.tolist(), self.plans, strict=True)))

    @property
    def cost(self) -> float:
        """Mean cost."""
        return float(sum(w * plan.cost for w, plan in zip(self.weights.tolist(), self.plans, strict=True)))


def alone(plan: Plan) -> Mixture:
    """A plan without any background."""
    count, num_seen = plan.closures.shape
    num_cells = int(plan.cells.max(initial=0)) + 1
    none = np.zeros(0, np.int64)
    nothing = Background(
        num_cells, np.zeros((count * num_cells, num_seen)), none, none, np.zeros((0, *plan.odometry.shape[1:]))
    )
    return Mixture([plan], np.ones(1), nothing, 0.0, only_used=True)
