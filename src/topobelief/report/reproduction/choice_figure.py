"""Entropy or error: what each way to choose loses of the expected error of the map, and how it ranks the candidates by it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.figure import Figure

from topobelief.report import style
from topobelief.report.canvas import Entry, Panel
from topobelief.report.reproduction.panels import CHOOSER_NAMES, CLOSURE_NAMES, MARGIN, NOISE_COLOURS, Grid, light_grid
from topobelief.reproduction.entropy_or_error import CLOSURES, DETOURS, ChoiceRow
from topobelief.reproduction.planning_sessions import NOISES


def draw_choices(rows: Sequence[ChoiceRow]) -> Figure:
    """Loss and rank correlation by way to choose, noise, detour and kind of closures; all places together."""
    with style.style():
        grid = Grid(len(CLOSURES), 2 * len(DETOURS), width=1.8, height=1.85, left=1.65, across=0.3, down=0.8, bottom=0.95)
        for line, kind in enumerate(CLOSURES):
            for column, detour in enumerate(DETOURS):
                chosen = [row for row in rows if (row.max_detour, row.closures) == (detour, kind)]
                title = f"{CLOSURE_NAMES[kind]}, detour {detour:g}"
                loss = grid.panel(line, column, title)
                _draw(loss, chosen, lambda row: 100 * row.share_lost, ends=(0.5, 0.95), mean=True)
                loss.axes.set_xscale("symlog", linthresh=0.1, linscale=0.5)
                loss.axes.set_xlim(-0.02, 200)
                loss.axes.set_xticks([0, 0.1, 1, 10, 100], ["0", "0.1", "1", "10", "100"])
                loss.axes.set_xticks([], minor=True)
                names = list(CHOOSER_NAMES.values()) if column == 0 else [""] * len(CHOOSER_NAMES)
                loss.axes.set_yticks(range(len(CHOOSER_NAMES)), names)
                rank = grid.panel(line, len(DETOURS) + column, title)
                _draw(rank, chosen, lambda row: row.error_correlation, ends=(0.25, 0.75), mean=False)
                rank.axes.set_xlim(-1.05, 1.05)
                rank.axes.set_xticks([-1, -0.5, 0, 0.5, 1], ["\N{MINUS SIGN}1", "\N{MINUS SIGN}0.5", "0", "0.5", "1"])
                rank.axes.axvline(0, color=style.MUTED, linewidth=0.6, zorder=1)
                rank.axes.set_yticks([])
                if line == len(CLOSURES) - 1:
                    loss.axes.set_xlabel("% of the least error lost")
                    rank.axes.set_xlabel("rank correlation with the error")
        places = ", ".join(dict.fromkeys(row.place for row in rows))
        decisions = sum(row.chooser == "error" for row in rows)
        grid.headline(
            "What choosing by an entropy, or by its topology, loses of the map's expected error",
            f"{decisions} decisions ({places}). Left: dots are means, lines end at the median and at the 95 % quantile. "
            "Right: medians and quartiles.",
        )
        entries = [Entry(label, color=colour, marker="o", markersize=4, linewidth=2) for label, colour, _ in _noises(rows)]
        grid.canvas.key(entries, MARGIN, 0.14, corner="lower left", columns=len(entries))
    return grid.canvas.figure


def _noises(rows: Sequence[ChoiceRow]) -> list[tuple[str, str, Callable[[ChoiceRow], bool]]]:
    """Label, colour, and which rows."""
    found: list[tuple[str, str, Callable[[ChoiceRow], bool]]] = [
        (f"ξ = {xi:g}", colour, lambda row, xi=xi: row.xi == xi) for xi, colour in zip(NOISES, NOISE_COLOURS, strict=True)
    ]
    if any(math.isnan(row.xi) for row in rows):
        found.append(("noise of the file", style.BEST, lambda row: math.isnan(row.xi)))
    return found


def _draw(
    panel: Panel, rows: Sequence[ChoiceRow], of: Callable[[ChoiceRow], float], *, ends: tuple[float, float], mean: bool
) -> None:
    """A line between two quantiles and a dot at the mean or the median, for each way to choose and noise."""
    noises = _noises(rows)
    for place, chooser in enumerate(CHOOSER_NAMES):
        if place % 2:
            panel.axes.axhspan(place - 0.5, place + 0.5, color=style.STRIPE, linewidth=0, zorder=0)
        for offset, (_, colour, belongs) in enumerate(noises):
            values = [of(row) for row in rows if row.chooser == chooser and belongs(row)]
            known = [value for value in values if not math.isnan(value)]
            if known:
                y = place + 0.2 * (offset - (len(noises) - 1) / 2)
                low, high = np.quantile(known, ends).tolist()
                dot = float(np.mean(known) if mean else np.median(known))
                panel.line([(low, y), (high, y)], color=colour, linewidth=1.6, zorder=3)
                panel.line([(dot, y)], color=colour, marker="o", markersize=3.2, zorder=4)
    panel.axes.set_ylim(len(CHOOSER_NAMES) - 0.5, -0.5)
    panel.axes.tick_params(axis="y", length=0)
    light_grid(panel.axes, "x")
