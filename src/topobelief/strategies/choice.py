"""The answer of a strategy: the chosen candidate, the seconds that the choice took, and the reasons for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from topobelief.arrays import FloatArray
from topobelief.planning.decision import Decision
from topobelief.search.result import Way
from topobelief.strategies.question import Question


@dataclass(frozen=True, eq=False, slots=True)
class Reasons:
    """What a strategy knows about its choice.

    Attributes
    ----------
    decision : Decision or None
        With ranking, bounds and certificate, where the strategy is one of the planner's.
    scores : shape (K,), or None
        What it ranks the candidates by, the larger, the better; None where it seeks the best alone.
    lower, upper : float or None
        Bounds of the objective of the chosen candidate, where the strategy computes any.
    error_bound : float or None
        No candidate is better than the chosen one by more than this, in the objective's unit.
    num_survivors : int or None
        Candidates that the bounds do not rule out.
    num_evaluations : int
        Exact values computed.
    proven_optimal : bool
    proposal : Way or None
        The chosen path, where the strategy has found one of its own.
    """

    decision: Decision | None = None
    scores: FloatArray | None = None
    lower: float | None = None
    upper: float | None = None
    error_bound: float | None = None
    num_survivors: int | None = None
    num_evaluations: int = 0
    proven_optimal: bool = False
    proposal: Way | None = None

    @classmethod
    def of(cls, decision: Decision, *, scores: FloatArray | None = None) -> Reasons:
        """Those that a decision of the planner gives."""
        return cls(
            decision=decision,
            scores=scores,
            lower=float(decision.lower[decision.best]),
            upper=float(decision.upper[decision.best]),
            error_bound=decision.error_bound,
            num_survivors=len(decision.survivors),
            num_evaluations=decision.num_evaluations,
            proven_optimal=decision.proven_optimal,
        )


@dataclass(frozen=True, eq=False, slots=True)
class Choice:
    """The answer of a strategy.

    Attributes
    ----------
    index : int
        Of the chosen candidate; their number K, where the strategy has found a path of its own.
    seconds : float
        Wall time from the question to the index. It includes building the planner (factoring the prior), signatures, and the
        bounds and exact values without which the strategy cannot name an index. It excludes what is computed afterwards to
        say how good the choice is (the bounds behind a ranking by signature), finding the candidates, and compiling kernels.
    reasons : Reasons
    """

    index: int
    seconds: float
    reasons: Reasons

    @property
    def decision(self) -> Decision | None:
        """That of the planner, where the strategy is one of its own."""
        return self.reasons.decision

    @property
    def proposal(self) -> Way | None:
        """The chosen path, where the strategy has found one of its own."""
        return self.reasons.proposal


Answer = tuple[int, Callable[[], Reasons]]
"""The index of the chosen candidate (K for a path of its own, which the reasons hold), and what computes the reasons, which the
seconds of a choice do not include."""


class Strategy(Protocol):
    """A way to choose."""

    def __call__(self, name: str, question: Question) -> Answer:
        """The answer to a question, asked by the name under which the strategy is registered."""
        ...
