"""What a study found, one figure per question: how often the best was chosen, what was lost, how all were ranked, how long it
took.

Each figure has a panel for each session and objective and a row for each strategy, with a line in it for each noise. Medians
are dots, quartiles thick, 10 to 90 % thin; for shares the thin line is the 95 % interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, to_hex
from matplotlib.figure import Figure

from topobelief.planning.registry import unit_of
from topobelief.planning.units import shown_factor, shown_unit
from topobelief.report import style
from topobelief.report.canvas import Canvas, Entry, Panel
from topobelief.study.summary import Share, Spread, Summary

_LEFT, _RIGHT, _TOP, _BOTTOM = 1.70, 0.25, 1.00, 0.85  # inches, as all lengths here
_MARGIN, _LEAST_WIDTH = 0.25, 7.2
_PANEL_WIDTH, _GAP_ACROSS, _GAP_DOWN = 2.60, 0.42, 0.66
_LINE, _ROW_PADDING = 0.105, 0.10  # of a noise, and around those of a strategy
_LEAST_LOSS = 0.1  # nats or centimetres, below which the scale of losses is linear
_LIGHTEST, _DARKEST = "#7DB8DE", "#0B2F5B"
STRATEGY_NAMES = {
    "optimum": "proven optimum",
    "standard": "standard BSP",
    "roadmap": "whole roadmap",
    "resistance": "effective resistance",
    "spanning_trees": "spanning trees",
    "von_neumann": "von Neumann",
    "von_neumann_approx": "von Neumann, degrees",
    "shortest": "shortest path",
    "random": "random",
}
"""What figures call the strategies, in the order in which they stand."""

OBJECTIVE_NAMES = {"joint": "joint entropy", "map": "map entropy", "per_pose": "entropy per pose", "error": "map error"}
"""What figures call the objectives, in the order in which they stand."""


@dataclass(frozen=True, slots=True)
class _Mark:
    """What is drawn of a sample, in the units of the axis; nan is left out."""

    low: float
    first: float
    middle: float
    third: float
    high: float
    mean: float = math.nan

    @classmethod
    def of_share(cls, share: Share) -> _Mark:
        """In percent."""
        return cls(100 * share.low, math.nan, 100 * share.value, math.nan, 100 * share.high)

    @classmethod
    def of_spread(cls, spread: Spread, *, factor: float = 1.0, with_mean: bool = False) -> _Mark:
        """Its quantiles, multiplied."""
        return cls(
            low=factor * spread.low,
            first=factor * spread.first,
            middle=factor * spread.median,
            third=factor * spread.third,
            high=factor * spread.high,
            mean=factor * spread.mean if with_mean else math.nan,
        )


@dataclass(frozen=True, slots=True)
class _Question:
    """The question that a figure answers, and its axis; "{unit}" in its label is that in which the objective is shown."""

    title: str
    subtitle: str
    axis: str
    mark: Callable[[Summary], _Mark]
    scale: Literal["linear", "log", "log from 0"] = "linear"
    limits: tuple[float, float] | None = None
    ticks: tuple[float, ...] = ()


def draw_choices(found: Sequence[Summary]) -> Figure:
    """How often each strategy chose the best candidate."""
    return _drawn(
        found,
        _Question(
            "How often the best candidate is chosen",
            "share of the seeds in which the choice loses at most 1e-6 of the objective; lines: 95 % intervals",
            "best candidate chosen (%)",
            lambda one: _Mark.of_share(one.action_consistent),
            limits=(-3, 103),
            ticks=(0, 25, 50, 75, 100),
        ),
    )


def draw_losses(found: Sequence[Summary]) -> Figure:
    """What each strategy lost against the best candidate."""
    return _drawn(
        found,
        _Question(
            "What a choice loses against the best candidate",
            "dots: medians; thick: quartiles; thin: 10 to 90 % of the seeds; diamonds: means",
            "loss ({unit})",
            lambda one: _Mark.of_spread(one.loss, factor=shown_factor(unit_of(one.objective)), with_mean=True),
            scale="log from 0",
        ),
    )


def draw_orders(found: Sequence[Summary]) -> Figure:
    """How each strategy ranks all candidates."""
    return _drawn(
        found,
        _Question(
            "How all candidates are ranked",
            "correlation of objective and minus score, 1 is perfect; dots: medians; thick: quartiles; thin: 10 to 90 %",
            "Spearman's rank correlation",
            lambda one: _Mark.of_spread(one.spearman),
            limits=(-1.05, 1.05),
            ticks=(-1, -0.5, 0, 0.5, 1),
        ),
    )


def draw_times(found: Sequence[Summary]) -> Figure:
    """How long each decision took."""
    return _drawn(
        found,
        _Question(
            "How long a decision takes",
            "with the candidates given; dots: medians; thick: quartiles; thin: 10 to 90 % of the seeds",
            "time of a decision (ms)",
            lambda one: _Mark.of_spread(one.seconds, factor=1e3),
            scale="log",
        ),
    )


FIGURES: dict[str, Callable[[Sequence[Summary]], Figure]] = {
    "choices": draw_choices,
    "losses": draw_losses,
    "orders": draw_orders,
    "times": draw_times,
}
"""Name of the file, and what draws it."""


def _drawn(found: Sequence[Summary], question: _Question) -> Figure:
    marks = {one: mark for one in found if not math.isnan((mark := question.mark(one)).middle)}
    noises = sorted({one.xi for one in found})
    colours = dict(zip(noises, _shades(len(noises)), strict=True))
    strategies = [name for name in STRATEGY_NAMES if any(one.strategy == name for one in marks)]
    sessions = list(dict.fromkeys((one.world, one.session) for one in found))
    objectives = [name for name in OBJECTIVE_NAMES if any(one.objective == name for one in found)]
    row = _LINE * len(noises) + _ROW_PADDING
    height = row * max(1, len(strategies))
    width = _LEFT + len(objectives) * (_PANEL_WIDTH + _GAP_ACROSS) - _GAP_ACROSS + _RIGHT
    with style.style():
        canvas = Canvas(max(width, _LEAST_WIDTH), _TOP + len(sessions) * (height + _GAP_DOWN) - _GAP_DOWN + _BOTTOM)
        for down, (world, session) in enumerate(sessions):
            bottom = canvas.height - _TOP - height - down * (height + _GAP_DOWN)
            for place, name in enumerate(strategies):
                y = bottom + height - (place + 0.5) * row - 0.04
                canvas.text(_LEFT - 0.12, y, STRATEGY_NAMES[name], align="right", fontsize=8)
            for across, objective in enumerate(objectives):
                left = _LEFT + across * (_PANEL_WIDTH + _GAP_ACROSS)
                panel = canvas.panel(left, bottom, _PANEL_WIDTH, height)
                _stripe(panel, len(strategies))
                for one, mark in marks.items():
                    if (one.world, one.session, one.objective) == (world, session, objective):
                        offset = (noises.index(one.xi) - (len(noises) - 1) / 2) * _LINE / row
                        _draw_mark(panel, mark, strategies.index(one.strategy) + offset, colours[one.xi])
                label = question.axis.format(unit=shown_unit(unit_of(objective))) if down == len(sessions) - 1 else ""
                _finish_axis(panel, list(marks.values()), question, label)
                canvas.text(left, bottom + height + 0.07, f"{session} in {world}, {OBJECTIVE_NAMES[objective]}", fontsize=8.5)
        canvas.title(_MARGIN, canvas.height - 0.50, question.title, question.subtitle)
        key = [
            Entry(f"ξ = {xi:g} rad/m", color=shade, marker="o", markersize=3.5, linewidth=2) for xi, shade in colours.items()
        ]
        canvas.key(key, _MARGIN, 0.14, corner="lower left", columns=len(key))
    return canvas.figure


def _stripe(panel: Panel, num_rows: int) -> None:
    """Rows count downwards."""
    for row in range(1, num_rows, 2):
        panel.axes.axhspan(row - 0.5, row + 0.5, color=style.STRIPE, linewidth=0, zorder=0)
    panel.axes.set_ylim(max(1, num_rows) - 0.5, -0.5)


def _draw_mark(panel: Panel, mark: _Mark, y: float, colour: str) -> None:
    panel.line([(mark.low, y), (mark.high, y)], color=colour, linewidth=1.0, zorder=3)
    panel.line([(mark.first, y), (mark.third, y)], color=colour, linewidth=2.8, solid_capstyle="butt", zorder=4)
    panel.line([(mark.mean, y)], color=colour, marker="D", markersize=2.8, markerfacecolor="white", zorder=5)
    panel.line([(mark.middle, y)], color=colour, marker="o", markersize=3.4, linestyle="none", zorder=6)


def _finish_axis(panel: Panel, marks: Sequence[_Mark], question: _Question, label: str) -> None:
    """The same scale on all panels."""
    panel.value_axis(label)
    if question.limits is not None:
        panel.axes.set_xlim(*question.limits)
        panel.axes.set_xticks(question.ticks, [f"{tick:g}" for tick in question.ticks])
        return
    largest = max((max(mark.high, 0.0 if math.isnan(mark.mean) else mark.mean) for mark in marks), default=1.0)
    last = math.ceil(math.log10(max(1.05 * largest, 10 * _LEAST_LOSS)))
    if question.scale == "log from 0":
        powers = range(round(math.log10(_LEAST_LOSS)), last + 1)
        panel.axes.set_xscale("symlog", linthresh=_LEAST_LOSS, linscale=0.5)
        panel.axes.set_xlim(-0.15 * _LEAST_LOSS, 10.0**last)
        ticks = [0.0, *(10.0**power for power in powers)]
    else:
        smallest = min((mark.low for mark in marks if mark.low > 0), default=10.0 ** (last - 1))
        first = min(math.floor(math.log10(smallest)), last - 1)
        panel.axes.set_xscale("log")
        panel.axes.set_xlim(10.0**first, 10.0**last)
        ticks = [10.0**power for power in range(first, last + 1)]
    panel.axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    panel.axes.set_xticks([], minor=True)


def _shades(count: int) -> list[str]:
    """From light to dark."""
    ramp = cast("Any", LinearSegmentedColormap.from_list("noise", [_LIGHTEST, _DARKEST]))
    return [to_hex(ramp(place)) for place in (np.linspace(0, 1, count) if count > 1 else [0.5])]
