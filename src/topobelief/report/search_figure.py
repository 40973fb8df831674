"""A search over a roadmap in one picture: the way found on the map and what it sees again, and what each metre buys."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray
from topobelief.candidates.start import Start, find_start
from topobelief.graph.pose_graph import PoseGraph
from topobelief.report import style
from topobelief.report.canvas import Canvas, Entry, Panel
from topobelief.report.map_layers import Sight, View, draw_graph, draw_sight, draw_world
from topobelief.search.result import SearchResult, said
from topobelief.world import World

_MAP_WIDTHS, _MAP_HEIGHT = (2.8, 4.6), 4.0  # inches
_LEFT, _BOTTOM, _TOP, _RIGHT = 0.65, 0.50, 0.75, 0.20
_GAP, _FRONT_WIDTH, _FRONT_HEIGHT = 0.95, 3.1, 1.85
_FURTHEST = 3.0  # gains of the longest way; a bound further below is told, not drawn
_AXES = {
    "error": "expected map error after it (cm)",
    "map": "map entropy after it (nats)",
    "joint": "joint entropy after it (nats)",
    "per_pose": "joint entropy per pose (nats)",
}


def draw_search(
    graph: PoseGraph, world: World, result: SearchResult, *, start: int | ArrayLike | Start | None = None
) -> Figure:
    """The best way over the map with the closures it is predicted to make, its alternatives, and the front beside it.

    Parameters
    ----------
    graph
        The prior, in SE(2).
    world
        Where the robot may be.
    result
        Of `topobelief.search_roadmap`.
    start
        As given to it.

    Returns
    -------
    Figure
        `topobelief.report.canvas.save_figure` writes it.
    """
    sight = Sight.of(graph, find_start(graph, start), result.action)
    others = [way.path for way in result.alternatives]
    view = View.around(np.concatenate([result.path, sight.segments.reshape(-1, 2), *others]), padding=0.07)
    with style.style():
        width = float(np.clip(_MAP_HEIGHT / view.aspect, *_MAP_WIDTHS))
        view = view.reshaped(_MAP_HEIGHT / width)
        right = _LEFT + width + _GAP
        canvas = Canvas(right + _FRONT_WIDTH + _RIGHT, _BOTTOM + _MAP_HEIGHT + _TOP)
        panel = canvas.panel(_LEFT, _BOTTOM, width, _MAP_HEIGHT)
        key = draw_world(panel, world, view)
        key += draw_graph(panel, graph, view)
        key += _draw_ways(panel, result, others)
        key += draw_sight(panel, graph, sight)
        view.shown_on(panel)
        panel.map_axes()
        front = canvas.panel(right, _BOTTOM + _MAP_HEIGHT - _FRONT_HEIGHT, _FRONT_WIDTH, _FRONT_HEIGHT)
        draw_front(result, front.axes)
        canvas.key(key, right - 0.45, _BOTTOM, corner="lower left")
        canvas.title(_LEFT, _BOTTOM + _MAP_HEIGHT + 0.15, search_title(result), search_subtitle(result))
    return canvas.figure


def draw_front(result: SearchResult, ax: Any) -> Any:
    """What each further metre buys, the way chosen, and below which value no walk of each length can be.

    Parameters
    ----------
    result
        Of `topobelief.search_roadmap`.
    ax
        Axes of matplotlib to draw on.

    Returns
    -------
    The axes.
    """
    scale = 100.0 if result.objective == "error" else 1.0  # centimetres
    lengths, values = result.front.T
    last = max(result.max_length, float(lengths[-1]))
    x, y = np.r_[lengths, last], scale * np.r_[values, values[-1]]
    ax.step(x, y, where="post", color=style.SURVIVOR, linewidth=1.4, label="best way found", zorder=4)
    if len(result.front_bounds):
        _draw_bounds(ax, x, y, result.front_bounds * [1.0, scale])
    chosen = scale * (result.value - result.best.action.cost)
    ax.plot([result.length], [chosen], "o", color=style.BEST, markeredgecolor="white", markersize=7, zorder=6, label="chosen")
    if result.shortest is not None:
        shortest = scale * (result.shortest.value - result.shortest.action.cost)
        look: dict[str, Any] = {"color": style.RULED_OUT, "markeredgecolor": "white", "markersize": 6, "zorder": 5}
        ax.plot([result.shortest.length], [shortest], "s", label="shortest way", **look)
    ax.set_xlabel("at most so many metres")
    ax.set_ylabel(_AXES[result.objective])
    for side in ("right", "top"):
        ax.spines[side].set_visible(False)
    ax.legend(loc="upper right", frameon=False, fontsize=7.5)
    return ax


def _draw_bounds(ax: Any, x: FloatArray, y: FloatArray, bounds: FloatArray) -> None:
    """The line below which no walk is; where it is too far down to be shown, a word of it."""
    span = float(y[0] - y[-1]) or 1.0
    metres, lowest = bounds.T
    floor = y[-1] - 1.15 * _FURTHEST * span
    if lowest.min() < floor:
        ax.set_ylim(floor, y[0] + 0.15 * span)
        at = (metres[-1], floor)
        look: dict[str, Any] = {"textcoords": "offset points", "fontsize": 7, "color": style.MUTED, "ha": "right"}
        ax.annotate(f"no walk is below {lowest.min():.4g}", at, xycoords="data", xytext=(-2, 3), **look)
    line: dict[str, Any] = {"color": style.INK, "linewidth": 1.0, "linestyle": (0, (4, 2)), "zorder": 3}
    ax.step(np.r_[x[0], metres], np.r_[lowest[0], lowest], where="pre", label="no walk is below", **line)
    grid = np.unique(np.r_[x, metres[(metres > x[0]) & (metres < x[-1])]])
    best = y[np.searchsorted(x, grid, side="right") - 1]
    least = np.append(lowest, lowest[-1])[np.searchsorted(metres, grid, side="right")]
    ax.fill_between(grid, best, np.minimum(least, best), step="post", color=style.GRID, alpha=0.5, linewidth=0, zorder=1)


def _draw_ways(panel: Panel, result: SearchResult, others: list[FloatArray]) -> list[Entry]:
    key: list[Entry] = []
    looks: dict[str, dict[str, Any]] = {
        "best": {"color": style.BEST, "linewidth": 2.4},
        "other": {"color": style.RULED_OUT, "linewidth": 1.0, "alpha": 0.75},
        "shortest": {"color": style.INK, "linewidth": 1.1, "linestyle": (0, (2, 2))},
    }
    panel.line(result.path, casing=4.2, zorder=7, **looks["best"])
    key.append(Entry(f"best way found, {result.length:.1f} m", **looks["best"]))
    for path in others:
        panel.line(path, zorder=5, **looks["other"])
    if others:
        key.append(Entry(f"alternatives ({len(others)})", **looks["other"]))
    if result.shortest is not None:
        panel.line(result.shortest.path, zorder=6, **looks["shortest"])
        key.append(Entry(f"shortest way, {result.shortest.length:.1f} m", **looks["shortest"]))
    ends = [("start", result.path[0], "o", "white", 6.0)]
    ends += [] if result.shortest is None else [("goal", result.path[-1], "*", style.GOAL, 12.0)]
    for label, place, marker, colour, size in ends:
        mark: dict[str, Any] = {
            "marker": marker,
            "markerfacecolor": colour,
            "markeredgecolor": style.INK,
            "markersize": size,
            "linestyle": "none",
        }
        panel.line(place, zorder=9, **mark)
        key.append(Entry(label, **mark))
    return key


def search_title(result: SearchResult) -> str:
    """What was searched."""
    if not result.sees_map:
        return f"Nothing to gain within {result.max_length:.1f} m"
    found = "The best of" if result.proven_optimal else "The best way found among"
    return f"{found} all walks of up to {result.max_length:.1f} m"


def search_subtitle(result: SearchResult) -> str:
    """What it found."""
    after = said(result.value - result.best.action.cost, result.objective)
    text = f"{after} after it, {said(result.value_now, result.objective)} now"
    if math.isinf(result.lower_bound) or result.proven_optimal:
        return text
    return f"{text}; no walk is better by more than {said(result.gap, result.objective)}"
