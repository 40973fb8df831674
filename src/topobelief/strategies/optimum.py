"""The best candidate by the objective, proven with as few exact entropies as the bounds allow."""

from __future__ import annotations

from topobelief.strategies.choice import Answer, Reasons
from topobelief.strategies.question import Question


def optimum(name: str, question: Question) -> Answer:
    """The least objective, searched for along the ranking by the signature that goes with it."""
    decision = question.planner().decide(question.actions, proof="optimal")
    return decision.best, lambda: Reasons.of(decision)
