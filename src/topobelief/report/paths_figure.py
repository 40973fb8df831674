"""The candidate paths over the map: what the robot could drive, what it chose, and what it would see again.

Beneath lie the world (free space white, all else grey) and the pose graph as it stands. A band marks the poses that the chosen
path sees again, and thin lines the shortest of the loop closures that it is predicted to make. Where the candidates fill a
small part of the world, the large panel shows that part and a small one the whole.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray
from topobelief.candidates.start import Start
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision import Decision
from topobelief.report import style
from topobelief.report.canvas import Canvas, Panel
from topobelief.report.map_layers import Scene, View, draw_world
from topobelief.wording import counted
from topobelief.world import World

_MAP_WIDTHS, _MAP_HEIGHTS = (2.8, 5.6), (3.1, 6.6)  # inches, least and most
_LEFT, _BOTTOM, _TOP = 0.75, 0.50, 0.68  # margins of the map, inches
_SIDE_GAP, _SIDE_WIDTH = 0.15, 2.5  # the column right of it: whole map and key
_KEY_LINE = 0.195  # height of a line of the key, inches
_SUBTITLE_LETTER = 0.060  # width, inches
_STRETCHES_NAMED = 2  # in the subtitle at most, those with most poses


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
    goal : shape (2,) or (G, 2)
        Metres; several goals are drawn alike.
    start
        As given to `predict_actions`. Default: the last pose.

    Returns
    -------
    Figure
        `topobelief.report.canvas.save_figure` writes it.
    """
    scene = Scene.of(graph, world, paths, actions, decision, goal=goal, start=start)
    with style.style():
        width, height = map_size(scene.view)
        view = scene.view.reshaped(height / width)
        side = _LEFT + width + _SIDE_GAP
        canvas = Canvas(side + _SIDE_WIDTH, _BOTTOM + height + _TOP)
        key = scene.draw(canvas.panel(_LEFT, _BOTTOM, width, height), view)
        subtitle = _subtitle(scene, width=canvas.width - _LEFT)
        canvas.title(_LEFT, _BOTTOM + height + 0.10, _title(decision), subtitle)
        if scene.zoomed:
            whole = scene.whole
            free_height = min(height - _KEY_LINE * len(key) - 0.4, 0.5 * height)
            across = min(_SIDE_WIDTH - 0.2, free_height / whole.aspect)
            overview = canvas.panel(side, _BOTTOM + height - across * whole.aspect, across, across * whole.aspect)
            _draw_overview(overview, world, graph, paths[decision.best], whole, view)
            below = _BOTTOM + height - across * whole.aspect - 0.16
            canvas.text(side, below, _extent(whole), fontsize=8, color=style.MUTED)
        y, corner = (_BOTTOM, "lower left") if scene.zoomed else (_BOTTOM + height, "upper left")
        canvas.key(key, side, y, corner=corner)
    return canvas.figure


def map_size(view: View) -> tuple[float, float]:
    """Width and height of the panel for a view, inches."""
    width = float(np.clip(_MAP_HEIGHTS[1] / view.aspect, *_MAP_WIDTHS))
    return width, float(np.clip(width * view.aspect, *_MAP_HEIGHTS))


def _draw_overview(panel: Panel, world: World, graph: PoseGraph, best: FloatArray, whole: View, view: View) -> None:
    draw_world(panel, world, whole)
    odometry = graph.edges[(np.abs(graph.edges[:, 0] - graph.edges[:, 1]) == 1) & (graph.reading_codes == 0)]
    panel.segments(graph.positions[odometry], colors=style.ODOMETRY, linewidths=0.3)
    panel.line(best, color=style.BEST, linewidth=0.8)
    panel.rectangle(view.x_min, view.y_min, *view.size, fill=False, edgecolor=style.INK, linewidth=0.8)
    whole.shown_on(panel)
    panel.no_ticks()


def _title(decision: Decision) -> str:
    name = style.short_name(decision, decision.best)
    if decision.num_actions == 1:
        return f"{name} on the pose graph, the only candidate"
    return f"{decision.num_actions} candidate paths on the pose graph; {name} is chosen"


def _subtitle(scene: Scene, *, width: float) -> str:
    """The chosen path in numbers, with as many of the stretches that it sees again as there is room for."""
    best, stretches = scene.decision.candidates[scene.decision.best], scene.sight.stretches
    numbers = f"{best.length:.1f} m, {counted(best.num_new_poses, 'new pose')}, {best.closures()}"
    for named in range(min(_STRETCHES_NAMED, len(stretches)), 0, -1):
        names = [stretch.name(scene.graph) for stretch in stretches[:named]]
        others = len(stretches) - named
        more = f" and {counted(others, 'more stretch', 'more stretches')}" if others else ""
        subtitle = f"{numbers}; sees poses {', '.join(names)}{more} again"
        if len(subtitle) * _SUBTITLE_LETTER < width:
            return subtitle
    return numbers


def _extent(view: View) -> str:
    return f"whole map, {view.size[0]:.0f} × {view.size[1]:.0f} m"
