"""Pictures of a simulated run: where the robot was, where it believed to be, and what its choices would leave."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from topobelief.arrays import FloatArray
from topobelief.graph.action import posterior
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.units import cell, shown_unit
from topobelief.report import style
from topobelief.report.canvas import Canvas, Entry, Panel
from topobelief.report.study_figures import OBJECTIVE_NAMES, STRATEGY_NAMES
from topobelief.simulation.comparison import HINDSIGHT, ComparedRun, StrategySummary
from topobelief.simulation.metrics import chained, from_start, position_covariances
from topobelief.simulation.record import Deliberation, Record
from topobelief.wording import closures_in_words, counted
from topobelief.world import World

_LEFT, _BOTTOM, _TOP, _RIGHT = 0.70, 0.50, 0.62, 0.15  # margins, inches, as all lengths here
_MAP_AREA = 22.0  # of the map of a run
_KEY_WIDTH, _KEY_LINE, _GAP = 2.3, 0.195, 0.20
_ERRORS_HEIGHT, _ERRORS_GAP = 1.25, 0.60
_TIE = 1e-9  # of the objective, within which candidates leave the same
_ELLIPSES = 12  # along a run, about as far from one another
_CONFIDENCE = math.sqrt(-2 * math.log(0.05))  # standard deviations of a plane's 95 % ellipse
_TRUE, _ESTIMATE, _WHEELS, _DISTURBED = "#111111", style.BEST, style.SURVIVOR, "#CC79A7"


@dataclass(frozen=True, slots=True)
class _Track:
    """Key poses by one way of knowing them."""

    label: str
    poses: FloatArray
    colour: str
    dashes: str | tuple[int, tuple[float, ...]]


def draw_run(record: Record) -> Figure:
    """The map with the true, estimated and dead-reckoned tracks, and their errors along the way.

    Tracks begin at the true start, which is known, and so errors begin at 0; the ellipses hold a position of the estimate with
    95 %, the first pose held, if the graph's noise is what it says.
    """
    truth = record.truth
    tracks = [_Track("wheel odometry", record.history.key_poses.wheel_odometry, _WHEELS, (0, (4, 2)))]
    if record.options.noise is not None:
        tracks.append(_Track("odometry of the graph alone", chained(record.graph), _DISTURBED, (0, (1, 1.4))))
    tracks.append(_Track("estimate", record.graph.poses, _ESTIMATE, "-"))
    shown = [from_start(track.poses, truth) for track in tracks]
    x_min, y_min, x_max, y_max = _extent([truth, *shown], record.scenario.world)
    aspect = (y_max - y_min) / (x_max - x_min)
    width = math.sqrt(_MAP_AREA / aspect)
    width, height = (7.2, 7.2 * aspect) if width > 7.2 else (width, width * aspect)
    below = _BOTTOM + _ERRORS_HEIGHT + _ERRORS_GAP
    with style.style():
        canvas = Canvas(_LEFT + width + _GAP + _KEY_WIDTH, below + height + _TOP)
        panel = canvas.panel(_LEFT, below, width, height)
        key = _draw_world(panel, record.scenario.world)
        panel.line(_driven(record), color=_TRUE, linewidth=1.0, zorder=4)
        key.append(Entry("true track", color=_TRUE, linewidth=1.2))
        for track, poses in zip(tracks, shown, strict=True):
            panel.line(poses[:, :2], color=track.colour, linestyle=track.dashes, linewidth=1.3, zorder=5)
            key.append(Entry(track.label, color=track.colour, linestyle=track.dashes, linewidth=1.5))
        key += _draw_closures(panel, record.graph, shown[-1])
        key += _draw_ellipses(panel, record.graph, shown[-1])
        key += _draw_goals(panel, record)
        panel.limits((x_min, x_max), (y_min, y_max))
        panel.map_axes()
        canvas.title(_LEFT, below + height + 0.10, _title(record), _subtitle(record))
        canvas.key(key, _LEFT + width + _GAP, below + height, corner="upper left")
        _draw_errors(canvas.panel(_LEFT, _BOTTOM, width, _ERRORS_HEIGHT), tracks, shown, record)
    return canvas.figure


def draw_topologies(each: Deliberation, world: World, *, name: str) -> Figure:
    """The graphs after the candidate with the least objective and after the one with the greatest, side by side.

    Parameters
    ----------
    each
        A decision.
    world
        What the robot knew.
    name
        Of the decision.
    """
    question, values = each.question, each.values
    best, worst = int(np.argmin(values)), len(values) - 1 - int(np.argmax(values[::-1]))  # of equal ones the longest is worst
    graphs = [posterior(question.graph, question.actions[index]) for index in (best, worst)]
    every = [graph.poses for graph in graphs]
    x_min, y_min, x_max, y_max = _extent(every, world)
    aspect = (y_max - y_min) / (x_max - x_min)
    width = min(4.2, math.sqrt(14 / aspect))
    height = width * aspect
    words = ("least", "greatest") if np.ptp(values) > _TIE else ("equal", "equal")
    with style.style():
        canvas = Canvas(_LEFT + 2 * width + 0.45 + _RIGHT, _BOTTOM + height + _TOP + 0.62)
        bottom = _BOTTOM + 0.42
        for place, (index, graph, word) in enumerate(zip((best, worst), graphs, words, strict=True)):
            left = _LEFT + place * (width + 0.45)
            panel = canvas.panel(left, bottom, width, height)
            _draw_world(panel, world)
            key = _draw_topology(panel, graph, question.graph.num_poses)
            panel.limits((x_min, x_max), (y_min, y_max))
            panel.map_axes()
            if place:
                panel.axes.set_ylabel("")
            chosen = ", chosen" if index == each.choice.index else ""
            action = question.actions[index]
            canvas.title(
                left,
                bottom + height + 0.08,
                f"Path {index} of {len(each.paths)}, {word} {_quantity(question.objective)}{chosen}",
                f"{cell(values[index], question.unit)} {shown_unit(question.unit)}, {question.lengths[index]:.1f} m, "
                f"{counted(action.num_new_poses, 'pose')}, {closures_in_words(action.num_closures, action.expected_closures)}",
            )
            if place == 0:
                canvas.key(key, _LEFT, 0.08, corner="lower left", columns=len(key))
        canvas.text(_LEFT, canvas.height - 0.20, name, fontsize=8, color=style.MUTED)
    return canvas.figure


def draw_comparison(runs: Sequence[ComparedRun], summaries: Sequence[StrategySummary], *, baseline: str) -> Figure:
    """Expected error of each strategy beside the baseline's on the same seed: one row per strategy, one dot per seed."""
    found = [each for each in summaries if each.strategy != baseline]
    reference = {run.seed: run.error_shared for run in runs if run.strategy == baseline}
    row, left, width = 0.42, 1.75, 4.6
    height = row * max(1, len(found))
    with style.style():
        canvas = Canvas(left + width + 1.55, 0.55 + height + 0.72)
        panel = canvas.panel(left, 0.55, width, height)
        for place, each in enumerate(found):
            mine = [run for run in runs if run.strategy == each.strategy and run.seed in reference]
            ratios = np.array([100 * (run.error_shared / reference[run.seed] - 1) for run in mine])
            spread = np.linspace(-0.22, 0.22, len(ratios)) if len(ratios) > 1 else np.zeros(1)
            panel.line(
                np.column_stack([ratios, place + spread]),
                linestyle="none",
                marker="o",
                markersize=3.2,
                markerfacecolor=style.SURVIVOR,
                markeredgewidth=0,
                alpha=0.8,
            )
            median = float(np.median(ratios))
            panel.line([(median, place - 0.34), (median, place + 0.34)], color=style.BEST, linewidth=2.2, zorder=5)
            y = 0.55 + height - (place + 0.5) * row - 0.04
            canvas.text(left - 0.12, y, _strategy(each.strategy), align="right", fontsize=8)
            canvas.text(left + width + 0.12, y, f"better in {each.share_better:.0%}", fontsize=8, color=style.MUTED)
        panel.axes.axvline(0, color=style.MUTED, linewidth=0.8, zorder=1)
        panel.axes.set_ylim(max(1, len(found)) - 0.5, -0.5)
        panel.value_axis(f"error against {_strategy(baseline)} on the same seed (%)")
        canvas.title(
            0.25,
            canvas.height - 0.42,
            "Expected error of the map that stood before the last session",
            "one dot per seed, mean over redrawn noise; bar: median; left of zero is better",
        )
    return canvas.figure


