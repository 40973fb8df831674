"""Trips that improved a map: where each led, and what it gained of what was predicted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from topobelief.arrays import FloatArray
from topobelief.planning.registry import unit_of
from topobelief.planning.units import quantity, shown_factor, shown_unit
from topobelief.report import style
from topobelief.report.canvas import Canvas, Entry, Panel
from topobelief.report.study_figures import OBJECTIVE_NAMES
from topobelief.simulation.exploration import ENOUGH, TRIPS_DRIVEN, UNDECIDED
from topobelief.simulation.record import Leg, Record
from topobelief.wording import counted

_LEFT, _BOTTOM, _TOP, _RIGHT = 0.70, 0.50, 0.62, 0.15  # margins, inches, as all lengths here
_MAP_AREA, _MOST_WIDTH = 22.0, 7.2
_KEY_WIDTH, _GAP = 2.3, 0.20
_VALUES_HEIGHT, _VALUES_GAP = 1.5, 0.60
_ASIDE = 0.45  # m around the world
_PREDICTED, _ACHIEVED = "#999999", style.INK


def draw_trips(record: Record) -> Figure:
    """The map with the true track of each trip, and the objective before and after each, as predicted and as achieved.

    The dotted line is what no further trip can undercut, where that is known.
    """
    legs = [leg for leg in record.legs if leg.trip]
    free = record.scenario.world.free
    x_min, y_min, x_max, y_max = np.array(free.bounds) + _ASIDE * np.array([-1, -1, 1, 1])
    aspect = (y_max - y_min) / (x_max - x_min)
    width = min(_MOST_WIDTH, math.sqrt(_MAP_AREA / aspect))
    height = width * aspect
    below = _BOTTOM + _VALUES_HEIGHT + _VALUES_GAP
    with style.style():
        canvas = Canvas(_LEFT + width + _GAP + _KEY_WIDTH, below + height + _TOP)
        panel = canvas.panel(_LEFT, below, width, height)
        panel.axes.set_facecolor(style.NOT_FREE)
        panel.region(free, facecolor=style.FREE, edgecolor=style.WALL, linewidth=0.6, zorder=0)
        key = _draw_tracks(panel, record, legs)
        panel.limits((float(x_min), float(x_max)), (float(y_min), float(y_max)))
        panel.map_axes()
        canvas.title(_LEFT, below + height + 0.10, _title(record), _subtitle(record))
        canvas.key(key, _LEFT + width + _GAP, below + height, corner="upper left")
        values = canvas.panel(_LEFT, _BOTTOM, width, _VALUES_HEIGHT)
        canvas.key(_draw_values(values, record, legs), _LEFT + width + _GAP, _BOTTOM + _VALUES_HEIGHT, corner="upper left")
    return canvas.figure


def _draw_tracks(panel: Panel, record: Record, legs: Sequence[Leg]) -> list[Entry]:
    truth = record.truth[:, :2]
    first = legs[0].first_pose if legs else len(truth) - 1
    panel.line(truth[: first + 1], color=style.ODOMETRY, linewidth=1.0, zorder=3)
    key = [Entry("before the trips", color=style.ODOMETRY, linewidth=1.2)]
    for leg, colour in zip(legs, _colours(len(legs)), strict=True):
        track = truth[leg.first_pose : leg.last_pose + 1]
        panel.line(track, color=colour, linewidth=1.6, zorder=4)
        panel.line(track[-1], linestyle="none", marker="o", markersize=3.5, markerfacecolor=colour, markeredgewidth=0, zorder=5)
        key.append(Entry(f"trip {leg.trip}, {leg.distance:.1f} m", color=colour, linewidth=1.8))
    return key


def _draw_values(panel: Panel, record: Record, legs: Sequence[Leg]) -> list[Entry]:
    """Of each trip, the value before it, joined to those predicted and achieved; and of the map as it is at the end."""
    unit, found = unit_of(record.options.objective), record.exploration
    factor = shown_factor(unit)
    before, predicted, achieved = (
        factor * np.array([getattr(leg, f"{name}_value") for leg in legs]) for name in ("prior", "predicted", "achieved")
    )
    at = np.array([leg.trip for leg in legs], dtype=np.float64)
    colours = _colours(len(legs))
    for place, (x, colour) in enumerate(zip(at.tolist(), colours, strict=True)):
        panel.line([(x - 0.3, before[place]), (x, before[place]), (x + 0.3, achieved[place])], color=colour, linewidth=1.4)
    panel.line(_points(at + 0.3, predicted), linestyle="none", marker="x", markersize=8, markeredgecolor=_PREDICTED, zorder=5)
    looks: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 4, "markeredgewidth": 0}
    panel.line(_points(at + 0.3, achieved), markerfacecolor=_ACHIEVED, zorder=6, **looks)
    key = [
        Entry("predicted", linestyle="none", marker="x", markersize=8, markeredgecolor=_PREDICTED),
        Entry("achieved", markerfacecolor=_ACHIEVED, **looks),
    ]
    levels = [*before, *predicted, *achieved]
    if found is not None and not math.isnan(found.value_now):
        end = float(at[-1]) + 1 if len(at) else 1.0
        now = factor * found.value_now
        panel.line([(end - 0.3, now), (end + 0.3, now)], color=style.INK, linewidth=1.4)
        key.append(Entry("at the end", color=style.INK, linewidth=1.4))
        levels.append(now)
        if math.isfinite(found.lower_bound):
            least = factor * found.lower_bound
            panel.line([(end - 0.3, least), (end + 0.3, least)], color=style.BEST, linewidth=1.2, linestyle=(0, (1, 1)))
            key.append(Entry("no next trip below", color=style.BEST, linewidth=1.2, linestyle=(0, (1, 1))))
            levels.append(least)
        at = np.append(at, end)
    low, high = float(np.min(levels)), float(np.max(levels))
    spare = 0.08 * (high - low) or 0.1 * abs(high) or 1.0
    panel.limits((0.4, float(at[-1]) + 0.6 if len(at) else 1.6), (low - spare, high + spare))
    panel.axes.set(xlabel="trip", ylabel=f"{OBJECTIVE_NAMES[record.options.objective]} ({shown_unit(unit)})")
    names = [str(leg.trip) for leg in legs]
    panel.axes.set_xticks(at, [*names, "end"][: len(at)])
    for side in ("right", "top"):
        panel.axes.spines[side].set_visible(False)
    return key


def _points(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.column_stack([x, y])


def _colours(count: int) -> list[Any]:
    """From the first trip to the last."""
    return [colormaps["viridis"](share) for share in np.linspace(0.0, 0.85, count).tolist()]


def _subtitle(record: Record) -> str:
    """How the trips ended, in few words."""
    found, trips = record.exploration, record.options.trips
    if found is None or trips is None:
        return ""
    unit, after = unit_of(record.options.objective), f"after {counted(found.num_trips, 'trip')}"
    if found.stopped_by == ENOUGH:
        return f"enough {after}: proven that no other gains more than {quantity(trips.enough, unit)}"
    if found.stopped_by in (TRIPS_DRIVEN, UNDECIDED):
        most = "" if math.isinf(found.most) else f", none gains more than {quantity(found.most, unit)}"
        return f"ended {after}: the best next one found gains {quantity(max(found.gain, 0.0), unit)}{most}"
    return f"ended {after}: {found.stopped_by}"


def _title(record: Record) -> str:
    options = record.options
    noise = "physical noise" if options.noise is None else f"injected noise ξ = {options.noise.xi:g} rad/m"
    length = "" if options.trips is None else f" of up to {options.trips.max_length:g} m"
    return f"{record.scenario.name}: trips{length} to improve the map, {noise}, seed {options.seed}"
