"""Standard belief space planning: the exact objective of every candidate."""

from __future__ import annotations

import numpy as np

from topobelief.strategies.choice import Answer, Reasons
from topobelief.strategies.question import Question


def standard(name: str, question: Question) -> Answer:
    """The least objective of all."""
    values = question.values()
    best = int(np.argmin(values))
    least = float(values[best])
    return best, lambda: Reasons(
        lower=least, upper=least, error_bound=0.0, num_survivors=1, num_evaluations=len(values), proven_optimal=True
    )
