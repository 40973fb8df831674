"""How a path is chosen among candidates: by a signature, by exact entropies, by a proof, or without any of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.bounds.entropy_bounds import Determinant
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision import Decision
from topobelief.planning.planner import Planner
from topobelief.planning.registry import SIGNATURES

STRATEGIES = ("spanning_trees", "von_neumann", "von_neumann_approx", "optimum", "standard", "shortest", "random")
"""Three signatures; "optimum" proves the best by s_ST's ranking; "standard" evaluates all; the last two ignore the graph."""


@dataclass(frozen=True, eq=False, slots=True)
class Question:
    """A decision to make.

    Attributes
    ----------
    graph
    actions
        K of them.
    lengths : shape (K,)
        Of the paths, metres.
    objective, bounds, determinant
        As the planner takes them.
    """

    graph: PoseGraph
    actions: Sequence[Action]
    lengths: FloatArray
    objective: str
    bounds: str
    determinant: Determinant

    def planner(self, signature: str = "spanning_trees") -> Planner:
        """For this question; dense spectra are welcome, since the strategy was asked for by name."""
        return Planner(
            self.graph,
            objective=self.objective,
            signature=signature,
            bounds=self.bounds,
            determinant=self.determinant,
            allow_dense_spectrum=True,
        )


@dataclass(frozen=True, eq=False, slots=True)
class Choice:
    """What a strategy answers.

    Attributes
    ----------
    action : int
    scores : shape (K,), or None
        What it ranks the candidates by, the larger, the better; None where the best alone is sought.
    lower, upper : float or None
        Bounds of the chosen one's objective, where the strategy asks for any.
    error_bound : float or None
        No candidate is better than the chosen one by more than this, nats.
    num_survivors : int or None
        Candidates that the bounds leave.
    num_evaluations : int
        Exact entropies that it took.
    proven_optimal : bool
    seconds : float
        From the question to the answer.
    """

    action: int
    scores: FloatArray | None
    lower: float | None = None
    upper: float | None = None
    error_bound: float | None = None
    num_survivors: int | None = None
    num_evaluations: int = 0
    proven_optimal: bool = False
    seconds: float = 0.0


def choose(strategy: str, question: Question, *, rng: np.random.Generator) -> Choice:
    """The choice of one of `STRATEGIES`; only "random" draws from `rng`."""
    begin = time.perf_counter()
    if strategy in SIGNATURES:
        choice = _by_bounds(question, strategy)
    else:
        choose_by: dict[str, Callable[[], Choice]] = {
            "optimum": lambda: _by_proof(question),
            "standard": lambda: _by_entropies(question),
            "shortest": lambda: _by_scores(-question.lengths),
            "random": lambda: _by_scores(rng.permutation(len(question.actions)).astype(np.float64)),
        }
        choice = choose_by[strategy]()
    return replace(choice, seconds=time.perf_counter() - begin)


def _by_bounds(question: Question, signature: str) -> Choice:
    decision = question.planner(signature).decide(question.actions)
    return _certified(decision, decision.signatures)


def _by_proof(question: Question) -> Choice:
    return _certified(question.planner().decide(question.actions, proof="optimal"), None)


def _certified(decision: Decision, scores: FloatArray | None) -> Choice:
    return Choice(
        action=decision.best,
        scores=scores,
        lower=float(decision.lower[decision.best]),
        upper=float(decision.upper[decision.best]),
        error_bound=decision.error_bound,
        num_survivors=len(decision.survivors),
        num_evaluations=decision.num_evaluations,
        proven_optimal=decision.proven_optimal,
    )


def _by_entropies(question: Question) -> Choice:
    values = question.planner().entropies(question.actions)
    best = int(np.argmin(values))
    least = float(values[best])
    return Choice(best, None, least, least, 0.0, 1, len(values), proven_optimal=True)


def _by_scores(scores: FloatArray) -> Choice:
    return Choice(int(np.argmax(scores)), scores)
