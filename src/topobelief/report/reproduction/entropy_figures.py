"""Entropy of each action: with its bounds, and against each signature; six cases of two sessions and three noises."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from topobelief.arrays import FloatArray
from topobelief.planning.decision_quality import decision_quality
from topobelief.report import style
from topobelief.report.canvas import Entry, Panel
from topobelief.report.reproduction.panels import MARGIN, SIGNATURE_LOOKS, Grid, light_grid, signed
from topobelief.reproduction.planning_sessions import NOISES, SESSIONS, ActionRow, cases

_LOOKS = (
    ("paper", "the paper's bounds", "#C9CDD2", 6.5),
    ("fischer", "Fischer's bounds", "#7DB8DE", 4.0),
    ("anchored", "anchored bounds", style.SURVIVOR, 2.2),
)
_SIGNATURES = tuple(name for name in SIGNATURE_LOOKS if name != "von_neumann_normalized")


def draw_bounds(rows: Sequence[ActionRow], seed: int) -> Figure:
    """Exact joint entropy of each action within its bounds, actions in the order of their entropy.

    Parameters
    ----------
    rows
    seed
        The one that is drawn.
    """
    with style.style():
        grid = _grid_of_cases(cases(rows), seed, _draw_bounds_of_case, height=2.0, x_label="actions, least entropy first")
        grid.headline(
            "Joint entropy of each action and its bounds", f"seed {seed}; where intervals are short, all bounds meet J"
        )
        entries = [Entry(label, color=colour, linewidth=width) for _, label, colour, width in _LOOKS]
        entries += [
            Entry("LB by Hadamard (paper)", color="#9AA0A8", marker="_", linestyle="none", markersize=7, markeredgewidth=1.2),
            Entry("exact", color=style.INK, marker="D", linestyle="none", markersize=3.5),
        ]
        grid.canvas.key(entries, MARGIN, 0.14, corner="lower left", columns=len(entries))
    return grid.canvas.figure


def _draw_bounds_of_case(panel: Panel, unordered: Sequence[ActionRow]) -> None:
    rows = sorted(unordered, key=lambda each: each.joint)
    x = np.arange(1, len(rows) + 1)
    for family, _, colour, width in _LOOKS:
        lower, upper = _column(rows, f"{family}_lower"), _column(rows, f"{family}_upper")
        panel.axes.vlines(x, lower, upper, color=colour, linewidth=width, zorder=3)
    panel.line(
        np.column_stack([x, _column(rows, "paper_hadamard")]),
        color="#9AA0A8",
        marker="_",
        linestyle="none",
        markersize=7,
        markeredgewidth=1.2,
        zorder=4,
    )
    look: dict[str, Any] = {"color": style.INK, "marker": "D", "linestyle": "none", "markersize": 2.8}
    panel.line(np.column_stack([x, _column(rows, "joint")]), zorder=5, **look)
    panel.axes.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=6))
    light_grid(panel.axes, "y")


def draw_signatures(rows: Sequence[ActionRow], seed: int) -> Figure:
    """Each signature against the joint entropy; all in units of their own range, with rank correlation and loss.

    Parameters
    ----------
    rows
    seed
        The one that is drawn.
    """
    with style.style():
        label = "signature, from its least to its largest"
        grid = _grid_of_cases(cases(rows), seed, _draw_signatures_of_case, height=2.3, x_label=label)
        grid.headline(
            "Signatures against the joint entropy", f"seed {seed}; ρ: Spearman's rank correlation of J with −s; losses in nats"
        )
        looks = [SIGNATURE_LOOKS[name] for name in _SIGNATURES]
        entries = [Entry(label, color=colour, marker=mark, linestyle="none", markersize=5) for label, colour, mark in looks]
        grid.canvas.key(entries, MARGIN, 0.14, corner="lower left", columns=len(entries))
    return grid.canvas.figure


def _draw_signatures_of_case(panel: Panel, rows: Sequence[ActionRow]) -> None:
    J = _column(rows, "joint")
    for line, name in enumerate(_SIGNATURES):
        label, colour, mark = SIGNATURE_LOOKS[name]
        s = _column(rows, name)
        look: dict[str, Any] = {"color": colour, "marker": mark, "linestyle": "none", "markersize": 4.2, "alpha": 0.75}
        panel.line(np.column_stack([(s - s.min()) / np.ptp(s), J]), markeredgewidth=0, **look)
        quality = decision_quality(J, s)
        text = f"{label}: ρ {signed(quality.spearman, 3)}, loses {quality.error:.2g}"
        place = {"transform": panel.axes.transAxes, "ha": "right", "va": "top", "color": colour, "fontsize": 7.2}
        panel.axes.text(0.99, 0.98 - 0.085 * line, text, **place)
    light_grid(panel.axes)


def _grid_of_cases(
    found: Mapping[tuple[str, float, int], Sequence[ActionRow]],
    seed: int,
    draw: Callable[[Panel, Sequence[ActionRow]], None],
    *,
    height: float,
    x_label: str,
) -> Grid:
    """One panel per session and noise, with the joint entropy upwards."""
    grid = Grid(len(SESSIONS), len(NOISES), width=2.75, height=height)
    for row, session in enumerate(SESSIONS):
        for column, xi in enumerate(NOISES):
            panel = grid.panel(row, column, f"{session}, ξ = {xi:g}")
            draw(panel, found[session, xi, seed])
            if column == 0:
                panel.axes.set_ylabel("joint entropy (nats)")
            if row == len(SESSIONS) - 1:
                panel.axes.set_xlabel(x_label)
    return grid


def _column(rows: Sequence[ActionRow], name: str) -> FloatArray:
    return np.array([getattr(row, name) for row in rows], dtype=np.float64)
