"""The k-th shortest path, for experiments in which the choice is given: "path-1", "path-2", …"""

from __future__ import annotations

import numpy as np

from topobelief.strategies.choice import Answer, Reasons
from topobelief.strategies.question import Question


def path_k(name: str, question: Question) -> Answer:
    """The k-th shortest, or the longest where there are fewer."""
    place = int(name.removeprefix("path-"))
    order = np.argsort(question.lengths, kind="stable")
    return int(order[min(place, len(order)) - 1]), Reasons
