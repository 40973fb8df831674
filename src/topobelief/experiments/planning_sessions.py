"""The planning sessions S1 and S2 of Kitanov and Indelman (arXiv 1903.00927), and every quantity of their actions.

A robot in the Willow Garage office drives from (20, 0) to (26, 8), S1, and on to (25, -2.95), S2. Each goal is reached by
candidate paths on a roadmap, without a limit on their length. A path leaves a pose every metre (the last step is shorter), and
a loop is predicted to close between a future pose i and any pose j <= i - 2 that is nearer than 2.0 m and turned by at most
1.0 rad, through walls or not. At exactly 2.0 m, two poses back on a straight path, it does not. S2 plans on the graph that the
path of largest s_ST has left in S1. Noise is sigma_p = 0.1 m and sigma_theta = xi sigma_p (in rad per m).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.polyline import path_length
from topobelief.candidates.propose import CandidateRule, Routes, find_routes, predict_candidates
from topobelief.candidates.roadmap import Roadmap
from topobelief.graph.action import Action, posterior
from topobelief.graph.information import block_isotropic
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.planner import Planner
from topobelief.simulation.scenario import Goal, Place, named_scenario
from topobelief.world import World

SessionName = Literal["S1", "S2"]

SESSIONS: tuple[SessionName, ...] = ("S1", "S2")
SIGMA_POSITION = 0.1
"""Metres."""
NOISES = (0.1, 0.35, 0.85)
"""xi = sigma_theta / sigma_p, rad/m."""
OBJECTIVES: tuple[str, ...] = ("joint", "map", "per_pose")

_RULE = CandidateRule(max_detour=None, spacing=1.0, turn=None, closures=ClosureModel.paper(), line_of_sight=False)


@dataclass(frozen=True, eq=False, slots=True)
class PlanningSession:
    """A decision to be made: a prior graph and the paths from its last pose to a goal.

    Attributes
    ----------
    name, seed, xi
    world
    roadmap
        On which the paths were found.
    goal
        Metres.
    graph
        The prior.
    paths
        K polylines, metres, shortest first.
    actions
        What each adds to the graph.
    """

    name: SessionName
    seed: int
    xi: float
    world: World
    roadmap: Roadmap
    goal: Place
    graph: PoseGraph
    paths: tuple[FloatArray, ...]
    actions: tuple[Action, ...]


@dataclass(frozen=True, slots=True)
class ActionRow:
    """One candidate and all that is known of it; entropies and bounds in nats.

    Attributes
    ----------
    session, xi, seed, action
        Which one; actions count from 1, the shortest path first.
    length
        Metres.
    num_poses, num_new_poses, num_closures
        Of the graph after the action; of the action.
    joint, map, per_pose
        The exact objectives.
    spanning_trees, von_neumann, von_neumann_approx, von_neumann_normalized, map_spanning_trees
        Signatures; the larger, the better.
    paper_lower, paper_upper, paper_hadamard
        Bounds of the joint entropy: LB, UB, and LB by Hadamard's inequality.
    fischer_lower, fischer_upper, fischer_hadamard
    anchored_lower, anchored_upper
    """

    session: str
    xi: float
    seed: int
    action: int
    length: float
    num_poses: int
    num_new_poses: int
    num_closures: int
    joint: float
    map: float
    per_pose: float
    spanning_trees: float
    von_neumann: float
    von_neumann_approx: float
    von_neumann_normalized: float
    map_spanning_trees: float
    paper_lower: float
    paper_upper: float
    paper_hadamard: float
    fischer_lower: float
    fischer_upper: float
    fischer_hadamard: float
    anchored_lower: float
    anchored_upper: float


def session_information(xi: float) -> FloatArray:
    """Information of every edge of a session, shape (3, 3)."""
    return block_isotropic(SIGMA_POSITION, xi * SIGMA_POSITION)


def office_session(name: SessionName, seed: int, xi: float, *, num_paths: int | None = None) -> PlanningSession:
    """A session of the paper.

    Parameters
    ----------
    name
    seed
        Of roadmap and paths.
    xi
        rad/m.
    num_paths
        How many candidates at most; default: the paper's 9 and 20.

    Raises
    ------
    PlanningError
        Where no path is found.
    """
    scenario = named_scenario("office")
    first, second = scenario.goals
    start = np.array([scenario.start])
    information = session_information(xi)
    graph = PoseGraph(start, np.zeros((0, 2), dtype=np.int64), None, information)
    if name == "S1":
        return _session("S1", seed, xi, graph, scenario.world, scenario.start[:2], first, num_paths)
    before = office_session("S1", seed, xi)
    chosen = Planner(graph).decide(before.actions, proof="none").best
    graph = posterior(graph, before.actions[chosen])
    return _session("S2", seed, xi, graph, scenario.world, first.place, second, num_paths)


def _session(
    name: SessionName, seed: int, xi: float, graph: PoseGraph, world: World, start: Place, goal: Goal, num_paths: int | None
) -> PlanningSession:
    routes = _routes(seed, start, goal.place, goal.num_paths if num_paths is None else num_paths)
    found = predict_candidates(graph, world, routes, replace(_RULE, information=session_information(xi)))
    return PlanningSession(name, seed, xi, world, routes.roadmap, goal.place, graph, tuple(found.paths), tuple(found.actions))


@lru_cache(maxsize=4)  # sessions that differ in noise alone share their paths
def _routes(seed: int, start: Place, goal: Place, num_paths: int) -> Routes:
    scenario = named_scenario("office")
    size, radius = scenario.rule.num_vertices, scenario.rule.robot_radius
    rule = replace(_RULE, num_paths=num_paths, num_vertices=size, robot_radius=radius, seed=seed)
    return find_routes(scenario.world, start, goal, rule)


def action_rows(session: PlanningSession) -> list[ActionRow]:
    """Every quantity of every candidate of a session."""
    graph, actions = session.graph, session.actions
    objectives = {name: Planner(graph, objective=name).entropies(actions) for name in OBJECTIVES}
    signatures = {
        "spanning_trees": Planner(graph),
        "von_neumann": Planner(graph, signature="von_neumann"),
        "von_neumann_approx": Planner(graph, signature="von_neumann_approx"),
        "von_neumann_normalized": Planner(graph, signature="von_neumann_approx", normalized=True),
        "map_spanning_trees": Planner(graph, objective="map"),
    }
    columns = {name: planner.decide(actions, proof="none").signatures for name, planner in signatures.items()}
    families: tuple[str, ...] = ("paper", "fischer", "anchored")
    for family in families:
        decision = Planner(graph, bounds=family).decide(actions)
        columns[f"{family}_lower"], columns[f"{family}_upper"] = decision.lower, decision.upper
        if family != "anchored":
            looser = Planner(graph, bounds=family, determinant="hadamard").decide(actions)
            columns[f"{family}_hadamard"] = looser.lower
    return [
        ActionRow(
            session=session.name,
            xi=session.xi,
            seed=session.seed,
            action=index + 1,
            length=path_length(path),
            num_poses=graph.num_poses + action.num_new_poses,
            num_new_poses=action.num_new_poses,
            num_closures=action.num_closures,
            **{name: float(values[index]) for name, values in {**objectives, **columns}.items()},
        )
        for index, (path, action) in enumerate(zip(session.paths, actions, strict=True))
    ]


def cases(rows: Sequence[ActionRow]) -> dict[tuple[str, float, int], list[ActionRow]]:
    """The candidates of each decision: by session, noise and seed."""
    found: dict[tuple[str, float, int], list[ActionRow]] = {}
    for row in rows:
        found.setdefault((row.session, row.xi, row.seed), []).append(row)
    return found