def _draw_world(panel: Panel, world: World) -> list[Entry]:
    panel.axes.set_facecolor(style.NOT_FREE)
    panel.region(world.free, facecolor=style.FREE, edgecolor=style.WALL, linewidth=0.6, zorder=0)
    return [Entry("not free", patch=True, facecolor=style.NOT_FREE, edgecolor=style.WALL, linewidth=0.7)]


def _driven(record: Record) -> FloatArray:
    """The true track, as dense as it was recorded."""
    track = record.history.track
    return track[:, 1:3] if len(track) > len(record.truth) else record.truth[:, :2]


def _draw_closures(panel: Panel, graph: PoseGraph, poses: FloatArray) -> list[Entry]:
    closing = np.abs(graph.edges[:, 0] - graph.edges[:, 1]) > 1
    if not closing.any():
        return []
    panel.segments(poses[:, :2][graph.edges[closing]], colors=style.CLOSURE, linewidths=0.5, zorder=2)
    return [Entry(f"loop closures ({int(closing.sum())})", color=style.CLOSURE, linewidth=1.2)]


def _draw_ellipses(panel: Panel, graph: PoseGraph, poses: FloatArray) -> list[Entry]:
    if graph.num_poses < 2:
        return []
    turn = float(poses[0, 2] - graph.poses[0, 2])
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    covariances = rotation @ position_covariances(graph) @ rotation.T
    angles = np.linspace(0, 2 * np.pi, 49)
    circle = np.stack([np.cos(angles), np.sin(angles)])
    driven = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(graph.positions, axis=0), axis=1))]
    stops = np.linspace(float(driven[-1]), 0.0, _ELLIPSES, endpoint=False) * (1 - 1e-9)
    for index in sorted({int(place) for place in np.searchsorted(driven, stops)}):
        values, vectors = np.linalg.eigh(covariances[index])
        outline = poses[index, :2] + (vectors * _CONFIDENCE * np.sqrt(np.maximum(values, 0)) @ circle).T
        panel.line(outline, color=style.PREDICTED_CLOSURE, linewidth=0.9, zorder=6)
    return [Entry("95 % of a position", color=style.PREDICTED_CLOSURE, linewidth=1.2)]


