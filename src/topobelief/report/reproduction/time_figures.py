"""Time: an action by each method in each session, and signatures on random graphs of growing size."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.figure import Figure

from topobelief.report import style
from topobelief.report.canvas import Entry
from topobelief.report.reproduction.panels import MARGIN, Grid, light_grid, plain_log_ticks
from topobelief.reproduction.planning_sessions import SESSIONS
from topobelief.reproduction.random_graphs import RandomGraphRow
from topobelief.reproduction.time_per_action import METHODS, TimeRow

_KINDS = {"standard": "#7A7A7A", "paper": style.BEST, "engine": style.SURVIVOR}
_KIND_LABELS = {"standard": "standard planning, GTSAM", "paper": "topological, from scratch", "engine": "this engine"}
_PUBLISHED: dict[str, dict[str, tuple[float, float]]] = {  # ms, read off the paper's plots
    "S1": {"standard BSP and its graph": (8, 19), "s_ST": (1.3, 1.3), "s_VN": (0.65, 1.0), "ŝ_VN": (0.05, 0.1)},
    "S2": {"standard BSP and its graph": (38, 75), "s_ST": (1.5, 2.2), "s_VN": (1.4, 1.7), "ŝ_VN": (0.05, 0.1)},
}


def draw_times(rows: Sequence[TimeRow]) -> Figure:
    """Mean, median and one standard deviation of the time an action, over all noises and timed seeds."""
    with style.style():
        grid = Grid(1, len(SESSIONS), width=3.1, height=2.6, left=2.15, across=0.35)
        for column, session in enumerate(SESSIONS):
            panel = grid.panel(0, column, session)
            for place, method in enumerate(METHODS):
                chosen = [row for row in rows if (row.session, row.method) == (session, method)]
                if place % 2:
                    panel.axes.axhspan(place - 0.5, place + 0.5, color=style.STRIPE, linewidth=0, zorder=0)
                if not chosen:
                    continue
                colour = _KINDS[chosen[0].kind]
                mean, median, sigma = (
                    1e3 * statistics.mean(values)
                    for values in ([r.mean for r in chosen], [r.median for r in chosen], [r.sigma for r in chosen])
                )
                low = max(mean - sigma, 0.05 * mean)
                panel.line([(low, place), (mean + sigma, place)], color=colour, linewidth=1.4, zorder=3)
                panel.line([(mean, place)], marker="D", markersize=4, markerfacecolor="white", color=colour, zorder=4)
                panel.line([(median, place)], marker="o", markersize=4.5, color=colour, zorder=5)
                if method in _PUBLISHED[session]:
                    first, last = _PUBLISHED[session][method]
                    panel.line([(first, place + 0.28), (last, place + 0.28)], color="#CC79A7", linewidth=2.2, zorder=2)
            panel.axes.set_ylim(len(METHODS) - 0.5, -0.5)
            panel.axes.set_xscale("log")
            plain_log_ticks(panel.axes.xaxis, (0.01, 0.1, 1, 10, 100))
            panel.axes.set_xlim(0.02, 150)
            panel.axes.set_yticks(range(len(METHODS)), METHODS if column == 0 else [""] * len(METHODS))
            panel.axes.tick_params(axis="y", length=0)
            panel.axes.set_xlabel("ms an action")
            light_grid(panel.axes, "x")
        grid.headline("Time per action", "dots: medians; diamonds and lines: means and one standard deviation over actions")
        entries = [Entry(_KIND_LABELS[kind], color=colour, marker="o", markersize=4) for kind, colour in _KINDS.items()]
        entries.append(Entry("published, another machine", color="#CC79A7", linewidth=2.2))
        grid.canvas.key(entries, MARGIN, 0.14, corner="lower left", columns=len(entries))
    return grid.canvas.figure


def draw_speed_ratios(rows: Sequence[RandomGraphRow]) -> Figure:
    """How many times faster signatures are on random graphs; medians over graphs, one line per density."""
    quotients: tuple[tuple[str, Callable[[RandomGraphRow], float]], ...] = (
        ("t of s_ST / t of ŝ_VN", lambda row: row.spanning_trees_seconds / row.von_neumann_approx_seconds),
        ("t of standard / t of s_ST", lambda row: row.standard_seconds / row.spanning_trees_seconds),
        ("t of standard / t of ŝ_VN", lambda row: row.standard_seconds / row.von_neumann_approx_seconds),
    )
    sizes = sorted({row.num_poses for row in rows})
    densities = sorted({row.degree_increase for row in rows})
    colours = shades(len(densities))
    with style.style():
        grid = Grid(1, 3, width=2.75, height=2.4)
        for column, (title, of) in enumerate(quotients):
            panel = grid.panel(0, column, title)
            for density, colour in zip(densities, colours, strict=True):
                medians = [
                    statistics.median(of(r) for r in rows if (r.num_poses, r.degree_increase) == (n, density)) for n in sizes
                ]
                panel.line(np.column_stack([sizes, medians]), color=colour, marker="o", markersize=3.5, linewidth=1.3)
            panel.axes.axhline(1.0, color=style.MUTED, linewidth=0.8, zorder=1)
            panel.axes.set_xscale("log")
            panel.axes.set_yscale("log")
            plain_log_ticks(panel.axes.xaxis, sizes)
            low, high = panel.axes.get_ylim()
            plain_log_ticks(panel.axes.yaxis, [t for t in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200) if low <= t <= high])
            panel.axes.set_xlabel("poses n")
            light_grid(panel.axes)
        grid.headline("Speed on random pose graphs, from scratch", "medians; above 1 the second is faster")
        entries = [
            Entry(f"Δd = {density:g}", color=colour, marker="o", markersize=3.5)
            for density, colour in zip(densities, colours, strict=True)
        ]
        grid.canvas.key(entries, MARGIN, 0.14, corner="lower left", columns=len(entries))
    return grid.canvas.figure


def shades(count: int) -> list[str]:
    """From light to dark blue, at most five steps apart."""
    ramp = ["#A6D1EE", "#7DB8DE", "#4A94CB", "#23679F", "#0B2F5B"]
    places = np.linspace(0, len(ramp) - 1, count) if count > 1 else [2]
    return [ramp[round(float(place))] for place in places]
