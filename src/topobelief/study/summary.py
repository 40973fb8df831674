"""What the rows of a study say of each strategy: how often it chose the best, what it lost, how it ranked, what it cost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from scipy import stats

from topobelief.arrays import FloatArray
from topobelief.study.dataset import Table
from topobelief.study.session import Row

_GROUP = ("world", "session", "objective", "xi", "sigma_p", "sigma_theta", "strategy")


@dataclass(frozen=True, slots=True)
class Spread:
    """Mean and quantiles of a sample; nan where it is empty."""

    mean: float
    low: float  # 10 %
    first: float  # quartile
    median: float
    third: float
    high: float  # 90 %
    largest: float

    @classmethod
    def of(cls, sample: FloatArray) -> Spread:
        """Of the numbers that are not nan."""
        known = sample[~np.isnan(sample)]
        if len(known) == 0:
            return cls(*[math.nan] * 7)
        quantiles: list[float] = np.quantile(known, [0.1, 0.25, 0.5, 0.75, 0.9, 1.0]).tolist()
        return cls(float(known.mean()), *quantiles)


@dataclass(frozen=True, slots=True)
class Share:
    """How much of a sample is so, with the 95 % interval of Wilson (1927); nan where it is empty."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, count: int, total: int) -> Share:
        """Of `total` cases of which `count` are so."""
        if total == 0:
            return cls(math.nan, math.nan, math.nan)
        interval = stats.binomtest(count, total).proportion_ci(method="wilson")
        return cls(count / total, float(interval.low), float(interval.high))


@dataclass(frozen=True, slots=True)
class Summary:
    """All seeds of one strategy at one noise, for one objective, in one session.

    Attributes
    ----------
    world, session, objective, strategy : str
    sigma_p, sigma_theta, xi : float
    num_ok, num_failed : int
        Tasks.
    action_consistent : Share
        Choices that lose nothing.
    order_consistent : Share
        Rankings that keep the order of all candidates.
    loss : Spread
        In the unit of the objective: metres for "error", else nats.
    spearman : Spread
        Rank correlation of the objective with minus the score.
    evaluations : Spread
        Exact ones before the answer.
    survivors : Spread
    seconds : Spread
        Of the decision alone.
    """

    world: str
    session: str
    objective: str
    strategy: str
    sigma_p: float
    sigma_theta: float
    xi: float
    num_ok: int
    num_failed: int
    action_consistent: Share
    order_consistent: Share
    loss: Spread
    spearman: Spread
    evaluations: Spread
    survivors: Spread
    seconds: Spread


def summaries(table: Table) -> list[Summary]:
    """One for each combination but the seed, sorted by all of them."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in table.to_pylist():
        groups.setdefault(tuple(row[name] for name in _GROUP), []).append(row)
    return [_summary(groups[key]) for key in sorted(groups)]


def _summary(rows: Sequence[Row]) -> Summary:
    ok, labels = [row for row in rows if row["status"] == "ok"], rows[0]

    def spread(name: str) -> Spread:
        return Spread.of(np.array([row[name] for row in ok], dtype=np.float64))  # None becomes nan

    def share(name: str) -> Share:
        known = [row[name] for row in ok if row[name] is not None]
        return Share.of(sum(map(bool, known)), len(known))

    return Summary(
        **{name: labels[name] for name in _GROUP},  # pyright: ignore[reportArgumentType]  (as their columns say)
        num_ok=len(ok),
        num_failed=len(rows) - len(ok),
        action_consistent=share("action_consistent"),
        order_consistent=share("order_consistent"),
        loss=spread("loss"),
        spearman=spread("spearman"),
        evaluations=spread("num_evaluations"),
        survivors=spread("num_survivors"),
        seconds=spread("decision_seconds"),
    )


def flat(summary: Summary) -> dict[str, str | int | float]:
    """Names and values for a line of CSV."""
    line: dict[str, str | int | float] = {}
    for field in fields(Summary):
        value = getattr(summary, field.name)
        if isinstance(value, (Spread, Share)):
            parts = {part.name: getattr(value, part.name) for part in fields(value)}
            line |= {f"{field.name}_{part}".removesuffix("_value"): number for part, number in parts.items()}
        else:
            line[field.name] = value
    return line