def _draw_goals(panel: Panel, record: Record) -> list[Entry]:
    start = record.scenario.start
    reached = {leg.goal for leg in record.legs if leg.arrived}
    edge: dict[str, Any] = {"linestyle": "none", "markeredgecolor": style.INK, "markeredgewidth": 0.7}
    circle: dict[str, Any] = {"marker": "o", "markersize": 6, "markerfacecolor": "white", **edge}
    look: dict[str, Any] = {"marker": "*", "markersize": 11, **edge}
    panel.line(start[:2], zorder=8, **circle)
    key = [Entry("start", **circle)]
    for wanted, label, colour in ((True, "goal", style.GOAL), (False, "goal, not reached", "white")):
        places = [
            (number, goal.place) for number, goal in enumerate(record.scenario.goals, start=1) if (number in reached) == wanted
        ]
        for number, place in places:
            panel.line(place, markerfacecolor=colour, zorder=8, **look)
            panel.axes.annotate(str(number), place, xytext=(5, 4), textcoords="offset points", fontsize=7.5, zorder=9)
        if places:
            key.append(Entry(label, markerfacecolor=colour, **look))
    return key


def _draw_errors(panel: Panel, tracks: Sequence[_Track], shown: Sequence[FloatArray], record: Record) -> None:
    """Distance of each track from the true one over the metres driven."""
    driven = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(record.truth[:, :2], axis=0), axis=1))]
    largest = 0.0
    for track, poses in zip(tracks, shown, strict=True):
        errors = np.linalg.norm(poses[:, :2] - record.truth[:, :2], axis=1)
        largest = max(largest, float(errors.max()))
        panel.line(np.column_stack([driven, errors]), color=track.colour, linestyle=track.dashes, linewidth=1.2)
    for leg in record.legs:
        panel.axes.axvline(driven[leg.last_pose], color=style.GRID, linewidth=0.7, zorder=0)
    panel.limits((0.0, max(float(driven[-1]), 1.0)), (0.0, 1.08 * max(largest, 0.01)))
    panel.axes.set(xlabel="driven (m)", ylabel="position error (m)")
    for side in ("right", "top"):
        panel.axes.spines[side].set_visible(False)


