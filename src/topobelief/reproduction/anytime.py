"""The best action found so far against exact evaluations made, for orders in which candidates may be evaluated.

A good order finds the best early: the curve is what a robot has if it must stop. Beside the three signatures stand the order in
which candidates come (shortest first, which is what exhaustive evaluation does) and a random order, of which the expected
curve is exact: of k values drawn without replacement, the one of rank i (from 0) is the least in C(K - 1 - i, k - 1) of C(K, k)
draws.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.reproduction.planning_sessions import ActionRow, cases
from topobelief.reproduction.real_graphs import RealActionRow

SIGNATURE_ORDERS = ("spanning_trees", "von_neumann", "von_neumann_approx")
ORDERS = (*SIGNATURE_ORDERS, "exhaustive", "random")


@dataclass(frozen=True, slots=True)
class AnytimeRow:
    """A point of a curve: the mean over decisions after some evaluations.

    Attributes
    ----------
    prior
    xi
        rad/m; nan where noise is that of a file.
    order
        One of `ORDERS`.
    evaluations
    loss
        Joint entropy of the best so far minus the least of all candidates, nats.
    share
        The same as a share of what separates the best candidate from the worst.
    num_decisions
        Behind the means.
    """

    prior: str
    xi: float
    order: str
    evaluations: int
    loss: float
    share: float
    num_decisions: int


def anytime_rows(sessions: Sequence[ActionRow], real: Sequence[RealActionRow]) -> list[AnytimeRow]:
    """Curves of all sessions, means over seeds, and of all files; a decision with fewer candidates stays at its last value."""
    groups: dict[tuple[str, float], list[Mapping[str, FloatArray]]] = {}
    for (name, xi, _), rows in cases(sessions).items():
        groups.setdefault((name, xi), []).append(_losses([row.joint for row in rows], _scores(rows)))
    by_file: dict[str, list[RealActionRow]] = {}
    for row in real:
        by_file.setdefault(row.prior, []).append(row)
    for name, rows in by_file.items():
        groups[name, math.nan] = [_losses([row.joint for row in rows], _scores(rows))]
    return [row for (name, xi), decisions in groups.items() for row in _means(name, xi, decisions)]


def best_so_far(values: Sequence[float] | FloatArray, order: Iterable[int]) -> FloatArray:
    """Least value after 1, 2, … evaluations, minus the least of all; shape (K,)."""
    J = np.asarray(values, dtype=np.float64)
    return np.minimum.accumulate(J[list(order)]) - J.min()


def best_so_far_at_random(values: Sequence[float] | FloatArray) -> FloatArray:
    """The expectation of `best_so_far` over all orders, shape (K,).

    Examples
    --------
    >>> best_so_far_at_random([0.0, 6.0])
    array([3., 0.])
    """
    J = np.sort(np.asarray(values, dtype=np.float64))
    K = len(J)
    chances = [[math.comb(K - 1 - i, k - 1) / math.comb(K, k) for i in range(K)] for k in range(1, K + 1)]
    return np.array(chances) @ (J - J[0])


def _scores(rows: Sequence[ActionRow] | Sequence[RealActionRow]) -> dict[str, FloatArray]:
    return {name: np.array([getattr(row, name) for row in rows], dtype=np.float64) for name in SIGNATURE_ORDERS}


def _losses(values: Sequence[float], scores: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """A curve an order, with the spread of the values beside them; orders whose signature is unknown are left out."""
    curves = {
        name: best_so_far(values, np.argsort(-score, kind="stable").tolist())
        for name, score in scores.items()
        if not np.isnan(score).any()
    }
    curves["exhaustive"] = best_so_far(values, range(len(values)))
    curves["random"] = best_so_far_at_random(values)
    curves["spread"] = np.array([max(values) - min(values)])
    return curves


def _means(prior: str, xi: float, decisions: Sequence[Mapping[str, FloatArray]]) -> list[AnytimeRow]:
    length = max(len(decision["random"]) for decision in decisions)
    rows: list[AnytimeRow] = []
    for order in ORDERS:
        if not all(order in decision for decision in decisions):
            continue
        curves = np.stack([np.pad(decision[order], (0, length - len(decision[order])), "edge") for decision in decisions])
        spreads = np.array([decision["spread"] for decision in decisions])
        shares = np.divide(curves, spreads, out=np.zeros_like(curves), where=spreads > 0)
        means = zip(curves.mean(axis=0).tolist(), shares.mean(axis=0).tolist(), strict=True)
        rows += [
            AnytimeRow(prior, xi, order, count, loss, share, len(decisions)) for count, (loss, share) in enumerate(means, 1)
        ]
    return rows
