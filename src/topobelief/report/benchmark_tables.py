"""What a benchmark measured, as tables for a terminal: ratios first, then seconds."""

from __future__ import annotations

import math
from collections.abc import Iterable

from rich import box
from rich.table import Table

from topobelief.benchmark.run import BenchmarkResult, ratio
from topobelief.benchmark.timing import SessionTimes


def benchmark_tables(result: BenchmarkResult) -> Iterable[Table | str]:
    """One table a session, then memory, error bounds and proofs."""
    yield "; ".join(f"{name} {value}" for name, value in result.machine.items())
    for session in result.sessions:
        yield session_table(session, (result.degree_seconds or {}).get(session.name))
    if result.memory:
        table = _table(
            "Peak memory of a process, GB", "poses", "session alone", "ranking with Fischer bounds", "exact J of all"
        )
        for row in result.memory:
            table.add_row(f"{row.num_poses}", f"{row.session:.2f}", f"{row.bounds:.2f}", f"{row.exact:.2f}")
        yield table
    if result.error_bounds:
        first = result.error_bounds[0]
        title = (
            f"ΔJ_max on generated graphs of {first.num_poses} poses, {first.num_actions} candidates, "
            f"ξ = {first.sigma_rotation / first.sigma_position:.3g} rad/m, medians over {first.num_seeds} seeds"
        )
        table = _table(title, "loop closures", "family", "nats", "of the paper's")
        for row in result.error_bounds:
            for family, nats in row.error_bound.items():
                part = row.ratio[family]
                table.add_row(row.closures, family, f"{nats:.1f}", "1" if part == 1 else f"1/{1 / part:.0f}" if part else "0")
        yield table
    if result.proofs:
        columns = ("graph", "σ_θ", "bounds", "left by bounds", "exact values", "share", "seconds")
        table = _table(f"Proofs of the optimum, σ_p = {result.proofs[0].sigma_position} m", *columns)
        for row in result.proofs:
            share = row.num_evaluations / row.num_actions
            counts = f"{row.num_survivors} of {row.num_actions}", str(row.num_evaluations), f"{100 * share:.1f} %"
            table.add_row(row.name, f"{row.sigma_rotation}", row.bounds, *counts, f"{row.seconds:.2f}")
        yield table


def session_table(session: SessionTimes, degree_seconds: float | None) -> Table:
    """One row a method."""
    title = (
        f"{session.name}: {session.num_poses} poses, {session.num_edges} edges; {session.num_actions} actions of "
        f"{session.num_new_poses:.0f} new poses and {session.num_closures:.0f} closures"
    )
    by_degrees = "" if degree_seconds is None else f" ŝ_VN takes {1e6 * degree_seconds:.1f} µs an action beyond its edges."
    table = _table(
        title, "", "× GTSAM", "× best from scratch", "all, s", "once, s", "an action, ms",
        caption=f"First answer in this process {session.first_answer:.1f} s.{by_degrees} "
        f"All ways to log det I agree to {session.largest_deviation:.0e}.",
    )  # fmt: skip
    gtsam, best = session.gtsam, session.best_from_scratch
    for method in session.methods:
        name = f"this engine: {method.name}" if method.kind == "engine" else method.name
        table.add_row(
            f"{name} ({method.note})" if method.note else name,
            _times(ratio(gtsam and gtsam.total, method.total)),
            _times(ratio(best and best.total, method.total)),
            _digits(method.total),
            _digits(method.once),
            _digits(1e3 * method.per_action),
        )
    return table


def _table(title: str, *columns: str, caption: str | None = None) -> Table:
    table = Table(
        box=box.SIMPLE_HEAD, title=title, title_justify="left", caption=caption, caption_justify="left", pad_edge=False
    )
    for number, column in enumerate(columns):
        table.add_column(column, justify="left" if number == 0 or column in ("family", "bounds") else "right")
    return table


def _times(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}" if value >= 1 else f"{value:.2g}"


def _digits(value: float) -> str:
    if math.isinf(value):
        return "-"
    digits = 0 if value >= 100 else 1 if value >= 10 else 2 if value >= 1 else 3
    return f"{value:.{digits}f}"
