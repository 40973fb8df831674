"""Signatures against the entropy on random pose graphs, all sizes together and each by itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from topobelief.report import style
from topobelief.report.canvas import Entry
from topobelief.report.reproduction.panels import MARGIN, Grid, light_grid, signed
from topobelief.report.reproduction.time_figures import shades
from topobelief.reproduction.claims import SIGNATURES, graph_correlation, slope_ratio
from topobelief.reproduction.random_graphs import RandomGraphRow

_SHOWN = ("spanning_trees", "von_neumann_approx", "von_neumann_normalized")


def draw_random_graphs(rows: Sequence[RandomGraphRow]) -> Figure:
    """Per pose, so that all sizes show: a signature that does not jump with n puts them all on one line."""
    sizes = sorted({row.num_poses for row in rows})
    colours = shades(len(sizes))
    with style.style():
        grid = Grid(1, len(_SHOWN), width=2.75, height=2.6, across=0.6)
        for column, name in enumerate(_SHOWN):
            panel = grid.panel(0, column, SIGNATURES[name])
            for n, colour in zip(sizes, colours, strict=True):
                points = np.array([(getattr(row, name), row.joint) for row in rows if row.num_poses == n]) / n
                panel.line(points, linestyle="none", marker="o", markersize=3, color=colour, alpha=0.8, markeredgewidth=0)
            within = [graph_correlation([row for row in rows if row.num_poses == n], name) for n in sizes]
            text = (
                f"ρ over all {signed(graph_correlation(rows, name), 3)}\n"
                f"ρ within n {signed(min(within), 3)} … {signed(max(within), 3)}\n"
                f"slope within n / over n: {slope_ratio(rows, name):.2f}"
            )
            place = {"transform": panel.axes.transAxes, "ha": "right", "va": "top", "fontsize": 7.2, "linespacing": 1.4}
            panel.axes.text(0.98, 0.98, text, **place)
            panel.axes.set_xlabel("signature a pose (nats)")
            if column == 0:
                panel.axes.set_ylabel("joint entropy per pose (nats)")
            light_grid(panel.axes)
        subtitle = "ρ: Spearman's rank correlation of J with −s, 1 is perfect; slopes are those of J against s"
        grid.headline("Signatures against the entropy on random pose graphs", subtitle)
        entries = [
            Entry(f"n = {n}", color=colour, marker="o", linestyle="none", markersize=4)
            for n, colour in zip(sizes, colours, strict=True)
        ]
        grid.canvas.key(entries, MARGIN, 0.14, corner="lower left", columns=len(entries))
    return grid.canvas.figure