def _draw_topology(panel: Panel, graph: PoseGraph, num_existing: int) -> list[Entry]:
    """Edges of the prior and of the new part, closures apart from odometry, and the poses."""
    positions, edges = graph.positions, graph.edges
    closing = np.abs(edges[:, 0] - edges[:, 1]) > 1
    new = (edges >= num_existing).any(axis=1)
    looks = (
        ("closures", closing & ~new, style.CLOSURE, 0.6, 1),
        ("odometry", ~closing & ~new, style.ODOMETRY, 1.0, 3),
        ("predicted closures", closing & new, style.PREDICTED_CLOSURE, 0.7, 2),
        ("candidate", ~closing & new, style.BEST, 1.5, 4),
    )
    for _, chosen, colour, width, layer in looks:
        panel.segments(positions[edges[chosen]], colors=colour, linewidths=width, zorder=layer)
    for part, colour in ((positions[:num_existing], style.ODOMETRY), (positions[num_existing:], style.BEST)):
        panel.line(part, linestyle="none", marker="o", markersize=2.2, markerfacecolor=colour, markeredgewidth=0, zorder=5)
    return [Entry(label, color=colour, linewidth=max(1.2, width)) for label, _, colour, width, _ in looks]


def _extent(tracks: Sequence[FloatArray], world: World) -> tuple[float, float, float, float]:
    """What holds the world and all tracks."""
    points = np.concatenate([np.reshape(world.free.bounds, (2, 2)), *(track[:, :2] for track in tracks)])
    low, high = points.min(axis=0) - 0.4, points.max(axis=0) + 0.4
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _title(record: Record) -> str:
    options = record.options
    noise = "physical noise" if options.noise is None else f"injected noise ξ = {options.noise.xi:g} rad/m"
    what = f"{_strategy(options.strategy)}, {_quantity(options.objective)}"
    return f"{record.scenario.name}: {what}, {noise}, seed {options.seed}"


def _subtitle(record: Record) -> str:
    goals = len(record.scenario.goals)
    return (
        f"{record.num_goals_reached} of {goals} goal{'s' if goals > 1 else ''} reached, "
        f"{sum(leg.distance for leg in record.legs):.0f} m, {record.graph.num_poses} key poses; tracks begin at the true start"
    )


def _strategy(name: str) -> str:
    """In words; an objective of its own in brackets."""
    if name == HINDSIGHT:
        return "best in hindsight"
    strategy, _, objective = name.partition(":")
    shown = STRATEGY_NAMES.get(strategy, strategy)
    return f"{shown} ({objective})" if objective else shown


def _quantity(objective: str) -> str:
    return OBJECTIVE_NAMES.get(objective, objective)
