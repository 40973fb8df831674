"""The planning sessions on the floor plan: candidates on the roadmap, and what the best and the worst of them leave."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from topobelief.report import style
from topobelief.report.canvas import Entry, Panel
from topobelief.report.reproduction.panels import MARGIN, Grid
from topobelief.reproduction.planning_sessions import PlanningSession
from topobelief.reproduction.trajectory_uncertainty import TrajectoryUncertainty

_WIDTH, _ELLIPSE_POINTS = 3.9, 37
_CONFIDENCE = math.sqrt(-2 * math.log(0.05))  # standard deviations of a plane's 95 % ellipse


def draw_candidates(sessions: Sequence[PlanningSession], best: Sequence[int]) -> Figure:
    """Candidate paths over the roadmap, one panel per session.

    Parameters
    ----------
    sessions
        Of one world.
    best
        Index of the action of least joint entropy in each.
    """
    with style.style():
        grid = _map_grid(sessions[0], 1, len(sessions))
        for column, (session, index) in enumerate(zip(sessions, best, strict=True)):
            panel = grid.panel(0, column, f"{session.name}: {len(session.paths)} candidates")
            _draw_floor(panel, session)
            panel.segments(session.roadmap.vertices[session.roadmap.edges], colors="#E4DCCB", linewidths=0.25, zorder=1)
            if session.graph.num_poses > 1:
                panel.line(session.graph.positions, color=style.ODOMETRY, linewidth=2.0, zorder=3)
            for number, path in enumerate(session.paths):
                if number != index:
                    panel.line(path, color=style.SURVIVOR, linewidth=0.9, alpha=0.8, zorder=4)
            panel.line(session.paths[index], color=style.BEST, linewidth=2.0, casing=3.4, zorder=5)
            _draw_ends(panel, session)
        grid.headline("Candidate paths over the roadmap", _subtitle(sessions[0]))
        entries = [
            Entry("roadmap", color="#D3C7AE", linewidth=1),
            Entry("driven before", color=style.ODOMETRY, linewidth=2),
            Entry("candidate", color=style.SURVIVOR, linewidth=1.2),
            Entry("least joint entropy", color=style.BEST, linewidth=2),
            *_end_entries(),
        ]
        grid.canvas.key(entries, MARGIN, 0.14, corner="lower left", columns=len(entries))
    return grid.canvas.figure


def draw_uncertainty(pairs: Sequence[tuple[TrajectoryUncertainty, TrajectoryUncertainty]]) -> Figure:
    """Topology and covariances after the best and after the worst action; one row per session.

    Parameters
    ----------
    pairs
        (best, worst) of each session.
    """
    with style.style():
        grid = _map_grid(pairs[0][0].session, len(pairs), 2)
        for row, pair in enumerate(pairs):
            for column, (word, each) in enumerate(zip(("best", "worst"), pair, strict=True)):
                action = each.session.actions[each.action]
                title = (
                    f"{each.session.name}, {word}: path {each.action}, J = {each.entropy:.0f} nats, "
                    f"{action.num_new_poses} new poses, {action.num_closures} closures"
                ).replace("-", "\N{MINUS SIGN}")
                _draw_belief(grid.panel(row, column, title), each)
        grid.headline("What the best and the worst action leave", _subtitle(pairs[0][0].session))
        entries = [
            Entry("driven before", color=style.ODOMETRY, linewidth=1.6),
            Entry("action", color=style.BEST, linewidth=1.6),
            Entry("loop closures", color=style.CLOSURE, linewidth=1.2),
            Entry("95 % of a position, the first held", color=style.PREDICTED_CLOSURE, linewidth=1.2),
            *_end_entries(),
        ]
        grid.canvas.key(entries, MARGIN, 0.14, corner="lower left", columns=len(entries))
    return grid.canvas.figure


def _map_grid(session: PlanningSession, rows: int, columns: int) -> Grid:
    x_min, y_min, x_max, y_max = session.world.bounds
    return Grid(rows, columns, width=_WIDTH, height=_WIDTH * (y_max - y_min) / (x_max - x_min), across=0.7, down=0.8)


def _draw_floor(panel: Panel, session: PlanningSession) -> None:
    panel.axes.set_facecolor(style.NOT_FREE)
    panel.region(session.world.free, facecolor=style.FREE, edgecolor=style.WALL, linewidth=0.5, zorder=0)
    x_min, y_min, x_max, y_max = session.world.bounds
    panel.limits((x_min, x_max), (y_min, y_max))
    panel.map_axes()


def _draw_belief(panel: Panel, each: TrajectoryUncertainty) -> None:
    _draw_floor(panel, each.session)
    graph, edges = each.graph, each.graph.edges
    closing = np.abs(edges[:, 0] - edges[:, 1]) > 1
    new = edges[:, 1] >= each.session.graph.num_poses
    for chosen, colour, width, layer in (
        (closing, style.CLOSURE, 0.9, 1),
        (~closing & ~new, style.ODOMETRY, 1.4, 3),
        (~closing & new, style.BEST, 1.4, 4),
    ):
        panel.segments(graph.positions[edges[chosen]], colors=colour, linewidths=width, zorder=layer)
    angles = np.linspace(0, 2 * np.pi, _ELLIPSE_POINTS)
    circle = np.stack([np.cos(angles), np.sin(angles)])
    for place, covariance in zip(graph.positions[1:], each.covariances[1:], strict=True):
        values, vectors = np.linalg.eigh(covariance)
        outline = place + (vectors * _CONFIDENCE * np.sqrt(np.maximum(values, 0)) @ circle).T
        panel.line(outline, color=style.PREDICTED_CLOSURE, linewidth=0.7, alpha=0.85, zorder=5)
    _draw_ends(panel, each.session)


def _draw_ends(panel: Panel, session: PlanningSession) -> None:
    edge: dict[str, Any] = {"linestyle": "none", "markeredgecolor": style.INK, "markeredgewidth": 0.8, "zorder": 8}
    panel.line(session.graph.positions[-1], marker="o", markerfacecolor="white", markersize=6, **edge)
    panel.line(session.goal, marker="*", markerfacecolor=style.GOAL, markersize=11, **edge)


def _end_entries() -> list[Entry]:
    edge: dict[str, Any] = {"linestyle": "none", "markeredgecolor": style.INK}
    return [
        Entry("start", marker="o", markerfacecolor="white", markersize=6, **edge),
        Entry("goal", marker="*", markerfacecolor=style.GOAL, markersize=11, **edge),
    ]


def _subtitle(session: PlanningSession) -> str:
    return f"Willow Garage office, seed {session.seed}, ξ = {session.xi:g}"
