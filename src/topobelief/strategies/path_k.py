"""The path of a given label, for experiments in which the choice is given: "path-0", the shortest, "path-1", …"""

from __future__ import annotations

import numpy as np

from topobelief.strategies.choice import Answer, Reasons
from topobelief.strategies.question import Question


def path_k(name: str, question: Question) -> Answer:
    """The one that k are shorter than, or the longest where there are fewer."""
    label = int(name.removeprefix("path-"))
    order = np.argsort(question.lengths, kind="stable")
    return int(order[min(label, len(order) - 1)]), Reasons
