"""What choosing by an entropy costs in centimetres of the map's error, and what choosing by the error costs in nats.

Candidates of a decision are ranked by each signature and each exact objective. Every ranking is judged by two objectives: the
expected error E of the map (docs, the mathematics, section 12) and its entropy. Decisions differ in

* the place: the paper's second session ("S2"), the end of a drive of three to eight legs between random places of its office
  and of its authors' larger lab ("office", "lab"), and the end of a recorded pose graph, from where paths lead to random poses
  of the farther half;
* the noise: one matrix on all edges by xi = sigma_theta / sigma_p, and the file's own on recorded graphs (xi is nan);
* how much longer than the shortest a path may be;
* the closures. "learned": as `plan` predicts them, learned from the prior's own, at most so many a pose and each with a
  probability. "single": one a pose, with the nearest pose in sight within 2 m, with certainty. "paper": all poses within 2 m
  and 1 rad, through walls or not, with certainty. A drive has closures of the kind that is predicted, where they are learned
  those of "single" with half of the opportunities taken. S2 and recorded graphs have the closures that they have.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
import shapely

from topobelief.arrays import FloatArray
from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.learned_closures import learn_closures
from topobelief.candidates.propose import CandidateRule, find_routes, predict_along
from topobelief.errors import InvalidInputError, PlanningError
from topobelief.estimation import optimize
from topobelief.graph.action import Action, posterior
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.formats import read_pose_graph
from topobelief.planning.decision_quality import decision_quality
from topobelief.planning.planner import Planner
from topobelief.reproduction.planning_sessions import NOISES, office_session, session_information
from topobelief.simulation.scenario import named_scenario
from topobelief.world import World

ClosureKind = Literal["learned", "single", "paper"]

MAPS = ("S2", "office", "lab")
DETOURS = (1.3, 2.5)
CLOSURES: tuple[ClosureKind, ...] = ("learned", "single", "paper")
CHOOSERS = (
    "error",
    "resistance",
    "map",
    "map_spanning_trees",
    "joint",
    "spanning_trees",
    "von_neumann",
    "von_neumann_approx",
    "shortest",
    "random",
)
"""Exact objectives, signatures, and two that ignore the graph; the last loses what a random choice loses on average."""

_RANKINGS: dict[str, dict[str, Any]] = {
    "resistance": {"objective": "error", "signature": "resistance"},
    "map_spanning_trees": {"objective": "map", "signature": "spanning_trees"},
    "spanning_trees": {"objective": "joint", "signature": "spanning_trees"},
    "von_neumann": {"objective": "joint", "signature": "von_neumann"},
    "von_neumann_approx": {"objective": "joint", "signature": "von_neumann_approx"},
}
_NOISELESS = ("von_neumann", "von_neumann_approx")
_OBJECTIVES = ("error", "map", "joint")
_MANY_CLOSURES = 150  # of an action, above which its entropy is faster from scratch
_DIGITS = 9  # values that differ by less, in metres and nats, are ties

_RULES: dict[ClosureKind, dict[str, Any]] = {
    "learned": {},
    "single": {"closures": ClosureModel(max_per_pose=1, probability=1.0)},
    "paper": {"closures": ClosureModel.paper(), "line_of_sight": False, "turn": None},
}
_LEGS = (3, 8)
_LEAST_DISTANCE = 5.0  # metres from the end of a drive to the goal, straight
_ROOMY = 1.02  # robot radii; where places are that are reached without squeezing through
_MAX_DRAWS = 10_000


@dataclass(frozen=True, slots=True)
class ChoiceRow:
    """One way to choose, in one decision.

    Attributes
    ----------
    place, seed, xi, max_detour, closures
        Which decision.
    num_poses, num_actions
    num_closures
        Expected of an action, on average.
    error_before, least_error, shortest_error
        E before any action, after the best one and after the shortest path, metres.
    chooser
        One of `CHOOSERS`.
    error_lost, map_lost, joint_lost
        By its choice against the best action: of the expected error, metres; of the map and the joint entropy, nats.
    error_correlation, map_correlation, joint_correlation
        Spearman's, of its ranking with that of each objective; nan where it has none.
    seconds
        Processor time of the ranking, an action, what is paid once for the prior included; nan where there is none.
    """

    place: str
    seed: int
    xi: float
    max_detour: float
    closures: str
    num_poses: int
    num_actions: int
    num_closures: float
    error_before: float
    least_error: float
    shortest_error: float
    chooser: str
    error_lost: float
    map_lost: float
    joint_lost: float
    error_correlation: float
    map_correlation: float
    joint_correlation: float
    seconds: float

    @property
    def share_lost(self) -> float:
        """Of the least expected error."""
        return self.error_lost / self.least_error


@dataclass(frozen=True, slots=True)
class ChoiceSummary:
    """One way to choose, over all seeds and noises of a place, a detour and a kind of closures.

    Attributes
    ----------
    place, max_detour, closures, chooser, num_decisions
    mean_error_lost, max_error_lost
        Centimetres.
    mean_share_lost, max_share_lost
        Per cent of the least expected error.
    mean_map_lost, max_map_lost
        Nats.
    error_correlation, map_correlation, joint_correlation
        Medians; nan where there is none.
    milliseconds
        An action, median.
    """

    place: str
    max_detour: float
    closures: str
    chooser: str
    num_decisions: int
    mean_error_lost: float
    max_error_lost: float
    mean_share_lost: float
    max_share_lost: float
    mean_map_lost: float
    max_map_lost: float
    error_correlation: float
    map_correlation: float
    joint_correlation: float
    milliseconds: float


@dataclass(frozen=True, eq=False, slots=True)
class _Situation:
    """Where decisions are made: a world, start and goal, and a graph that ends at the start for each kind of closures."""

    place: str
    world: World
    graphs: dict[ClosureKind, PoseGraph]
    goal: FloatArray

    @property
    def start(self) -> FloatArray:
        return self.graphs[CLOSURES[0]].positions[-1]


def choice_rows(place: str | Path, seed: int, num_paths: int, *, largest: int) -> list[ChoiceRow]:
    """All decisions at a place: of all noises, detours and kinds of closures.

    Parameters
    ----------
    place
        One of `MAPS`, or the file of a pose graph.
    seed
        Of drive, goal, roadmap and paths.
    num_paths
        Candidates, at most.
    largest
        Recorded graphs of more poses are left out, as are those in SE(3): no rows.

    Raises
    ------
    FileError, EstimationError
        Where a file cannot be read or has no estimate.
    PlanningError
        Where no path is found.
    """
    _warm_up()
    situation = _recorded(place, seed, largest) if isinstance(place, Path) else _on_map(place, seed)
    if situation is None:
        return []
    noises = (math.nan, *NOISES) if isinstance(place, Path) else NOISES
    rows: list[ChoiceRow] = []
    for max_detour in DETOURS:
        rule = CandidateRule(num_paths=num_paths, max_detour=max_detour, seed=seed)
        paths = find_routes(situation.world, situation.start, situation.goal, rule).paths
        if len(paths) < 2:
            continue  # nothing to decide
        for kind in CLOSURES:
            graph = situation.graphs[kind]
            predicting = replace(rule, **_RULES[kind])
            if predicting.closures is None:
                predicting = replace(predicting, closures=learn_closures(graph, world=situation.world))
            noiseless: dict[str, tuple[FloatArray, float]] = {}
            for xi in noises:
                information = None if math.isnan(xi) else session_information(xi)
                prior = graph if information is None else with_noise(graph, information)
                actions = predict_along(prior, situation.world, paths, replace(predicting, information=information))
                if not noiseless:
                    noiseless = _rankings(prior, actions, _NOISELESS)
                rows += _rows_of_decision((situation.place, seed, xi, max_detour, kind), prior, actions, noiseless)
    return rows


def with_noise(graph: PoseGraph, information: FloatArray) -> PoseGraph:
    """The same graph with one information matrix, shape (kappa, kappa), on all edges."""
    return PoseGraph(graph.poses, graph.edges, graph.measurements, information)


def _rows_of_decision(
    key: tuple[str, int, float, float, str],
    prior: PoseGraph,
    actions: Sequence[Action],
    noiseless: dict[str, tuple[FloatArray, float]],
) -> list[ChoiceRow]:
    place, seed, xi, max_detour, kind = key
    num_closures = float(np.mean([action.num_closures for action in actions]))
    engines = {name: "incremental" if name == "error" or num_closures <= _MANY_CLOSURES else "scratch" for name in _OBJECTIVES}
    exact = {
        name: _timed(lambda name=name, engine=engine: Planner(prior, objective=name, engine=engine).entropies(actions))
        for name, engine in engines.items()
    }
    objectives = [np.round(exact[name][0], _DIGITS) for name in _OBJECTIVES]
    error = objectives[0]
    stay = Action(np.zeros((0, 3)), np.zeros((0, 2), dtype=np.int64), prior.information[0], label="stay")
    before = float(Planner(prior, objective="error", engine="incremental").entropies([stay])[0])
    others = [name for name in _RANKINGS if name not in _NOISELESS]
    scores = noiseless | _rankings(prior, actions, others)
    scores |= {name: (-values, exact[name][1]) for name, values in zip(_OBJECTIVES, objectives, strict=True)}
    lengths = np.array([action.length for action in actions], dtype=np.float64)
    scores["shortest"] = (-lengths, math.nan)
    rows: list[ChoiceRow] = []
    for chooser in CHOOSERS:
        if chooser == "random":
            lost = [max(0.0, float(values.mean() - values.min())) for values in objectives]
            correlations, seconds = [math.nan] * 3, math.nan
        else:
            ranking, seconds = scores[chooser]
            qualities = [decision_quality(values, ranking) for values in objectives]
            lost, correlations = [each.error for each in qualities], [each.spearman for each in qualities]
        rows.append(
            ChoiceRow(
                **{"place": place, "seed": seed, "xi": xi, "max_detour": max_detour, "closures": kind},
                num_poses=prior.num_poses,
                num_actions=len(actions),
                num_closures=float(np.mean([action.expected_closures for action in actions])),
                error_before=before,
                least_error=float(error.min()),
                shortest_error=float(error[0]),
                chooser=chooser,
                **dict(zip(("error_lost", "map_lost", "joint_lost"), lost, strict=True)),
                **dict(zip(("error_correlation", "map_correlation", "joint_correlation"), correlations, strict=True)),
                seconds=seconds,
            )
        )
    return rows


def _rankings(prior: PoseGraph, actions: Sequence[Action], names: Sequence[str]) -> dict[str, tuple[FloatArray, float]]:
    """Signatures by name, and seconds an action."""
    return {
        name: _timed(
            lambda name=name: Planner(prior, engine="incremental", **_RANKINGS[name]).decide(actions, proof="none").signatures
        )
        for name in names
    }


def _timed(call: Callable[[], FloatArray]) -> tuple[FloatArray, float]:
    """Values of all actions, and seconds of processor time an action."""
    begin = time.process_time()
    values = call()
    return values, (time.process_time() - begin) / len(values)


@lru_cache(maxsize=1)
def _warm_up() -> None:
    """Load what is compiled before anything is timed."""
    prior = PoseGraph([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [(0, 1), (1, 2)], None, np.eye(3))
    actions = [Action([[1, 1, 0]], [(2, 3), (3, 0)], np.eye(3), length=2.0)] * 2
    scores = _rankings(prior, actions, tuple(_RANKINGS))
    _rows_of_decision(("", 0, 0.0, 1.0, ""), prior, actions, scores)


def _on_map(place: str, seed: int) -> _Situation:
    if place not in MAPS:
        raise InvalidInputError(f"expected a place of {', '.join(MAPS)}, got {place}")
    if place == "S2":
        session = office_session("S2", seed, NOISES[1])
        return _Situation(place, session.world, dict.fromkeys(CLOSURES, session.graph), np.array(session.goal))
    scenario = named_scenario(place)
    rng = np.random.default_rng([seed, MAPS.index(place)])
    start = np.array(scenario.start)
    alone = CandidateRule(num_paths=1, robot_radius=scenario.rule.robot_radius, seed=seed)
    legs: list[FloatArray] = []
    for _ in range(int(rng.integers(_LEGS[0], _LEGS[1] + 1)) + 1):
        legs.append(_leg(scenario.world, legs[-1][-1] if legs else start[:2], alone, rng))
    goal = legs.pop()[-1]
    graphs: dict[ClosureKind, PoseGraph] = {}
    for kind in CLOSURES:
        rule = replace(alone, **({"closures": ClosureModel()} | _RULES[kind]), information=session_information(NOISES[1]))
        graph = PoseGraph(start[None], np.zeros((0, 2), dtype=np.int64), None, session_information(NOISES[1]))
        for leg in legs:
            graph = posterior(graph, _drawn(predict_along(graph, scenario.world, [leg], rule)[0], rng))
        graphs[kind] = graph
    return _Situation(place, scenario.world, graphs, goal)


def _leg(world: World, here: FloatArray, rule: CandidateRule, rng: np.random.Generator) -> FloatArray:
    """The shortest path to a random place that is not near; to another one where the roadmap does not get there."""
    region = world.component(here, _ROOMY * rule.robot_radius)
    low, high = np.array(region.bounds).reshape(2, 2)
    points = rng.uniform(low, high, size=(_MAX_DRAWS, 2))
    inside = np.asarray(cast("Any", shapely).contains_xy(region, *points.T), dtype=bool)
    for place in points[inside & (np.linalg.norm(points - here, axis=1) >= _LEAST_DISTANCE)]:
        with suppress(PlanningError):
            return find_routes(world, here, place, rule).paths[0]
    raise PlanningError(f"expected a place of {world!r} to drive to, got none")


def _drawn(action: Action, rng: np.random.Generator) -> Action:
    """The measurements that were made, each with all of its information."""
    if action.probabilities is None:
        return action
    made = rng.random(len(action.edges)) < action.probabilities
    information = action.information / action.probabilities[:, None, None]
    return Action(action.poses, action.edges[made], information[made], length=action.length)


def _recorded(path: Path, seed: int, largest: int) -> _Situation | None:
    graph = read_pose_graph(path)
    if graph.tangent_dim != 3 or graph.num_poses > largest:
        return None
    graph = optimize(graph)
    world = World.from_trajectory(graph)
    distances = np.linalg.norm(graph.positions - graph.positions[-1], axis=1)
    farther = np.flatnonzero(distances >= np.median(distances))
    goal = graph.positions[int(np.random.default_rng(seed).choice(farther))]
    return _Situation(path.stem, world, dict.fromkeys(CLOSURES, graph), goal)


def summaries(rows: Sequence[ChoiceRow]) -> list[ChoiceSummary]:
    """One line for each place, detour, kind of closures and way to choose."""
    groups: dict[tuple[str, float, str, str], list[ChoiceRow]] = {}
    for row in rows:
        groups.setdefault((row.place, row.max_detour, row.closures, row.chooser), []).append(row)
    return [
        ChoiceSummary(
            *key,
            num_decisions=len(group),
            mean_error_lost=100 * float(np.mean([row.error_lost for row in group])),
            max_error_lost=100 * max(row.error_lost for row in group),
            mean_share_lost=100 * float(np.mean([row.share_lost for row in group])),
            max_share_lost=100 * max(row.share_lost for row in group),
            mean_map_lost=float(np.mean([row.map_lost for row in group])),
            max_map_lost=max(row.map_lost for row in group),
            error_correlation=_median([row.error_correlation for row in group]),
            map_correlation=_median([row.map_correlation for row in group]),
            joint_correlation=_median([row.joint_correlation for row in group]),
            milliseconds=1e3 * _median([row.seconds for row in group]),
        )
        for key, group in groups.items()
    ]


def _median(values: Sequence[float]) -> float:
    """Of those that are there; nan where none is."""
    known = [value for value in values if not math.isnan(value)]
    return float(np.median(known)) if known else math.nan
