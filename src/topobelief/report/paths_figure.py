"""The candidate paths over the map: what the robot could drive, what it chose, and what it would see again.

Beneath lie the world (free space white, all else grey) and the pose graph as it stands; the chosen path carries the loop
closures that it is predicted to make. Where the candidates fill a small part of the world, the large panel shows that
part and a small one the whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray
from topobelief.candidates.start import Start, find_start
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision import Decision
from topobelief.report import style
from topobelief.report.canvas import Canvas, Entry, Panel
from topobelief.world import World

_MAP_WIDTHS, _MAP_HEIGHTS = (2.8, 5.6), (3.1, 6.6)  # inches, least and most
_LEFT, _BOTTOM, _TOP = 0.75, 0.50, 0.68  # margins of the map, inches
_SIDE_GAP, _SIDE_WIDTH = 0.15, 2.5  # the column right of it: whole map and key
_KEY_LINE = 0.195  # height of a line of the key, inches
_MIN_VIEW = 6.0  # metres
_OVERVIEW_BELOW = 0.6  # share of the whole map's width and height


@dataclass(frozen=True, slots=True)
class View:
    """A rectangle of the plane, metres."""

    x_min: float
    y_min: float
    x_max: float
    y_max: float

    @classmethod
    def around(cls, points: FloatArray, *, padding: float) -> View:
        """All points with room around, and no side so short that nothing of the surroundings would be seen."""
        low, high = points.min(axis=0), points.max(axis=0)
        pads = np.maximum(padding * np.max(high - low), (_MIN_VIEW - (high - low)) / 2)
        return cls(*(low - pads).tolist(), *(high + pads).tolist())

    @property
    def size(self) -> tuple[float, float]:
        return self.x_max - self.x_min, self.y_max - self.y_min

    @property
    def aspect(self) -> float:
        return self.size[1] / self.size[0]

    def reshaped(self, aspect: float) -> View:
        """The smallest view around this one with the given height per width."""
        width, height = self.size
        dx, dy = max(0.0, height / aspect - width) / 2, max(0.0, width * aspect - height) / 2
        return View(self.x_min - dx, self.y_min - dy, self.x_max + dx, self.y_max + dy)

    def shown_on(self, panel: Panel) -> None:
        panel.limits((self.x_min, self.x_max), (self.y_min, self.y_max))


def draw_paths(
    graph: PoseGraph,
    world: World,
    paths: Sequence[FloatArray],
    actions: Sequence[Action],
    decision: Decision,
    *,
    goal: ArrayLike,
    start: int | ArrayLike | Start | None = None,
) -> Figure:
    """Candidates over the map, the best one marked, with the prior graph beneath.

    Parameters
    ----------
    graph
        The prior, in SE(2).
    world
        Where the robot may be.
    paths
        K polylines of shape (waypoints, 2), metres, world frame.
    actions
        K, what each path adds to the graph.
    decision
        On these actions.
    goal : shape (2,)
        Metres.
    start
        As given to `predict_actions`. Default: the last pose.

    Returns
    -------
    Figure
        `topobelief.report.canvas.save_figure` writes it.
    """
    begin, end = find_start(graph, start, world=world), np.asarray(goal, dtype=np.float64)
    closures = predicted_closures(graph, begin, actions[decision.best])
    seen = np.concatenate([begin.place[None], end[None], *paths, closures.reshape(-1, 2)])
    everything = np.concatenate([np.reshape(world.free.bounds, (2, 2)), graph.positions, seen])
    view, whole = View.around(seen, padding=0.07), View.around(everything, padding=0.02)
    part = max(near / far for near, far in zip(view.size, whole.size, strict=True))
    zoomed = part < _OVERVIEW_BELOW
    view = view if zoomed else whole
    with style.style():
        width = float(np.clip(_MAP_HEIGHTS[1] / view.aspect, *_MAP_WIDTHS))
        height = float(np.clip(width * view.aspect, *_MAP_HEIGHTS))
        view = view.reshaped(height / width)
        side = _LEFT + width + _SIDE_GAP
        canvas = Canvas(side + _SIDE_WIDTH, _BOTTOM + height + _TOP)
        panel = canvas.panel(_LEFT, _BOTTOM, width, height)
        key = draw_world(panel, world, view)
        key += draw_graph(panel, graph, view)
        key += _draw_candidates(panel, paths, closures, decision)
        key += _draw_ends(panel, graph, begin, end)
        view.shown_on(panel)
        panel.map_axes()
        canvas.title(_LEFT, _BOTTOM + height + 0.10, _title(decision), _subtitle(decision))
        if zoomed:
            free_height = min(height - _KEY_LINE * len(key) - 0.2, 0.5 * height)
            across = min(_SIDE_WIDTH - 0.2, free_height / whole.aspect)
            overview = canvas.panel(side, _BOTTOM + height - across * whole.aspect, across, across * whole.aspect)
            draw_overview(overview, world, graph, paths[decision.best], whole, view)
            canvas.text(side, _BOTTOM + height + 0.10, _extent(whole), fontsize=8, color=style.MUTED)
        y, corner = (_BOTTOM, "lower left") if zoomed else (_BOTTOM + height, "upper left")
        canvas.key(key, side, y, corner=corner)
    return canvas.figure


def draw_world(panel: Panel, world: World, view: View) -> list[Entry]:
    panel.axes.set_facecolor(style.NOT_FREE)
    outline = float(np.clip(60 / max(view.size), 0.15, 0.7))  # walls of a town must not hide its streets
    panel.region(world.free, facecolor=style.FREE, edgecolor=style.WALL, linewidth=outline, zorder=0)
    return [Entry("not free", patch=True, facecolor=style.NOT_FREE, edgecolor=style.WALL, linewidth=0.7)]


def draw_graph(panel: Panel, graph: PoseGraph, view: View) -> list[Entry]:
    """Odometry and loop closures of the prior; the more poses in view, the thinner."""
    low, high = (view.x_min, view.y_min), (view.x_max, view.y_max)
    inside = ((graph.positions >= low) & (graph.positions <= high)).all(axis=1)
    thin = float(np.clip(1.2 - 0.25 * np.log10(1 + np.count_nonzero(inside)), 0.3, 1.0))
    closing = np.abs(graph.edges[:, 0] - graph.edges[:, 1]) > 1
    key: list[Entry] = []
    for label, chosen, colour, width, layer in (
        ("odometry of the graph", ~closing, style.ODOMETRY, 1.1 * thin, 2),
        ("loop closures of the graph", closing, style.CLOSURE, 0.9 * thin, 1),
    ):
        if chosen.any():
            panel.segments(graph.positions[graph.edges[chosen]], colors=colour, linewidths=width, zorder=layer)
            key.append(Entry(label, color=colour, linewidth=max(width, 0.9)))
    return key


def _draw_candidates(panel: Panel, paths: Sequence[FloatArray], closures: FloatArray, decision: Decision) -> list[Entry]:
    """The best one's closures beneath, then ruled-out paths, the survivors, and the best itself."""
    best = decision.best
    panel.line(paths[best], color=style.BEST, linewidth=2.4, casing=4.2, zorder=7)
    key = [Entry(f"{style.short_name(decision, best)}, the best", color=style.BEST, linewidth=2.4)]
    if len(closures):
        per_pose = len(closures) / max(1, decision.candidates[best].num_new_poses)
        faint = float(np.clip(6 / per_pose, 0.2, 0.9))  # many overlap
        panel.segments(closures, colors=style.PREDICTED_CLOSURE, linewidths=0.7, alpha=faint, zorder=3)
        label = f"its predicted loop closures ({len(closures)})"
        key.append(Entry(label, color=style.PREDICTED_CLOSURE, linewidth=1.2))
    surviving = set(decision.survivors.tolist()) - {best}
    ruled_out = set(range(decision.num_actions)) - surviving - {best}
    looks: tuple[tuple[str, set[int], dict[str, Any]], ...] = (
        ("may still be optimal", surviving, {"color": style.SURVIVOR, "linewidth": 1.1, "zorder": 5}),
        ("ruled out", ruled_out, {"color": style.RULED_OUT, "linewidth": 0.9, "linestyle": (0, (4, 2)), "zorder": 4}),
    )
    for label, chosen, look in looks:
        for action in sorted(chosen):
            panel.line(paths[action], **look)
        if chosen:
            key.append(Entry(f"{label} ({len(chosen)})", **look))
    return key


