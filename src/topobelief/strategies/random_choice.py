"""A path at random."""

from __future__ import annotations

import numpy as np

from topobelief.strategies.choice import Answer, Reasons
from topobelief.strategies.question import Question


def random_choice(name: str, question: Question) -> Answer:
    """The largest of the random scores that came with the question."""
    scores = question.random_scores
    return int(np.argmax(scores)), lambda: Reasons(scores=scores)
