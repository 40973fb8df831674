"""Claims about time: topology beside standard planning, in the planning sessions and on random pose graphs."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence

from topobelief.reproduction.claims.claim import IN_SESSIONS, IN_SYNTHETIC, Claim
from topobelief.reproduction.planning_sessions import SESSIONS
from topobelief.reproduction.random_graphs import RandomGraphRow
from topobelief.reproduction.time_per_action import (
    ENGINE_BOUNDS,
    ENGINE_RANKING,
    STANDARD,
    STANDARD_WITH_GRAPH,
    TimeRow,
)

TIMES_FASTER = 10.0
"""An order of magnitude."""

SMALL_SHARE = 0.1
"""Of the time of standard planning, which bounds may add."""


def session_speed_claims(rows: Sequence[TimeRow]) -> list[Claim]:
    """An action, medians."""
    found: list[Claim] = []
    published = {"S1": "8–19 ms and 1.3 ms", "S2": "38–75 ms and 1.5–2.2 ms"}
    for session in SESSIONS:
        medians = _median_seconds(rows, session)
        seeds = len({(row.seed, row.xi) for row in rows if row.session == session})
        ratios = [_ratio(rows, session, key, STANDARD, "s_ST") for key in _timed_cases(rows, session)]
        with_graph = [_ratio(rows, session, key, STANDARD_WITH_GRAPH, "s_ST") for key in _timed_cases(rows, session)]
        found.append(
            Claim(
                topic="speed",
                claim="s_ST is an order of magnitude faster than standard planning",
                where=IN_SESSIONS,
                scope=session,
                measured=f"{1e3 * medians[STANDARD]:.2g} ms and {1e3 * medians['s_ST']:.2g} ms an action: "
                f"{statistics.median(ratios):.2g} times, {statistics.median(with_graph):.2g} with building GTSAM's graph",
                threshold="median time an action at least 10 times smaller",
                cases=seeds,
                holding=sum(ratio >= TIMES_FASTER for ratio in ratios),
                holds=statistics.median(ratios) >= TIMES_FASTER,
                published=published[session],
            )
        )
        keys = _timed_cases(rows, session)
        extra = statistics.median(_bounds_seconds(rows, session, key) for key in keys)
        shares = [_bounds_seconds(rows, session, key) / _seconds_of(rows, session, key, STANDARD) for key in keys]
        found.append(
            Claim(
                topic="speed",
                claim="bounds cost little beside standard planning",
                where=IN_SESSIONS,
                scope=session,
                measured=f"Fischer's bounds add {1e3 * extra:.2g} ms an action to s_ST: "
                f"{100 * statistics.median(shares):.0f} % of standard planning, "
                f"{100 * extra / medians[STANDARD_WITH_GRAPH]:.0f} % with building its graph",
                threshold="what bounds add to s_ST is at most 10 % of standard planning (medians)",
                cases=len(keys),
                holding=sum(share <= SMALL_SHARE for share in shares),
                holds=statistics.median(shares) <= SMALL_SHARE,
                published="",
            )
        )
    return found


def random_graph_speed_claims(rows: Sequence[RandomGraphRow]) -> list[Claim]:
    """From scratch, at every size."""
    found: list[Claim] = []
    quotients: tuple[tuple[str, str, Callable[[RandomGraphRow], float], float], ...] = (
        (
            "ŝ_VN is faster than s_ST on every graph size",
            "t_ST / t_ŝVN",
            lambda row: row.spanning_trees_seconds / row.von_neumann_approx_seconds,
            1.0,
        ),
        (
            "ŝ_VN is an order of magnitude faster than standard planning",
            "t_standard / t_ŝVN",
            lambda row: row.standard_seconds / row.von_neumann_approx_seconds,
            TIMES_FASTER,
        ),
        (
            "s_ST is an order of magnitude faster than standard planning",
            "t_standard / t_ST",
            lambda row: row.standard_seconds / row.spanning_trees_seconds,
            TIMES_FASTER,
        ),
    )
    sizes = sorted({row.num_poses for row in rows})
    for text, quotient, of, least in quotients:
        medians = [statistics.median(of(row) for row in rows if row.num_poses == n) for n in sizes]
        found.append(
            Claim(
                topic="speed",
                claim=text,
                where=IN_SYNTHETIC,
                scope=f"n = {', '.join(map(str, sizes))}",
                measured=f"{quotient} (medians): {', '.join(f'{value:.2g}' for value in medians)}",
                threshold=f"at least {least:g} at every n",
                cases=len(sizes),
                holding=sum(value >= least for value in medians),
                holds=all(value >= least for value in medians),
                published="",
            )
        )
    return found


def _timed_cases(rows: Sequence[TimeRow], session: str) -> list[tuple[int, float]]:
    return sorted({(row.seed, row.xi) for row in rows if row.session == session})


def _seconds_of(rows: Sequence[TimeRow], session: str, case: tuple[int, float], method: str) -> float:
    return next(r.median for r in rows if (r.session, (r.seed, r.xi), r.method) == (session, case, method))


def _ratio(rows: Sequence[TimeRow], session: str, case: tuple[int, float], slow: str, fast: str) -> float:
    return _seconds_of(rows, session, case, slow) / _seconds_of(rows, session, case, fast)


def _bounds_seconds(rows: Sequence[TimeRow], session: str, case: tuple[int, float]) -> float:
    """What Fischer's bounds add to the engine's ranking."""
    with_bounds, ranking = (_seconds_of(rows, session, case, method) for method in (ENGINE_BOUNDS, ENGINE_RANKING))
    return max(0.0, with_bounds - ranking)


def _median_seconds(rows: Sequence[TimeRow], session: str) -> dict[str, float]:
    methods = {row.method for row in rows}
    return {
        method: statistics.median(row.median for row in rows if (row.session, row.method) == (session, method))
        for method in methods
    }
