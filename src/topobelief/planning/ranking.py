"""The order of actions by signature, and which of them are the same.

A score is rounded to `_DIGITS` binary digits of the larger of the signature, the cost and 1. Actions are ordered by rounded
score, largest first, and by index where these are equal.

*The order of two actions depends on these two alone*, since it compares two numbers, each of which is a function of one
action and its index. So another action, however badly scaled, never reorders them.

*Two scores that differ by more than the last digit kept* of either keep their order: rounding moves each of them by at
most half of its last digit.

*Why are scores that differ by less than their errors not all ties?* Because that would be no order. Take the scores 0, 0.9 and
1.8 with errors of 0.5, listed so: by index the first precedes the second and the second the third, but by score the third
precedes the first. Any rule that breaks this circle would have to look at a third action to order two. Nor would such ties be
of use: the estimate of an error says how far off a score may be, not that two scores are equal. Where it cannot tell two apart,
the order of the computed scores is no worse a guess than that of the indices, and a better one where the estimate is too large
or where two errors are mostly the same, as those that stem from the prior are. Certificates need neither: theorem and proof
hold along any order.

*How many digits?* So many that the last one does not matter (4e-6 nats in a score of ten thousand), and so few that scores
which are equal but were computed differently are hardly ever separated: on well-conditioned graphs rounding is thousands of
times smaller.
"""

from __future__ import annotations

from collections import Counter
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
    outlines = [_outline(action) for action in actions]
    count = Counter(outlines)
    first: dict[Hashable, int] = {}
    places = [
        index if count[outline] == 1 else first.setdefault(_content(action), index)
        for index, (action, outline) in enumerate(zip(actions, outlines, strict=True))
    ]
    return np.array(places, dtype=np.int64)


def _outline(action: Action) -> Hashable:
    """What equal actions have in common and most others do not: cheap to compare."""
    return len(action.edges), action.poses.shape, *(action.poses[-1].tolist() if len(action.poses) else ())


def _content(action: Action) -> Hashable:
    """What is the same for two actions exactly if they add the same poses and measurements."""
    information = action.information
    if len(information) and (information == information[0]).all():
        information = information[:1]
    return action.poses.shape, *((array + 0).tobytes() for array in (action.poses, action.edges, information))  # -0. is 0.
