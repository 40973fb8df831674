"""Lower and upper bounds of the joint entropy, a family and a determinant at a choice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

from topobelief.bounds.fischer import fischer_bounds
from topobelief.bounds.paper import paper_bounds
from topobelief.entropy import entropy_of
from topobelief.errors import require_choice
from topobelief.graph.fisher import FisherRows, fisher_rows
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.topology import checked_anchor
from topobelief.linalg import LogDet, LogDetSolver

Family = Literal["paper", "fischer"]
Determinant = Literal["cholesky", "hadamard"]

_FAMILIES: dict[str, Callable[..., tuple[LogDet, LogDet]]] = {"paper": paper_bounds, "fischer": fischer_bounds}


@dataclass(frozen=True, slots=True)
class Bounds:
    """LB <= J <= UB, nats; both are widened by the estimate of their own rounding error."""

    lower: float
    upper: float


@dataclass(frozen=True, slots=True)
class LogDetBounds:
    """lower <= ln det I <= upper, each with its rounding error beside it."""

    lower: LogDet
    upper: LogDet


def entropy_bounds(
    graph: PoseGraph, *, family: Family = "fischer", determinant: Determinant = "cholesky", anchor: int = 0
) -> Bounds:
    """Bounds of the joint entropy J that need no factorisation of the full information matrix.

    Parameters
    ----------
    graph
        At the poses where the information is wanted: optimise it first (`topobelief.optimize`).
    family
        "fischer": any noise, never looser than the paper's with the same anchor. "paper": Kitanov and Indelman's, one
        block-isotropic Omega on all edges.
    determinant
        "cholesky": exact determinant in the lower bound. "hadamard": product of its diagonal, cheaper and looser.
    anchor
        Pose that is held. J and the upper bound of J do not depend on it; the lower bound does, and holds for any.

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
    anchor = checked_anchor(graph.num_poses, anchor)
    graph.topology.require_connected(anchor=anchor, names=graph.ids)
    solver = LogDetSolver(graph.edges, graph.num_poses, anchor)
    bounds = log_det_bounds(fisher_rows(graph), solver, family=family, determinant=determinant)
    upper = entropy_of(bounds.lower, graph.num_poses - 1, graph.tangent_dim, what="bound of the joint entropy")
    lower = entropy_of(bounds.upper, graph.num_poses - 1, graph.tangent_dim, what="bound of the joint entropy")
    return Bounds(lower.value - lower.error, upper.value + upper.error)


def log_det_bounds(rows: FisherRows, solver: LogDetSolver, *, family: str, determinant: str) -> LogDetBounds:
    """Bounds of ln det I; arguments as in `entropy_bounds`."""
    require_choice("family", family, _FAMILIES)
    require_choice("determinant", determinant, get_args(Determinant))
    return LogDetBounds(*_FAMILIES[family](rows, solver, hadamard=determinant == "hadamard"))
