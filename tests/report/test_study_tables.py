"""The table of a study in a terminal."""

from __future__ import annotations

import math

import numpy as np
from rich.console import Console

from topobelief.report.study_tables import summary_table
from topobelief.study.summary import Share, Spread, Summary


def summary(strategy: str, losses: list[float], *, session: str = "S1", num_failed: int = 0) -> Summary:
    sample, none = np.array(losses), Spread.of(np.array([]))
    consistent = Share.of(sum(loss == 0 for loss in losses), len(losses))
    known = {"action_consistent": consistent, "order_consistent": Share.of(0, 0), "loss": Spread.of(sample)}
    numbers = {"evaluations": Spread.of(0 * sample), "seconds": Spread.of(0 * sample + 0.0125)}
    return Summary(
        "office", session, "map", strategy, 0.1, 0.035, 0.35, len(losses), num_failed,
        **known, **numbers, spearman=none, survivors=none,
    )  # fmt: skip


def lines(*found: Summary) -> list[str]:
    console = Console(width=120, record=True, file=None, quiet=False)
    with console.capture() as capture:
        console.print(summary_table(found))
    return [line.strip() for line in capture.get().splitlines() if line.strip()]


def test_strategies_stand_under_their_session_the_best_first_and_failures_last():
    shown = lines(
        summary("optimum", [], num_failed=4),
        summary("random", [3.0, 1.0, 0.0, 8.0]),
        summary("spanning_trees", [0.0, 0.0, 0.0, 0.5]),
        summary("random", [0.0], session="[S2]"),
    )
    names = [line.split()[0] for line in shown[2:8]]
    assert names == ["S1", "spanning_trees", "random", "optimum", "[S2]", "random"]
    assert shown[2] == "S1 in office, map (nats), ξ = 0.35"
    assert shown[3].split() == ["spanning_trees", "75%", "30–95", "0.12", "0.35", "–", "0.0", "12.5", "4", "–"]
    assert shown[5].split() == ["optimum", *["–"] * 8, "4"]


def test_an_empty_sample_is_nan():
    assert math.isnan(Spread.of(np.array([math.nan])).mean)
