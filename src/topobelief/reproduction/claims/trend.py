"""Claims about random pose graphs: signatures follow the entropy within a size, and may jump from size to size."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.planning.decision_quality import rank_correlation
from topobelief.reproduction.claims.claim import IN_SYNTHETIC, SIGNATURES, Claim
from topobelief.reproduction.random_graphs import RandomGraphRow

FOLLOWS = 0.9
"""Rank correlation from which a signature follows the entropy."""

SAME_SLOPE = 0.1
"""By how much slopes may differ that are called the same."""


def trend_claims(rows: Sequence[RandomGraphRow]) -> list[Claim]:
    """Of signatures over random graphs: within each size, and over all sizes."""
    sizes = sorted({row.num_poses for row in rows})
    found: list[Claim] = []
    for name in ("spanning_trees", "von_neumann_approx", "von_neumann_normalized"):
        within = [graph_correlation([row for row in rows if row.num_poses == n], name) for n in sizes]
        found.append(
            Claim(
                topic="trend",
                claim=f"{SIGNATURES[name]} follows the trend of the entropy at each size",
                where=IN_SYNTHETIC,
                scope=f"n = {', '.join(map(str, sizes))}",
                measured=f"rank correlation within n: {min(within):.3f} to {max(within):.3f}; "
                f"over all: {graph_correlation(rows, name):.3f}",
                threshold=f"at least {FOLLOWS} within every n",
                cases=len(sizes),
                holding=sum(value >= FOLLOWS for value in within),
                holds=all(value >= FOLLOWS for value in within),
                published="",
            )
        )
    for name, claim, where in (
        ("von_neumann_approx", "ŝ_VN jumps where n changes", IN_SYNTHETIC),
        ("von_neumann_normalized", "normalising ŝ_VN by the noise removes the jumps", "closing remark"),
        ("spanning_trees", "s_ST does not jump where n changes", IN_SYNTHETIC),
    ):
        slopes = slope_ratio(rows, name)
        jumps = not 1 - SAME_SLOPE <= slopes <= 1 + SAME_SLOPE
        holds = jumps == (name == "von_neumann_approx")
        found.append(
            Claim(
                topic="trend",
                claim=claim,
                where=where,
                scope="all sizes",
                measured=f"J falls {slopes:.3g} times as steeply in {SIGNATURES[name]} within a size as from size to size",
                threshold=f"{'not ' if name == 'von_neumann_approx' else ''}the same slope to {100 * SAME_SLOPE:.0f} %",
                cases=1,
                holding=int(holds),
                holds=holds,
                published="",
            )
        )
    return found


def graph_correlation(rows: Sequence[RandomGraphRow], signature: str) -> float:
    """Spearman's rank correlation of J with minus a signature."""
    return rank_correlation([row.joint for row in rows], [-getattr(row, signature) for row in rows])


def slope_ratio(rows: Sequence[RandomGraphRow], signature: str) -> float:
    """Slope of J against a signature within a size (median), over the slope through the means of the sizes."""
    sizes = sorted({row.num_poses for row in rows})
    groups = [np.array([(getattr(row, signature), row.joint) for row in rows if row.num_poses == n]) for n in sizes]
    between = _slope(np.array([group.mean(axis=0) for group in groups]))
    return statistics.median(_slope(group) for group in groups) / between


def _slope(points: FloatArray) -> float:
    """Of the least-squares line through points, shape (N, 2)."""
    x, y = (points - points.mean(axis=0)).T
    return float(x @ y / (x @ x))
