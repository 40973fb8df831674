"""Objectives against path length, in metres and in millimetres."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from topobelief.report import style
from topobelief.report.canvas import Entry
from topobelief.report.reproduction.panels import MARGIN, Grid, light_grid, signed
from topobelief.reproduction.path_length import UNITS, LengthRow, length_correlation
from topobelief.reproduction.planning_sessions import OBJECTIVES

_NAMES = {"joint": "joint entropy", "map": "map entropy", "per_pose": "joint entropy per pose"}


def draw_lengths(rows: Sequence[LengthRow]) -> Figure:
    """What each objective changes against staying, over the length of the path; its choice ringed."""
    colours = Normalize(0, max(row.num_closures for row in rows))
    with style.style():
        grid = Grid(len(UNITS), len(OBJECTIVES), width=2.6, height=1.95, across=0.65, left=0.95)
        for line, unit in enumerate(UNITS):
            for column, objective in enumerate(OBJECTIVES):
                panel = grid.panel(line, column, f"{_NAMES[objective]}, in {unit}")
                chosen = [row for row in rows if (row.unit, row.objective) == (unit, objective)]
                points = np.array([(row.length, row.change) for row in chosen])
                closures = [row.num_closures for row in chosen]
                look: dict[str, Any] = {"cmap": "viridis", "norm": colours, "s": 16, "linewidths": 0, "zorder": 3}
                panel.axes.scatter(*points.T, c=closures, **look)
                best = next(row for row in chosen if row.chosen)
                panel.axes.scatter(
                    best.length, best.change, s=95, facecolors="none", edgecolors=style.BEST, linewidths=1.8, zorder=4
                )
                panel.axes.axhline(0, color=style.MUTED, linewidth=0.7, zorder=1)
                text = f"ρ with length {signed(length_correlation(rows, unit, objective))}"
                panel.axes.text(0.98, 0.97, text, transform=panel.axes.transAxes, ha="right", va="top", fontsize=7.5)
                panel.axes.margins(0.08, 0.16)
                light_grid(panel.axes)
                if column == 0:
                    panel.axes.set_ylabel("change against staying (nats)")
                if line == len(UNITS) - 1:
                    panel.axes.set_xlabel("path length (m)")
        seed, xi = rows[0].seed, rows[0].xi
        count = len(rows) // (len(UNITS) * len(OBJECTIVES))
        grid.headline(
            "What each objective prefers where paths differ in length",
            f"S2, {count} candidates, seed {seed}, ξ = {xi:g}; nats per pose in the right column",
        )
        look: dict[str, Any] = {"marker": "o", "linestyle": "none", "markersize": 8, "markerfacecolor": "none"}
        grid.canvas.key([Entry("chosen", markeredgecolor=style.BEST, **look)], MARGIN, 0.16, corner="lower left")
        bar = grid.canvas.panel(2.9, 0.24, 2.2, 0.09)
        bar.axes.figure.colorbar(ScalarMappable(colours, "viridis"), cax=bar.axes, orientation="horizontal")
        bar.axes.tick_params(labelsize=7, pad=1, length=2)
        grid.canvas.text(2.8, 0.22, "loop closures of the path", align="right", fontsize=8)
    return grid.canvas.figure
