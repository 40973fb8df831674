"""How a robot chooses among candidate paths: by a signature, a proof, exact entropies, or without looking at its graph."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import InvalidInputError
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision import Decision
from topobelief.planning.planner import Planner
from topobelief.planning.registry import SIGNATURES

STRATEGIES = ("spanning_trees", "von_neumann_approx", "von_neumann", "optimum", "standard", "shortest", "random")
"""Three signatures; "optimum" proves the best by s_ST's ranking; "standard" evaluates all; the last two ignore the graph."""

_FORCED = re.compile(r"path-([1-9][0-9]*)")


@dataclass(frozen=True, eq=False, slots=True)
class Choice:
    """What a strategy answers.

    Attributes
    ----------
    action : int
    decision : Decision or None
        With ranking, bounds and certificate, where the strategy is one of the planner's.
    seconds : float
        Wall time from the question to the answer; of signatures the ranking alone, which is all that the answer needs.
    """

    action: int
    decision: Decision | None
    seconds: float


def checked_strategy(name: str) -> str:
    """One of `STRATEGIES`, or "path-k" for the k-th shortest candidate (the last, where there are fewer).

    Raises
    ------
    InvalidInputError
        Names the choices.
    """
    if name not in STRATEGIES and not _FORCED.fullmatch(name):
        raise InvalidInputError(f'expected a strategy of {", ".join(STRATEGIES)}, or path-1, path-2, …, got "{name}"')
    return name


def load_kernels() -> None:
    """Load what decisions by increments are compiled with, so that the first one is as fast as the others.

    The first time on a machine it takes half a minute to compile.
    """
    if find_spec("numba") is not None:
        from topobelief.planning.compile_kernels import compile_kernels

        compile_kernels()


def planner_on(graph: PoseGraph, objective: str, *, signature: str = "spanning_trees") -> Planner:
    """By increments to the graph and with bounds anchored in it, where numba is there; from scratch where it is not."""
    bounds = "fischer" if find_spec("numba") is None else "anchored"
    return Planner(graph, objective=objective, signature=signature, bounds=bounds, allow_dense_spectrum=True)


def choose(
    strategy: str,
    graph: PoseGraph,
    actions: Sequence[Action],
    lengths: FloatArray,
    *,
    objective: str,
    rng: np.random.Generator,
) -> Choice:
    """The choice of a strategy; only "random" draws from `rng`.

    Parameters
    ----------
    strategy
        See `checked_strategy`.
    graph
        At its estimate.
    actions
        K of them.
    lengths : shape (K,)
        Of the paths, metres.
    objective
        What the planner minimises.
    """
    begin = time.perf_counter()
    if checked_strategy(strategy) in SIGNATURES:
        signature = strategy
        planner = planner_on(graph, objective, signature=signature)
        best = planner.decide(actions, proof="none").best
        seconds = time.perf_counter() - begin
        return Choice(best, planner.decide(actions), seconds)
    if strategy == "optimum":
        decision = planner_on(graph, objective).decide(actions, proof="optimal")
        return Choice(decision.best, decision, time.perf_counter() - begin)
    if strategy == "standard":
        action = int(np.argmin(planner_on(graph, objective).entropies(actions)))
    elif strategy == "random":
        action = int(rng.integers(len(actions)))
    else:
        forced = _FORCED.fullmatch(strategy)
        place = int(forced[1]) if forced else 1  # of the shortest
        action = int(np.argsort(lengths, kind="stable")[min(place, len(lengths)) - 1])
    return Choice(action, None, time.perf_counter() - begin)
