"""Beyond candidates: what each method gains, and in which time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from topobelief.report import style
from topobelief.report.canvas import Entry
from topobelief.report.reproduction.beyond_table import OBJECTIVE_WORDS
from topobelief.report.reproduction.panels import MARGIN, Grid, light_grid
from topobelief.reproduction.beyond_candidates import BeyondRow
from topobelief.wording import counted

_LOOKS = (("#9FB4C7", "o"), (style.ODOMETRY, "s"), (style.BEST, "D"), (style.SURVIVOR, "^"))
_UNITS = {"error": ("cm", 100.0), "map": ("nats", 1.0)}


def draw_beyond(rows: Sequence[BeyondRow]) -> Figure:
    """Gain against staying over processor time; small marks are decisions, large ones medians, a line the shortest path."""
    objectives = list(dict.fromkeys(row.objective for row in rows))
    detours = list(dict.fromkeys(row.max_detour for row in rows))
    looks = dict(zip(dict.fromkeys(row.method for row in rows), _LOOKS, strict=False))
    with style.style():
        grid = Grid(len(objectives), len(detours), width=3.0, height=2.1, across=0.55, down=0.75, left=0.75)
        for line, objective in enumerate(objectives):
            unit, factor = _UNITS[objective]
            for column, detour in enumerate(detours):
                panel = grid.panel(line, column, f"{OBJECTIVE_WORDS[objective]}, detour {detour:g}")
                chosen = [row for row in rows if (row.objective, row.max_detour) == (objective, detour)]
                for method, (colour, marker) in looks.items():
                    points = np.array([(row.seconds, factor * row.gain) for row in chosen if row.method == method])
                    panel.axes.scatter(*points.T, s=9, color=colour, marker=marker, alpha=0.45, linewidths=0, zorder=3)
                    panel.axes.scatter(*np.median(points, axis=0), s=52, color=colour, marker=marker, linewidths=0, zorder=4)
                shortest = factor * float(np.median([row.now - row.shortest for row in chosen]))
                panel.axes.axhline(shortest, color=style.MUTED, linewidth=0.9, linestyle=(0, (4, 2)), zorder=1)
                panel.axes.set_xscale("log")
                most = factor * max(row.gain for row in chosen)
                panel.axes.set_ylim(-0.05 * most, 1.08 * most)
                panel.axes.set_xmargin(0.08)
                light_grid(panel.axes)
                if column == 0:
                    panel.axes.set_ylabel(f"gain against staying ({unit})")
                if line == len(objectives) - 1:
                    panel.axes.set_xlabel("processor time (s)")
        decisions = len({(row.seed, row.xi) for row in rows})
        grid.headline(
            "The best of some paths, and the best of the whole roadmap",
            f"S2, learned closures, {counted(decisions, 'pair')} of seed and noise; large marks are medians",
        )
        entries = [
            Entry(method, linestyle="none", marker=marker, markersize=6, markerfacecolor=colour, markeredgewidth=0)
            for method, (colour, marker) in looks.items()
        ]
        entries.append(Entry("the shortest path", color=style.MUTED, linewidth=0.9, linestyle=(0, (4, 2))))
        grid.canvas.key(entries, MARGIN, 0.14, corner="lower left", columns=3)
    return grid.canvas.figure
