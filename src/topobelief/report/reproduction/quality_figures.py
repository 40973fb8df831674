"""Beyond the paper: what families of bounds are worth, and how early each order finds the best action."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.figure import Figure

from topobelief.report import style
from topobelief.report.canvas import Entry, Panel
from topobelief.report.reproduction.panels import MARGIN, NOISE_COLOURS, SIGNATURE_LOOKS, Grid, light_grid
from topobelief.reproduction.anytime import AnytimeRow
from topobelief.reproduction.bounds_quality import FAMILIES, BoundsRow
from topobelief.reproduction.planning_sessions import NOISES, OBJECTIVES, SESSIONS

_OBJECTIVE_NAMES = {"joint": "joint", "map": "map", "per_pose": "per pose"}
_ORDER_LOOKS = {
    "exhaustive": ("as they come", "#8C8C8C", "-", 1.4),
    "random": ("at random (expectation)", "#8C8C8C", (0, (3, 2)), 1.4),
    **{
        name: (f"by {SIGNATURE_LOOKS[name][0]}", SIGNATURE_LOOKS[name][1], "-", width)  # the narrower lies on the wider
        for name, width in (("spanning_trees", 4.2), ("von_neumann", 2.6), ("von_neumann_approx", 1.1))
    },
}
_FAMILY_NAMES = [name for name, _, _ in FAMILIES]


def draw_bounds_quality(rows: Sequence[BoundsRow]) -> Figure:
    """Share ruled out, what the choice may lose, and evaluations to the proof; medians and quartiles over seeds, S2."""
    quantities: tuple[tuple[str, str, Callable[[BoundsRow], float]], ...] = (
        ("ruled out by bounds", "% of the actions", lambda row: 100 * row.num_eliminated / row.num_actions),
        ("ΔJ_max of the choice", "% of the spread of the objective", lambda row: 100 * row.error_bound / row.spread),
        ("evaluations to the proof", "% of the actions", lambda row: 100 * row.num_evaluations / row.num_actions),
    )
    with style.style():
        grid = Grid(len(OBJECTIVES), len(quantities), width=2.3, height=1.45, left=1.55, across=0.3, down=0.72)
        for line, objective in enumerate(OBJECTIVES):
            for column, (title, unit, of) in enumerate(quantities):
                panel = grid.panel(line, column, f"{_OBJECTIVE_NAMES[objective]}: {title}")
                chosen = [row for row in rows if (row.prior, row.objective) == (SESSIONS[-1], objective)]
                _draw_families(panel, chosen, of, with_names=column == 0)
                panel.axes.set_xlabel(unit)
                if column == 1:
                    panel.axes.set_xscale("symlog", linthresh=1, linscale=0.6)
                    panel.axes.set_xlim(-0.1, 3000)
                    panel.axes.set_xticks([0, 1, 10, 100, 1000], ["0", "1", "10", "100", "1000"])
                    panel.axes.set_xticks([], minor=True)
                else:
                    panel.axes.set_xlim(-3, 103)
        seeds = len({row.seed for row in rows})
        grid.headline(
            "What bounds are worth",
            f"{SESSIONS[-1]}, 20 candidates, {seeds} seeds; dots: medians, lines: quartiles; the choice is that of s_ST",
        )
        entries = [
            Entry(f"ξ = {xi:g}", color=colour, marker="o", markersize=4, linewidth=2)
            for xi, colour in zip(NOISES, NOISE_COLOURS, strict=True)
        ]
        grid.canvas.key(entries, MARGIN, 0.14, corner="lower left", columns=len(entries))
    return grid.canvas.figure


def _draw_families(panel: Panel, rows: Sequence[BoundsRow], of: Callable[[BoundsRow], float], *, with_names: bool) -> None:
    for place, family in enumerate(_FAMILY_NAMES):
        if place % 2:
            panel.axes.axhspan(place - 0.5, place + 0.5, color=style.STRIPE, linewidth=0, zorder=0)
        for noise, (xi, colour) in enumerate(zip(NOISES, NOISE_COLOURS, strict=True)):
            values = [of(row) for row in rows if (row.bounds, row.xi) == (family, xi)]
            if values:
                y = place + 0.22 * (noise - 1)
                first, median, third = np.quantile(values, [0.25, 0.5, 0.75]).tolist()
                panel.line([(first, y), (third, y)], color=colour, linewidth=2.0, zorder=3)
                panel.line([(median, y)], color=colour, marker="o", markersize=3.6, zorder=4)
    panel.axes.set_ylim(len(_FAMILY_NAMES) - 0.5, -0.5)
    panel.axes.set_yticks(range(len(_FAMILY_NAMES)), _FAMILY_NAMES if with_names else [""] * len(_FAMILY_NAMES))
    panel.axes.tick_params(axis="y", length=0)
    light_grid(panel.axes, "x")


def draw_anytime(rows: Sequence[AnytimeRow]) -> Figure:
    """What the best action so far loses, against evaluations made: the sessions, means over seeds."""
    with style.style():
        grid = Grid(len(SESSIONS), len(NOISES), width=2.75, height=1.75)
        for line, session in enumerate(SESSIONS):
            for column, xi in enumerate(NOISES):
                panel = grid.panel(line, column, f"{session}, ξ = {xi:g}")
                _draw_curves(panel, [row for row in rows if (row.prior, row.xi) == (session, xi)])
                if column == 0:
                    panel.axes.set_ylabel("mean loss (nats)")
                if line == len(SESSIONS) - 1:
                    panel.axes.set_xlabel("exact evaluations")
        decisions = max((row.num_decisions for row in rows), default=0)
        grid.headline("The best action so far", f"mean over {decisions} seeds of its joint entropy minus the least")
        _anytime_key(grid)
    return grid.canvas.figure


def draw_real_graphs(curves: Sequence[AnytimeRow], bounds: Sequence[BoundsRow]) -> Figure:
    """The same on real pose graphs, with what the bounds leave open in words."""
    names = list(dict.fromkeys(row.prior for row in curves if math.isnan(row.xi)))
    columns = min(3, len(names))
    with style.style():
        grid = Grid(math.ceil(len(names) / columns), columns, width=2.75, height=1.9, down=0.8)
        for place, name in enumerate(names):
            line, column = divmod(place, columns)
            panel = grid.panel(line, column, name)
            _draw_curves(panel, [row for row in curves if row.prior == name], headroom=50)
            panel.axes.set_xlabel("exact evaluations")
            if column == 0:
                panel.axes.set_ylabel("loss of the best so far (nats)")
            facts = [row for row in bounds if (row.prior, row.objective) == (name, "joint")]
            text = "\n".join(f"{row.bounds}: {row.num_eliminated} of {row.num_actions} ruled out" for row in facts)
            place_of = {"transform": panel.axes.transAxes, "ha": "right", "va": "top", "fontsize": 7, "linespacing": 1.4}
            panel.axes.text(0.99, 0.98, text, **place_of)
        grid.headline(
            "Decisions on real pose graphs", "joint entropy, noise of the files; what bounds rule out before any evaluation"
        )
        _anytime_key(grid)
    return grid.canvas.figure


def _draw_curves(panel: Panel, rows: Sequence[AnytimeRow], *, headroom: float = 1.0) -> None:
    """`headroom`: how many times the largest loss the axis reaches."""
    for order, (_, colour, dashes, width) in _ORDER_LOOKS.items():
        curve = [(row.evaluations, row.loss) for row in rows if row.order == order]
        if curve:
            panel.line(curve, color=colour, linestyle=dashes, linewidth=width, drawstyle="steps-post", zorder=3)
    largest = max((row.loss for row in rows), default=1.0)
    panel.axes.set_yscale("symlog", linthresh=0.01, linscale=0.4)
    top = 10.0 ** math.ceil(math.log10(max(largest, 0.1)))
    ticks = [0.0, *(10.0**power for power in range(-2, round(math.log10(top)) + 1))]
    panel.axes.set_ylim(-0.004, top * headroom)
    panel.axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    panel.axes.set_yticks([], minor=True)
    panel.axes.set_xlim(left=1)
    light_grid(panel.axes)


def _anytime_key(grid: Grid) -> None:
    entries = [
        Entry(label, color=colour, linestyle=dashes, linewidth=width) for label, colour, dashes, width in _ORDER_LOOKS.values()
    ]
    grid.canvas.key(entries, MARGIN, 0.14, corner="lower left", columns=len(entries))
