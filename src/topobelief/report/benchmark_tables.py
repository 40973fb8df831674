"""What a benchmark measured, as tables for a terminal: ratios first, then seconds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from rich import box
from rich.table import Table

from topobelief.benchmark.predicted import BoundsOfCandidates
from topobelief.benchmark.run import BenchmarkResult
from topobelief.benchmark.timing import SessionTimes


def benchmark_tables(result: BenchmarkResult) -> Iterable[Table | str]:
    """One table a session, then memory, error bounds, proofs and kinds of candidates."""
    clock = "; times are of the processor, all threads together" if result.plan.cpu_time else ""
    yield "; ".join(f"{name} {value}" for name, value in result.machine.items()) + clock
    for session in result.sessions:
        yield session_table(session, (result.degree_seconds or {}).get(session.name))
    if result.memory:
        table = _table(
            "Peak memory of a process, GB",
            "graph",
            "session alone",
            "ranking with Fischer bounds",
            "exact J of all",
            "exact E of all",
        )
        for row in result.memory:
            table.add_row(row.name, *(f"{value:.2f}" for value in (row.session, row.bounds, row.exact, row.error)))
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
    if result.candidates:
        yield candidate_table(result.candidates)


def candidate_table(rows: Sequence[BoundsOfCandidates]) -> Table:
    """One row a graph, kind of candidates, objective and family."""
    columns = (
        "closures a path",
        "expected",
        "objective",
        "bounds",
        "width",
        "may be the best",
        "with bounds, s",
        "exact of all, s",
    )
    table = _table(
        f"{rows[0].num_actions} candidates of about 30 new poses by their closures",
        "graph",
        "candidates",
        *columns,
        caption=_rules(rows),
    )
    for row in rows:
        objective, unit = ("J", "nats") if row.objective == "joint" else ("E", "m")
        table.add_row(
            row.name,
            row.candidates,
            f"{row.num_closures:.0f}",
            f"{row.expected_closures:.1f}",
            objective,
            row.bounds,
            f"{row.width:.2g} {unit}",
            f"{row.num_survivors} of {row.num_actions}",
            _digits(row.seconds),
            _digits(row.exact_seconds),
        )
    return table


def _rules(rows: Sequence[BoundsOfCandidates]) -> str:
    rules = {(row.candidates, "" if row.candidates == "paper" else f"{row.name}, "): row.rule for row in rows}
    return "\n".join(f"{name}{candidates}: {rule}" for (candidates, name), rule in rules.items())


def session_table(session: SessionTimes, degree_seconds: float | None) -> Table:
    """One row a method."""
    landmarks = f"{session.num_landmarks} landmarks, " if session.num_landmarks else ""
    observations = f" and {session.num_observations:.0f} observations" if session.num_landmarks else ""
    title = (
        f"{session.name}: {session.num_poses} poses, {landmarks}{session.num_edges} edges; {session.num_actions} actions of "
        f"{session.num_new_poses:.0f} new poses, {session.num_closures:.0f} closures{observations}"
    )
    by_degrees = "" if degree_seconds is None else f" ŝ_VN takes {1e6 * degree_seconds:.1f} µs an action beyond its edges."
    table = _table(
        title, "", "× GTSAM", "× best from scratch", "all, s", "once, s", "an action, ms",
        caption=f"First answer in this process {session.first_answer:.1f} s.{by_degrees} "
        f"All ways to log det I and to E agree to {session.largest_deviation:.0e}.",
    )  # fmt: skip
    for method in session.methods:
        name = f"this engine: {method.name}" if method.kind == "engine" else method.name
        table.add_row(
            f"{name} ({method.note})" if method.note else name,
            *(_times(value) for value in session.ratios(method)),
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
        table.add_column(column, justify="left" if number == 0 or column in ("family", "bounds", "candidates") else "right")
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
