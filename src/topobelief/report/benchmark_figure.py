"""How the time for a decision grows with the map: one line a method over the sizes of the generated graphs."""

from __future__ import annotations

from typing import Any, cast

from matplotlib.figure import Figure

from topobelief.benchmark.run import BenchmarkResult
from topobelief.benchmark.timing import MethodTime, SessionTimes
from topobelief.report import style

_WIDTH, _HEIGHT = 7.2, 4.4  # inches
_LINES: tuple[tuple[str, str, str, str], ...] = (  # method, what the figure calls it, colour, dashes
    ("rAMDL on iSAM2's joint marginals", "rAMDL, iSAM2 marginals", style.RULED_OUT, ":"),
    ("GTSAM", "standard BSP, GTSAM", style.INK, "-"),
    ("standard BSP, sparse LDLᵀ", "standard BSP, sparse LDLᵀ", style.INK, "--"),
    ("t-BSP from scratch, s_ST", "t-BSP from scratch, s_ST", style.MUTED, "-."),
    ("exact J of all", "exact J of all", style.SURVIVOR, "--"),
    ("proven optimum", "proven optimum", style.BEST, "-"),
    ("signature and Fischer bounds", "s_ST and bounds", style.SURVIVOR, "-"),
    ("signature s_ST", "s_ST", style.PREDICTED_CLOSURE, "-"),
    ("signature ŝ_VN", "ŝ_VN", style.PREDICTED_CLOSURE, ":"),
)
_PLOT = (0.085, 0.115, 0.60, 0.74)  # of the figure
_LABEL_HEIGHT = 0.155  # inches


def draw_benchmark(result: BenchmarkResult) -> Figure | None:
    """Total seconds of a session against the poses of its graph, both logarithmic; None for fewer than two generated graphs."""
    sessions = sorted(
        (session for session in result.sessions if session.name.startswith("generated")), key=lambda session: session.num_poses
    )
    if len(sessions) < 2:
        return None
    with style.style():
        figure = Figure(figsize=(_WIDTH, _HEIGHT))
        axes = cast("Any", figure).add_axes(_PLOT)
        axes.set_xscale("log")
        axes.set_yscale("log")
        ends: list[tuple[float, str, str]] = []
        for method, name, colour, dashes in _LINES:
            points = [
                (session.num_poses, row.total) for session in sessions if (row := _row(session, method)) and row.num_timed
            ]
            if points:
                axes.plot(*zip(*points, strict=True), color=colour, linestyle=dashes, linewidth=1.4, marker="o", markersize=3)
                if points[-1][0] == sessions[-1].num_poses:
                    ends.append((points[-1][1], name, colour))
        bottom, top = axes.get_ylim()
        least_ratio = (top / bottom) ** (_LABEL_HEIGHT / (_PLOT[3] * _HEIGHT))
        for at, (value, name, colour) in zip(_spread([end[0] for end in sorted(ends)], least_ratio), sorted(ends), strict=True):
            right = sessions[-1].num_poses
            axes.annotate(
                f"{name}  {_seconds(value)}",
                (right, value),
                xytext=(right * (right / sessions[0].num_poses) ** 0.04, at),
                color=colour,
                fontsize=8,
                va="center",
                annotation_clip=False,
                arrowprops={"arrowstyle": "-", "color": style.GRID, "linewidth": 0.7, "shrinkA": 0, "shrinkB": 3},
            )
        for spine in ("top", "right"):
            axes.spines[spine].set_visible(False)
        axes.grid(axis="y", color=style.GRID, linewidth=0.6)
        axes.set_axisbelow(True)
        axes.minorticks_off()
        axes.set_xticks([session.num_poses for session in sessions], [f"{session.num_poses:,}" for session in sessions])
        axes.set_xlabel("poses of the map")
        axes.set_ylabel(f"seconds for {sessions[0].num_actions:,} candidates, set-up included")
        write = cast("Any", figure).text
        write(0.085, 0.945, f"Deciding among {sessions[0].num_actions:,} candidate paths", fontsize=10.5)
        write(
            0.085,
            0.9,
            f"each of {sessions[0].num_new_poses:.0f} new poses and some {sessions[0].num_closures:.0f} loop closures; "
            f"black: from scratch, colour: this engine",
            color=style.MUTED,
        )
    return figure


def _row(session: SessionTimes, method: str) -> MethodTime | None:
    if method == "GTSAM":
        return session.gtsam
    return next((row for row in session.methods if row.name == method), None)


def _spread(values: list[float], least_ratio: float) -> list[float]:
    """Where labels of ascending values stand so that they do not touch."""
    places: list[float] = []
    for value in values:
        places.append(max(value, places[-1] * least_ratio) if places else value)
    return places


def _seconds(value: float) -> str:
    if value >= 7200:
        return f"{value / 3600:.0f} h"
    if value >= 120:
        return f"{value / 60:.0f} min"
    return f"{value:.0f} s" if value >= 10 else f"{value:.2g} s"
