"""The order of actions by signature, and which of them are the same.

Each score is rounded to `_DIGITS` binary digits of the larger of the signature, the cost and 1; actions go by the rounded score,
and by index where it is the same.

*The order of two actions depends on these two alone*, since it compares two numbers, each of which is a function of one action.
So another action, however badly scaled, never reorders them.

*Two scores that differ by more than the larger of their steps* (one unit of the last digit kept) are in their own order: rounding
moves each of them by at most half of its step.

*A tolerance would not do.* "Scores that differ by less than their errors are ties and go by index" is no order: of the scores
0, 0.9 and 1.8 with errors of 0.5, listed so, the first precedes the second and the second the third by index, yet the third precedes
the first by its score. Whatever breaks that circle looks at a third action to order two. Nor is a tolerance of use. An estimate of an
error says how far off a score may be, not that two scores are equal; between scores that it cannot tell apart the computed order
is no worse than that of the indices, and much better where the estimate is too large, or where errors are shared, as that of the
prior is. Certificates need neither: the theorem and the proof hold along any order.

So many digits are kept that the last one (2e-6 nats in a score of ten thousand) matters to nobody, and so few that rounding, which is
thousands of times smaller on well-conditioned graphs, hardly ever separates scores that are equal but were computed differently.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.graph.action import Action

_DIGITS = 32


def ranking_of(signatures: FloatArray, costs: FloatArray) -> IntArray:
    """Indices by descending `signatures - costs`, ties by index; all of shape (K,)."""
    scale = np.maximum(1.0, np.maximum(np.abs(signatures), np.abs(costs)))
    step = np.ldexp(1.0, np.frexp(scale)[1] - _DIGITS)
    return np.argsort(-step * np.rint((signatures - costs) / step), kind="stable")


def first_alike(actions: Sequence[Action]) -> IntArray:
    """For each action, the first with the same poses, edges and information, shape (K,); labels and costs may differ."""
    first: dict[Hashable, int] = {}
    return np.array([first.setdefault(_content(action), index) for index, action in enumerate(actions)], dtype=np.int64)


def _content(action: Action) -> Hashable:
    """What is the same for two actions exactly if they add the same poses and measurements."""
    information = action.information
    if len(information) and (information == information[0]).all():
        information = information[:1]
    return action.poses.shape, *((array + 0).tobytes() for array in (action.poses, action.edges, information))  # -0. is 0.