def _draw_ends(panel: Panel, graph: PoseGraph, start: Start, goal: FloatArray) -> list[Entry]:
    at_pose = "the graph's last pose" if start.pose == graph.num_poses - 1 else f"pose {graph.ids[start.pose]}"
    name = f"start, {f'near {at_pose}' if start.distance(graph) else at_pose}"
    key: list[Entry] = []
    for label, place, marker, colour, size in (
        (name, start.place, "o", "white", 6.0),
        ("goal", goal, "*", style.GOAL, 12.0),
    ):
        look: dict[str, Any] = {"marker": marker, "markerfacecolor": colour, "markeredgecolor": style.INK, "markersize": size}
        panel.line(place, linestyle="none", zorder=9, **look)
        key.append(Entry(label, linestyle="none", **look))
    return key


def draw_overview(panel: Panel, world: World, graph: PoseGraph, best: FloatArray, whole: View, view: View) -> None:
    draw_world(panel, world, whole)
    odometry = graph.edges[np.abs(graph.edges[:, 0] - graph.edges[:, 1]) == 1]
    panel.segments(graph.positions[odometry], colors=style.ODOMETRY, linewidths=0.3)
    panel.line(best, color=style.BEST, linewidth=0.8)
    panel.rectangle(view.x_min, view.y_min, *view.size, fill=False, edgecolor=style.INK, linewidth=0.8)
    whole.shown_on(panel)
    panel.no_ticks()


def predicted_closures(graph: PoseGraph, start: Start, action: Action) -> FloatArray:
    """Segments of the action's edges other than its odometry, shape (closures, 2, 2)."""
    positions = np.concatenate([graph.positions, graph.group.position(action.poses)])
    low, high = np.sort(action.edges, axis=1).T
    first = (low == start.pose) & (high == graph.num_poses)
    between_new = (low >= graph.num_poses) & (high - low == 1)
    return positions[action.edges[~(first | between_new)]]


def _title(decision: Decision) -> str:
    name = style.short_name(decision, decision.best)
    if decision.num_actions == 1:
        return f"{name} on the pose graph, the only candidate"
    return f"{decision.num_actions} candidate paths on the pose graph; {name} is chosen"


def _subtitle(decision: Decision) -> str:
    best = decision.candidates[decision.best]
    return f"{best.length:.1f} m, {best.num_new_poses} new poses, {best.num_closures} predicted loop closures"


def _extent(view: View) -> str:
    return f"whole map, {view.size[0]:.0f} × {view.size[1]:.0f} m"
