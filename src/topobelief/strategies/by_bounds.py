"""The best candidate by a signature; bounds of the objective say afterwards what that may lose."""

from __future__ import annotations

from topobelief.strategies.choice import Answer, Reasons
from topobelief.strategies.question import Question


def by_bounds(name: str, question: Question) -> Answer:
    """The first of the ranking by the signature of that name."""
    planner = question.planner(name)

    def reasons() -> Reasons:
        decision = planner.decide(question.actions)
        return Reasons.of(decision, scores=decision.signatures)

    return planner.decide(question.actions, proof="none").best, reasons
