"""Seconds an action, as Kitanov and Indelman (arXiv 1903.00927) draw it: standard belief space planning beside topology.

Methods from scratch are those of the benchmark, with this package's own from-scratch bounds; each action is timed some times
and counts with its median. Standard planning is timed twice: with the time to build the graph that an action leaves (GTSAM's
factors and values), and without. The engine decides on all actions of a session at once, and its time is shared by them;
methods take turns, so that other work on the machine meets all of them.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.benchmark.baselines import Baseline, anchor_of, baselines
from topobelief.bounds.entropy_bounds import Determinant, entropy_bounds
from topobelief.graph.action import posterior
from topobelief.planning.planner import Planner
from topobelief.reproduction.planning_sessions import PlanningSession

Kind = Literal["standard", "paper", "engine"]

STANDARD, STANDARD_WITH_GRAPH = "standard BSP", "standard BSP and its graph"
ENGINE_RANKING, ENGINE_BOUNDS, ENGINE_EXACT = "engine: s_ST", "engine: s_ST and Fischer bounds", "engine: exact J"
_BASELINES = {
    "standard BSP, GTSAM, COLAMD": STANDARD,
    "t-BSP from scratch, s_ST": "s_ST",
    "t-BSP from scratch, exact s_VN": "s_VN",
    "t-BSP from scratch, ŝ_VN": "ŝ_VN",
}
_THREADED = ("s_VN",)
METHODS = (
    STANDARD_WITH_GRAPH,
    STANDARD,
    "exact bounds",
    "Hadamard bounds",
    "s_ST",
    "s_VN",
    "ŝ_VN",
    ENGINE_EXACT,
    ENGINE_BOUNDS,
    ENGINE_RANKING,
)
"""In the order in which they are drawn."""


@dataclass(frozen=True, slots=True)
class TimeRow:
    """Seconds an action of one method in one session.

    Attributes
    ----------
    session, xi, seed
    method
        One of `METHODS`.
    kind
        "standard", "paper" (topological, from scratch) or "engine".
    mean, median, sigma
        Seconds; over actions, or over repetitions for the engine, which takes all actions at once.
    num_actions, repetitions
    """

    session: str
    xi: float
    seed: int
    method: str
    kind: str
    mean: float
    median: float
    sigma: float
    num_actions: int
    repetitions: int


def time_rows(session: PlanningSession, *, repetitions: int) -> list[TimeRow]:
    """Time all methods on all actions of a session.

    Parameters
    ----------
    session
    repetitions
        Of each timing; a round before them is not counted.
    """
    graph, actions = session.graph, session.actions
    one_by_one = _one_by_one(session)
    at_once: dict[str, Callable[[], object]] = {
        ENGINE_RANKING: lambda: Planner(graph).decide(actions, proof="none"),
        ENGINE_BOUNDS: lambda: Planner(graph).decide(actions),
        ENGINE_EXACT: lambda: Planner(graph).entropies(actions),
    }
    threaded = {name: one_by_one.pop(name) for name in _THREADED}
    seconds = _rounds(one_by_one, repetitions)
    totals = _rounds({name: [call] for name, call in at_once.items()}, repetitions)
    seconds |= _rounds(threaded, repetitions)  # last, as its threads spin on for a while
    samples: dict[str, FloatArray] = {name: np.median(values, axis=0) for name, values in seconds.items()}
    samples |= {name: values[:, 0] / len(actions) for name, values in totals.items()}
    return [
        TimeRow(
            session=session.name,
            xi=session.xi,
            seed=session.seed,
            method=name,
            kind=_kind(name),
            mean=float(sample.mean()),
            median=float(np.median(sample)),
            sigma=float(sample.std(ddof=1)) if len(sample) > 1 else 0.0,
            num_actions=len(actions),
            repetitions=repetitions,
        )
        for name, sample in sorted(samples.items(), key=lambda item: METHODS.index(item[0]))
    ]


def _kind(method: str) -> Kind:
    if method in (ENGINE_RANKING, ENGINE_BOUNDS, ENGINE_EXACT):
        return "engine"
    return "standard" if method in (STANDARD, STANDARD_WITH_GRAPH) else "paper"


def _one_by_one(session: PlanningSession) -> dict[str, list[Callable[[], object]]]:
    """What is called for each action, by method."""
    graph, actions = session.graph, session.actions
    calls: dict[str, list[Callable[[], object]]] = {}
    for baseline in baselines():
        if baseline.name not in _BASELINES:
            continue
        ready = baseline.prepare(graph)
        calls[_BASELINES[baseline.name]] = [ready(action) for action in actions]
        if baseline.kind == "standard":
            calls[STANDARD_WITH_GRAPH] = _with_its_graph(session, baseline)
    posteriors = [posterior(graph, action) for action in actions]
    determinants: tuple[tuple[str, Determinant], ...] = (("exact bounds", "cholesky"), ("Hadamard bounds", "hadamard"))
    for name, determinant in determinants:
        calls[name] = [
            lambda after=after, determinant=determinant: entropy_bounds(
                after, family="paper", determinant=determinant, anchor=anchor_of(graph)
            )
            for after in posteriors
        ]
    return calls


def _with_its_graph(session: PlanningSession, baseline: Baseline) -> list[Callable[[], object]]:
    ready = baseline.prepare(session.graph)
    return [lambda action=action: ready(action)() for action in session.actions]


def _rounds(calls: dict[str, list[Callable[[], object]]], repetitions: int) -> dict[str, FloatArray]:
    """Seconds of each call, shape (repetitions, calls) a method; one round before them is not counted."""
    seconds: dict[str, FloatArray] = {name: np.empty((repetitions + 1, len(each))) for name, each in calls.items()}
    for repetition in range(repetitions + 1):
        for index in range(max(map(len, calls.values()))):
            for name, each in calls.items():
                seconds[name][repetition, index] = _seconds(each[index])
    return {name: values[1:] for name, values in seconds.items()}


def _seconds(call: Callable[[], object]) -> float:
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin
