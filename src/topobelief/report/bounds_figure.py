"""Bounds of the objective and its exact value for each candidate, in ranking order, beside a table of its other properties.

A candidate whose lower bound lies right of the dashed line, the upper bound of the chosen one, cannot be the best: that is
how Algorithm 1 of Kitanov and Indelman (arXiv 1903.00927) rules actions out without evaluating them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from topobelief.arrays import BoolArray, FloatArray
from topobelief.planning.decision import Decision
from topobelief.planning.registry import SIGNATURE_WORDS
from topobelief.planning.units import quantity, shown_factor, shown_unit
from topobelief.report import style
from topobelief.report.canvas import Align, Canvas, Entry, Panel

_WIDTH = 7.6  # inches, as all lengths here
_ROW = 0.205
_TOP, _BOTTOM = 1.0, 0.92
_PLOT_LEFT, _PLOT_RIGHT = 3.0, 0.25
_MARGIN = 0.38
_COLUMNS: tuple[tuple[str, float, Align], ...] = (
    ("", 0.28, "right"),
    ("candidate", _MARGIN, "left"),
    ("length", 1.62, "right"),
    ("poses", 2.15, "right"),
    ("closures", 2.78, "right"),
)
_LEAST_WIDTH = 0.01  # of all that is shown: bars less wide than that are drawn as points
_NAME_COLUMN = 11  # characters that fit it


def draw_bounds(decision: Decision, entropies: ArrayLike | None = None) -> Figure:
    """Interval [LB, UB] of each action in ranking order, with the exact value where it is known.

    Parameters
    ----------
    decision
        Its bounds may be missing.
    entropies : shape (K,), optional
        Exact objective of each action, cost excluded, nan where unknown. Default: those that the decision evaluated.

    Returns
    -------
    Figure
        `topobelief.report.canvas.save_figure` writes it.
    """
    rows = decision.num_actions
    with style.style():
        canvas = Canvas(_WIDTH, _TOP + _BOTTOM + _ROW * rows)
        panel = canvas.panel(_PLOT_LEFT, _BOTTOM, _WIDTH - _PLOT_LEFT - _PLOT_RIGHT, _ROW * rows)
        key = draw_rows(panel, decision, entropies)
        _write_columns(canvas, decision)
        canvas.title(_MARGIN, canvas.height - 0.50, _title(decision), _subtitle(decision))
        if key:
            canvas.key(key, _MARGIN, 0.12, corner="lower left", columns=len(key))
    return canvas.figure


def draw_rows(panel: Panel, decision: Decision, entropies: ArrayLike | None = None) -> list[Entry]:
    """The plot alone: a row an action, the first of the ranking above; returns the key. Arguments as for `draw_bounds`."""
    exact = decision.entropies if entropies is None else np.asarray(entropies, dtype=np.float64)
    costs = np.array([candidate.cost for candidate in decision.candidates])
    points = _is_point(decision)
    key = _draw_intervals(panel, decision, points)
    key += _draw_exact(panel, decision, np.where(points, np.nan, exact + costs))
    key += _draw_threshold(panel, decision)
    panel.axes.set_ylim(decision.num_actions - 0.5, -0.5)
    panel.axes.margins(x=0.03)
    plus_cost = ", plus cost" if costs.any() else ""
    panel.value_axis(f"{decision.description}{plus_cost} ({shown_unit(decision.unit)})")
    return key


def _is_point(decision: Decision) -> BoolArray:
    """Evaluated actions whose intervals, as wide as rounding, cannot be seen, shape (K,)."""
    ends = np.concatenate([decision.lower, decision.upper])
    extent = float(np.ptp(ends[np.isfinite(ends)])) if np.isfinite(ends).any() else 0.0
    return ~np.isnan(decision.entropies) & (decision.upper - decision.lower <= _LEAST_WIDTH * extent)


def _draw_intervals(panel: Panel, decision: Decision, points: BoolArray) -> list[Entry]:
    """Bars in the colour of how an action stands; points in place of bars that cannot be seen."""
    colours, factor = style.standing_colours(decision), shown_factor(decision.unit)
    bar: dict[str, Any] = {"linewidth": 5, "solid_capstyle": "butt", "alpha": 0.75}
    point: dict[str, Any] = {"linestyle": "none", "marker": "D", "markersize": 5}
    drawn: dict[str, dict[str, Any]] = {}
    ranking: list[int] = decision.ranking.tolist()
    for row, action in enumerate(ranking):
        if row % 2:
            panel.axes.axhspan(row - 0.5, row + 0.5, color=style.STRIPE, linewidth=0, zorder=0)
        if math.isfinite(decision.lower[action]) or math.isfinite(decision.upper[action]):
            colour = colours[action]
            if points[action]:
                drawn.setdefault(colour, point)
            else:
                drawn[colour] = bar
            ends = [(factor * float(decision.lower[action]), row), (factor * float(decision.upper[action]), row)]
            if points[action]:
                panel.line(ends[1:], color=colour, zorder=5, **point)
                continue
            panel.line(ends, color=colour, zorder=3, **bar)
            panel.line(ends, linestyle="none", marker="|", color=colour, markersize=6.5, zorder=3)
    labels = {style.BEST: "chosen", style.SURVIVOR: "may be optimal", style.RULED_OUT: "ruled out"}
    return [
        Entry(f"{label}, exact" if drawn[colour] is point else label, color=colour, **drawn[colour])
        for colour, label in labels.items()
        if colour in drawn
    ]


def _draw_exact(panel: Panel, decision: Decision, values: FloatArray) -> list[Entry]:
    """Filled where the decision evaluated it, hollow where it is known for comparison alone."""
    key: list[Entry] = []
    needed = ~np.isnan(decision.entropies)
    comparison = "exact, to compare" if decision.num_actions > 1 else "exact"
    for label, chosen, fill in (("exact, evaluated", needed, style.INK), (comparison, ~needed, "white")):
        shown = shown_factor(decision.unit) * np.where(chosen, values, np.nan)[decision.ranking]
        if np.isnan(shown).all():
            continue
        look: dict[str, Any] = {"marker": "D", "markersize": 3.6, "markerfacecolor": fill, "markeredgecolor": style.INK}
        look |= {"linestyle": "none", "markeredgewidth": 0.9}
        panel.line(np.stack([shown, np.arange(len(shown))], axis=1), zorder=5, **look)
        key.append(Entry(label, **look))
    return key


def _draw_threshold(panel: Panel, decision: Decision) -> list[Entry]:
    """What a lower bound must not exceed: the chosen one's upper bound, or its value once evaluated."""
    threshold = shown_factor(decision.unit) * float(decision.upper[decision.best])
    if not math.isfinite(threshold) or decision.num_actions == 1:
        return []
    look: dict[str, Any] = {"color": style.INK, "linewidth": 0.9, "linestyle": (0, (4, 2))}
    panel.axes.axvline(threshold, zorder=4, **look)
    evaluated = not math.isnan(decision.entropies[decision.best])
    return [Entry("least value found" if evaluated else "upper bound of the chosen", **look)]


def _write_columns(canvas: Canvas, decision: Decision) -> None:
    """The left part: a table whose rows are those of the plot."""
    colours = style.standing_colours(decision)

    def write(y: float, cells: tuple[str, ...], looks: list[dict[str, str]]) -> None:
        for (_, x, align), cell, look in zip(_COLUMNS, cells, looks, strict=True):
            canvas.text(x, y, cell, align=align, fontsize=8, **look)

    muted = {"color": style.MUTED}
    write(canvas.height - _TOP + 0.08, tuple(name for name, _, _ in _COLUMNS), [muted] * len(_COLUMNS))
    ranking: list[int] = decision.ranking.tolist()
    for row, action in enumerate(ranking):
        candidate = decision.candidates[action]
        best = action == decision.best
        look = {"color": colours[action], "fontweight": "bold"} if best else {"color": style.INK}
        cells = (
            str(row + 1),
            style.short_name(decision, action, limit=_NAME_COLUMN),
            f"{candidate.length:.1f} m",
            str(candidate.num_new_poses),
            str(candidate.num_closures),
        )
        write(canvas.height - _TOP - (row + 0.5) * _ROW - 0.04, cells, [muted] + [look] * (len(cells) - 1))


def _title(decision: Decision) -> str:
    chosen, total = style.short_name(decision, decision.best), decision.num_actions
    ruled_out = total - len(decision.survivors)
    if total == 1:
        return f"{chosen}, the only candidate"
    if decision.exact_bounds and decision.proven_optimal:
        return f"{chosen} has the least of the exact values of all {total} candidates"
    if np.isnan(decision.lower).any():
        return f"{chosen} is chosen among {total} candidates"
    if not ruled_out:
        return "No candidate is ruled out: the lower bounds of all lie left of the dashed line"
    whose = "its" if ruled_out == 1 else "their"
    return f"{ruled_out} of {total} candidates cannot be the best: {whose} lower bound exceeds the dashed line"


def _subtitle(decision: Decision) -> str:
    if decision.num_actions == 1:
        return "there is nothing to compare it with"
    ranked = f"in the order of {SIGNATURE_WORDS.get(decision.signature, decision.signature)}, best first"
    if decision.margin_met is not None:
        return f"{ranked}; the margin is {'met' if decision.margin_met else 'missed'}"
    if decision.proven_optimal:
        return f"{ranked}; the chosen one is proven optimal"
    if math.isinf(decision.error_bound):
        return f"{ranked}; not all have bounds"
    return f"{ranked}; none is better than the chosen one by more than {quantity(decision.error_bound, decision.unit)}"
