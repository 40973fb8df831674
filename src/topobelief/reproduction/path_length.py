"""What each objective prefers where candidates differ in length, in metres and in millimetres: the figure the paper lacks.

The second session's prior and goal with many candidates of any length. Joint entropy counts poses, and how much a pose counts
depends on the unit of length; map entropy depends on neither (docs, the mathematics, section 11).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from topobelief.candidates.polyline import path_length
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision_quality import rank_correlation
from topobelief.planning.planner import Planner
from topobelief.reproduction.planning_sessions import OBJECTIVES, office_session

UNITS = {"metres": 1.0, "millimetres": 1000.0}
"""By name, how many make a metre."""


@dataclass(frozen=True, slots=True)
class LengthRow:
    """One candidate under one objective in one unit.

    Attributes
    ----------
    seed, xi
    unit, objective
    action, num_closures
    length
        Metres, in either unit.
    change
        The objective minus that of staying, nats (per pose for "per_pose").
    chosen
        Whether it has the least value of all.
    """

    seed: int
    xi: float
    unit: str
    objective: str
    action: int
    length: float
    num_closures: int
    change: float
    chosen: bool


def length_rows(seed: int, xi: float, num_paths: int) -> list[LengthRow]:
    """All candidates of a session under all objectives, in both units."""
    session = office_session("S2", seed, xi, num_paths=num_paths)
    rows: list[LengthRow] = []
    for unit, per_metre in UNITS.items():
        graph, actions = in_unit(session.graph, session.actions, per_metre)
        stay = Action(np.zeros((0, 3)), np.zeros((0, 2), dtype=np.int64), graph.information[0], label="stay")
        for objective in OBJECTIVES:
            values = Planner(graph, objective=objective).entropies([stay, *actions])
            changes = values[1:] - values[0]
            chosen = int(np.argmin(changes))
            rows += [
                LengthRow(
                    seed=seed,
                    xi=xi,
                    unit=unit,
                    objective=objective,
                    action=index,
                    length=path_length(path),
                    num_closures=session.actions[index].num_closures,
                    change=float(changes[index]),
                    chosen=index == chosen,
                )
                for index, path in enumerate(session.paths)
            ]
    return rows


def in_unit(graph: PoseGraph, actions: Sequence[Action], per_metre: float) -> tuple[PoseGraph, list[Action]]:
    """The same graph and actions with positions in another unit of length (SE(2))."""
    unit = np.array([per_metre, per_metre, 1.0])
    scale = 1 / np.outer(unit, unit)
    scaled = PoseGraph(graph.poses * unit, graph.edges, graph.measurements * unit, graph.information * scale)
    return scaled, [Action(a.poses * unit, a.edges, a.information * scale, label=a.label) for a in actions]


def length_correlation(rows: Sequence[LengthRow], unit: str, objective: str) -> float:
    """Rank correlation of an objective with path length; values equal to rounding are ties."""
    chosen = [row for row in rows if (row.unit, row.objective) == (unit, objective)]
    return rank_correlation([row.length for row in chosen], np.round([row.change for row in chosen], 6))
