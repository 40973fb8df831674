"""Lower and upper bounds of the joint entropy of one graph, by a family of choice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from topobelief.bounds.fischer import fischer
from topobelief.bounds.fischer_step import fischer_step
from topobelief.bounds.options import BoundOptions, Determinant
from topobelief.bounds.paper import paper
from topobelief.entropy import entropy_of
from topobelief.errors import require_choice
from topobelief.forms.of_graph import GraphForms
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.well_posed import chosen_anchor, require_connected_poses, require_determined

Family = Literal["paper", "fischer", "fischer_step"]

_FAMILIES = {"paper": paper, "fischer": fischer, "fischer_step": fischer_step}


@dataclass(frozen=True, slots=True)
class Bounds:
    """LB <= J <= UB, nats; both are widened by the estimate of their own rounding error."""

    lower: float
    upper: float

    def __repr__(self) -> str:
        return f"Bounds({self.lower:.2f} to {self.upper:.2f} nats)"


def entropy_bounds(
    graph: PoseGraph, *, family: Family = "fischer", determinant: Determinant = "cholesky", anchor: int | None = None
) -> Bounds:
    """Bounds of the joint entropy J that need no factorisation of the full information matrix.

    Parameters
    ----------
    graph
        At the poses where the information is wanted: optimise it first (`topobelief.optimize`).
    family
        "fischer": any noise, never looser than the paper's with the same anchor. "fischer_step": never looser than Fischer's,
        several times as expensive. "paper": Kitanov and Indelman's, one block-isotropic Omega on all edges.
    determinant
        "cholesky": exact determinant in the lower bound. "hadamard": product of its diagonal, cheaper and looser.
    anchor
        Pose that is held, by default the first one. J and the upper bound of J do not depend on it; the lower bound does, and
        holds for any.

    Returns
    -------
    Bounds
        Nats; `lower <= J <= upper` for the true J, to whose rounding error `joint_entropy` is known too.

    Raises
    ------
    DisconnectedGraphError
        Names the poses that the anchor does not reach.
    InvalidGraphError
        For the paper's family, where the noise differs or is not block-isotropic.
    InvalidInputError
        For an unknown family or determinant.
    IllConditionedError
        If double precision cannot give a bound to 0.1 nats.
    """
    require_choice("family", family, _FAMILIES)
    options = BoundOptions(determinant)
    anchor = chosen_anchor(graph, anchor)
    require_determined(graph, anchor=anchor)
    require_connected_poses(graph, anchor=anchor)
    forms = GraphForms(graph, anchor=anchor)
    low, high = (
        entropy_of(log_det, forms.dimension, what="bound of the joint entropy") for log_det in _FAMILIES[family](forms, options)
    )
    return Bounds(high.value - high.error, low.value + low.error)
