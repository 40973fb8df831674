"""What bounds are worth: actions that they rule out, how far from the best they leave the choice, evaluations to the proof.

Not in the paper (arXiv 1903.00927), which has one family of bounds and one objective: here are its bounds, Fischer's and those
anchored in the prior, for the joint entropy, the map entropy and the joint entropy per pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from topobelief.bounds.entropy_bounds import Determinant
from topobelief.bounds.paper import require_equal_noise
from topobelief.errors import InvalidGraphError
from topobelief.graph.action import Action, posterior
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.planner import Planner

FAMILIES: tuple[tuple[str, str, Determinant], ...] = (
    ("paper, Hadamard", "paper", "hadamard"),
    ("paper", "paper", "cholesky"),
    ("Fischer, Hadamard", "fischer", "hadamard"),
    ("Fischer", "fischer", "cholesky"),
    ("anchored", "anchored", "cholesky"),
)
"""Name, family and determinant, the loosest first."""


@dataclass(frozen=True, slots=True)
class BoundsRow:
    """One decision by one family of bounds; nats (per pose for "per_pose").

    Attributes
    ----------
    prior
        A session's name or a file's.
    xi
        rad/m; nan where noise is that of a file.
    seed
    objective, bounds
    num_actions
    num_eliminated
        Actions that cannot be the best by their bounds alone.
    error_bound
        Delta J_max of the action of largest s_ST.
    true_error
        What it does lose.
    num_evaluations
        Exact evaluations until the best action is proven.
    spread
        Largest minus least exact value.
    """

    prior: str
    xi: float
    seed: int
    objective: str
    bounds: str
    num_actions: int
    num_eliminated: int
    error_bound: float
    true_error: float
    num_evaluations: int
    spread: float


def bounds_rows(
    prior: str,
    xi: float,
    seed: int,
    graph: PoseGraph,
    actions: Sequence[Action],
    objectives: Sequence[str],
) -> list[BoundsRow]:
    """Every family that covers the noise, for each objective."""
    rows: list[BoundsRow] = []
    equal_noise = _has_equal_noise(posterior(graph, actions[0]))
    for objective in objectives:
        values = Planner(graph, objective=objective).entropies(actions)
        for name, family, determinant in FAMILIES:
            if family == "paper" and not equal_noise:
                continue
            planner = Planner(graph, objective=objective, bounds=family, determinant=determinant)
            bounded, proven = planner.decide(actions), planner.decide(actions, proof="optimal")
            rows.append(
                BoundsRow(
                    prior=prior,
                    xi=xi,
                    seed=seed,
                    objective=objective,
                    bounds=name,
                    num_actions=len(actions),
                    num_eliminated=len(actions) - len(bounded.survivors),
                    error_bound=bounded.error_bound,
                    true_error=float(values[bounded.best] - values.min()),
                    num_evaluations=proven.num_evaluations,
                    spread=float(np.ptp(values)),
                )
            )
    return rows


def _has_equal_noise(graph: PoseGraph) -> bool:
    try:
        require_equal_noise(graph.information)
    except InvalidGraphError:
        return False
    return True
