"""From a place to candidates: a roadmap, diverse paths on it, and the factors that each would add to the graph.

Commands, studies and simulations all find their candidates here, so a new rule has one place. `propose` does it in one step;
its two halves, `find_routes` and `predict_candidates`, are for callers that keep the paths while the noise changes, or that
report between the two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray
from topobelief.candidates.attitude import Attitude
from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.diverse_paths import diverse_paths
from topobelief.candidates.observations import ObservationModel
from topobelief.candidates.polyline import path_length
from topobelief.candidates.predicted_factors import KEY_POSE_TURN, predict_actions
from topobelief.candidates.roadmap import Roadmap, build_roadmap
from topobelief.candidates.start import Start
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.wording import counted
from topobelief.world import FreeSpace


@dataclass(frozen=True, eq=False, slots=True)
class CandidateRule:
    """How candidates are found and their factors predicted.

    Attributes
    ----------
    num_paths
        How many at most.
    max_detour
        Longest path in lengths of the shortest, at least 1; None for no limit.
    num_vertices
        Least size of the roadmap.
    robot_radius
        How far paths keep from walls, metres.
    seed
        Of roadmap and paths.
    spacing
        Metres from new pose to new pose.
    turn
        Radians by which a path turns from new pose to new pose; None: by distance only.
    closures
        Which loops the new poses close; None: as learned from the graph.
    observations
        Which landmarks the new poses observe; None: as learned from the graph.
    line_of_sight
        Whether loops close only between poses that see each other, and paths must stay in free space.
    information : shape (kappa, kappa), or None
        Of every predicted factor; None for what the graph suggests (`predicted_factors.default_information`).
    attitude
        Of new poses in SE(3): "upright", "along" the path, or None for what suits the graph, see `predict_actions`.
    """

    num_paths: int = 20
    max_detour: float | None = 1.3
    num_vertices: int = 1000
    robot_radius: float = 0.35
    seed: int = 0
    spacing: float = 1.0
    turn: float | None = KEY_POSE_TURN
    closures: ClosureModel | None = None
    observations: ObservationModel | None = None
    line_of_sight: bool = True
    information: FloatArray | None = None
    attitude: Attitude | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Routes:
    """Ways to a goal.

    Attributes
    ----------
    roadmap
        On which the paths were found.
    paths
        K polylines, each of shape (waypoints, dim) of the world, metres, shortest first.
    """

    roadmap: Roadmap
    paths: list[FloatArray]

    def __repr__(self) -> str:
        return f"Routes({_described(self.lengths)})"

    @property
    def lengths(self) -> FloatArray:
        """Of the paths, metres, shape (K,)."""
        return np.array([path_length(path) for path in self.paths])


@dataclass(frozen=True, eq=False, slots=True)
class Candidates:
    """Ways to a goal, and what driving each would add to the graph.

    Attributes
    ----------
    routes
    actions
        K, in the order of the paths.
    """

    routes: Routes
    actions: list[Action]

    def __repr__(self) -> str:
        return f"Candidates({_described(self.lengths)})"

    @property
    def paths(self) -> list[FloatArray]:
        """K polylines, each of shape (waypoints, dim) of the world, metres, shortest first."""
        return self.routes.paths

    @property
    def lengths(self) -> FloatArray:
        """Of the paths, metres, shape (K,)."""
        return self.routes.lengths


def _described(lengths: FloatArray) -> str:
    """How many paths, and of which lengths."""
    ends = dict.fromkeys(f"{length:.1f}" for length in (lengths.min(), lengths.max())) if len(lengths) else {}
    extent = f", {' to '.join(ends)} m" if ends else ""
    return f"{counted(len(lengths), 'path')}{extent}"


def propose(graph: PoseGraph, world: FreeSpace, start: ArrayLike | Start, goal: ArrayLike, rule: CandidateRule) -> Candidates:
    """Diverse paths from a start to a goal, and the factors that each would add.

    Parameters
    ----------
    graph
    world
        In the plane, or for a graph in SE(3) in space.
    start
        Where paths begin. From a `Start`, factors join its pose, as `predict_actions` says. From a place of shape (2,) or (3,),
        metres, they join the graph's last pose, from which a robot is led straight to where paths begin.
    goal : shape (2,) or (3,)
        Metres; a heading is ignored.
    rule

    Raises
    ------
    PlanningError
        Where start or goal is in collision, there is no path, or a path leaves the free space of the world.
    InvalidInputError
        Where a number of the rule is out of range.
    """
    routes = find_routes(world, start, goal, rule)
    return predict_candidates(graph, world, routes, rule, start=start if isinstance(start, Start) else None)


def find_routes(
    world: FreeSpace, start: ArrayLike | Start, goal: ArrayLike, rule: CandidateRule, *, roadmap: Roadmap | None = None
) -> Routes:
    """The paths of `propose`, which depend on the world alone; on a roadmap that is there already, start and goal join it."""
    place = start.place if isinstance(start, Start) else start
    if roadmap is None:
        roadmap = build_roadmap(world, place, goal, rule.num_vertices, rule.robot_radius, rule.seed)
    else:
        roadmap = roadmap.between(place, goal)
    return Routes(roadmap, diverse_paths(roadmap, place, goal, rule.num_paths, rule.max_detour, rule.seed))


def predict_candidates(
    graph: PoseGraph, world: FreeSpace, routes: Routes, rule: CandidateRule, *, start: Start | None = None
) -> Candidates:
    """The factors of `propose` along paths that were found before; they join the last pose unless there is a start."""
    return Candidates(routes, predict_along(graph, world, routes.paths, rule, start=start))


def predict_along(
    graph: PoseGraph, world: FreeSpace, paths: Sequence[ArrayLike], rule: CandidateRule, *, start: Start | None = None
) -> list[Action]:
    """As `predict_candidates`, along paths of any origin, each of shape (waypoints, 2)."""
    return predict_actions(
        graph,
        paths,
        information=rule.information,
        spacing=rule.spacing,
        turn=rule.turn,
        closures=rule.closures,
        observations=rule.observations,
        world=world if rule.line_of_sight else None,
        start=start,
        attitude=rule.attitude,
    )
