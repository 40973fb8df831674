"""What bounds are worth for candidates as `topobelief plan` predicts them, beside those that close a few loops each.

The same paths are given loop closures in three ways: as in `sessions.candidate_paths`, as learned from the graph's own history
(`learn_closures`, the default of `plan`), and by the paper's rule, which closes a loop with every pose nearby.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, TypeVar, get_args

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.benchmark.sessions import candidate_paths
from topobelief.benchmark.timing import Clock
from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.learned_closures import learn_closures
from topobelief.candidates.predicted_factors import predict_actions
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.planner import Planner

Candidates = Literal["nearest", "learned", "paper"]
Objective = Literal["joint", "error"]

_SIGNATURES = {"joint": "spanning_trees", "error": "resistance"}

_NUM_NEW_POSES, _NUM_NEAREST = 30, 6  # one closure for five poses, as in the sessions of 100 poses and 20 closures


@dataclass(frozen=True, slots=True)
class BoundsOfCandidates:
    """One objective and family of bounds for one kind of candidates on one graph.

    Attributes
    ----------
    name
        Of the graph.
    candidates
        "nearest": with the nearest poses, 6 closures a path on average; "learned"; "paper".
    rule
        The closures in words.
    num_actions
    num_closures, expected_closures
        Means of an action: factors, and each counted by its probability.
    objective, bounds
        "joint" and a family; "error", whose bounds by increments are exact.
    width
        Upper less lower bound, median over the actions, in the objective's unit.
    num_survivors
        Actions that bounds leave.
    seconds, exact_seconds
        Of ranking with bounds, and of exact values of all, each with a new planner; medians.
    """

    name: str
    candidates: Candidates
    rule: str
    num_actions: int
    num_closures: float
    expected_closures: float
    objective: Objective
    bounds: str
    width: float
    num_survivors: int
    seconds: float
    exact_seconds: float


def predicted_candidates(graph: PoseGraph, count: int, candidates: Candidates, *, seed: int) -> tuple[tuple[Action, ...], str]:
    """Candidates of about 30 new poses, and their closures in words.

    Parameters
    ----------
    graph
    count
        K; paths are the same for all kinds of candidates.
    candidates
    seed
    """
    rng = np.random.default_rng(seed)
    actions = candidate_paths(graph, count, num_new_poses=_NUM_NEW_POSES, num_closures=_NUM_NEAREST, rng=rng)
    if candidates == "nearest":
        return actions, f"closures: with the nearest pose in reach, {_NUM_NEAREST} a path on average"
    model = learn_closures(graph) if candidates == "learned" else ClosureModel.paper()
    paths: list[FloatArray] = [
        np.vstack([graph.positions[graph.last_pose], graph.group.position(action.poses)]) for action in actions
    ]
    step = (actions[0].length or _NUM_NEW_POSES) / _NUM_NEW_POSES
    return tuple(predict_actions(graph, paths, closures=model, spacing=step)), str(model)


def bounds_of_candidates(
    name: str,
    graph: PoseGraph,
    *,
    num_actions: int,
    repetitions: int,
    seed: int,
    clock: Clock = time.perf_counter,
) -> Iterator[BoundsOfCandidates]:
    """All kinds of candidates, each with all families of the joint entropy and with the expected error.

    Parameters
    ----------
    name
    graph
    num_actions
    repetitions
        Of each timing.
    seed
    clock
    """
    for candidates in get_args(Candidates):
        actions, rule = predicted_candidates(graph, num_actions, candidates, seed=seed)
        cases: list[tuple[Objective, str]] = [("joint", family) for family in ("fischer", "anchored", "chain")]
        cases.append(("error", "anchored"))
        exact: dict[Objective, float] = {}
        for objective, family in cases:
            planner = partial(
                Planner, graph, objective=objective, bounds=family, engine="incremental", signature=_SIGNATURES[objective]
            )
            if objective not in exact:
                exact[objective] = _timed(
                    lambda make, actions: make().entropies(actions), planner, actions, repetitions, clock
                )[1]
            decision, seconds = _timed(lambda make, actions: make().decide(actions), planner, actions, repetitions, clock)
            yield BoundsOfCandidates(
                name=name,
                candidates=candidates,
                rule=rule,
                num_actions=len(actions),
                num_closures=float(np.mean([action.num_closures for action in actions])),
                expected_closures=float(np.mean([action.expected_closures for action in actions])),
                objective=objective,
                bounds=family if objective == "joint" else "exact",
                width=float(np.median(decision.upper - decision.lower)),
                num_survivors=len(decision.survivors),
                seconds=seconds,
                exact_seconds=exact[objective],
            )


Answer = TypeVar("Answer")


def _timed(
    work: Callable[[Callable[[], Planner], Sequence[Action]], Answer],
    planner: Callable[[], Planner],
    actions: Sequence[Action],
    repetitions: int,
    clock: Clock,
) -> tuple[Answer, float]:
    """What the work answers, and the median of its seconds; with a new planner each time."""
    seconds: list[float] = []
    while True:
        start = clock()
        answer = work(planner, actions)
        seconds.append(clock() - start)
        if len(seconds) == repetitions:
            return answer, statistics.median(seconds)
