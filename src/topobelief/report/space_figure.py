"""A decision in space from above and from the side: heights by colour, with the candidates and what the chosen one sees again.

A plan view shows where paths lead and, by colour, on which floor; the view from the side below it, with the same x, shows how
high.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray, IntArray
from topobelief.candidates.start import Start, find_start
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision import Decision
from topobelief.report import style
from topobelief.report.canvas import Canvas, Entry, Panel
from topobelief.report.map_layers import Sight
from topobelief.report.search_figure import search_subtitle, search_title
from topobelief.search.result import SearchResult
from topobelief.wording import counted
from topobelief.world import World3D
from topobelief.world.voxels import Voxels

_WIDTHS, _HEIGHTS = (2.6, 5.4), (2.6, 5.6)  # inches, of the plan view
_SIDE_HEIGHTS = (0.8, 5.6)  # inches, of the view from the side
_TOTAL_HEIGHT = 7.2  # inches, of both where they are to scale
_TOLD_ZOOM = 1.2  # by which heights are enlarged, from which on it is said
_LEFT, _BOTTOM, _TOP, _BETWEEN, _RIGHT = 0.70, 0.50, 0.72, 0.42, 2.75
_PADDING = 0.04
_HEIGHT_COLOURS = "cividis"
_FLAT = 0.1  # metres of height below which colours of height say nothing
_ABOVE, _FROM_SIDE = np.array([0, 1]), np.array([0, 2])  # the axes of both views


def draw_space(
    graph: PoseGraph,
    world: World3D,
    paths: Sequence[FloatArray],
    action: Action,
    best: int,
    title: str,
    subtitle: str,
    *,
    goals: FloatArray,
    start: int | ArrayLike | Start | None = None,
) -> Figure:
    """Candidates in space.

    Parameters
    ----------
    graph
        The prior, in SE(3).
    world
        Where the robot may be; of a map the occupied cubes are drawn, the darker the more of them stand one behind another.
    paths
        K polylines of shape (waypoints, 3), metres.
    action
        What the best path adds to the graph.
    best
        Index of the best path.
    title, subtitle
    goals : shape (G, 3)
        May be none.
    start
        As given to `predict_actions`.

    Returns
    -------
    Figure
        `topobelief.report.canvas.save_figure` writes it.
    """
    begin = find_start(graph, start)
    sight = Sight.of(graph, begin, action)
    scene = np.concatenate([graph.positions, *paths])
    low, high = scene.min(axis=0), scene.max(axis=0)
    pad = np.maximum(_PADDING * (high - low).max(), 0.5)
    low, high = low - pad, high + pad
    heights = Normalize(
        float(graph.positions[:, 2].min()), float(max(graph.positions[:, 2].max(), graph.positions[:, 2].min() + _FLAT))
    )
    across, up, tall = (high - low).tolist()
    with style.style():
        width = float(np.clip(_TOTAL_HEIGHT * across / (up + tall), *_WIDTHS))
        height = float(np.clip(width * up / across, *_HEIGHTS))
        natural = width * tall / across
        side = float(np.clip(natural, *_SIDE_HEIGHTS))
        canvas = Canvas(_LEFT + width + _RIGHT, _BOTTOM + side + _BETWEEN + height + _TOP)
        bottom = _BOTTOM + side + _BETWEEN
        panel = canvas.panel(_LEFT, bottom, width, height)
        key = _draw(panel, _ABOVE, graph, world, paths, sight, best, begin, goals, heights)
        view_low, view_high = _shaped(low[_ABOVE], high[_ABOVE], height / width)
        panel.limits((view_low[0], view_high[0]), (view_low[1], view_high[1]))
        panel.axes.set(xlabel="", ylabel="y (m)")
        from_side = canvas.panel(_LEFT, _BOTTOM, width, side)
        _draw(from_side, _FROM_SIDE, graph, world, paths, sight, best, begin, goals, heights)
        from_side.limits((float(view_low[0]), float(view_high[0])), (float(low[2]), float(high[2])))
        from_side.axes.set(xlabel="x (m)", ylabel="z (m)")
        zoom = side / natural
        told = f"from the side, heights {zoom:.2g} times as large" if zoom > _TOLD_ZOOM else "from the side"
        canvas.text(_LEFT + width, _BOTTOM + side + 0.05, told, align="right", fontsize=7, color=style.MUTED)
        right = _LEFT + width + 0.25
        canvas.key(key, right, bottom + height, corner="upper left")
        _height_bar(canvas, heights, right, bottom)
        canvas.title(_LEFT, bottom + height + 0.12, title, subtitle)
    return canvas.figure


def space_titles(decision: Decision, found: SearchResult | None = None) -> tuple[str, str]:
    """Title and subtitle of a decision in space, from a list of candidates or a search."""
    if found is not None:
        return search_title(found), search_subtitle(found)
    best = decision.candidates[decision.best]
    name = style.short_name(decision, decision.best)
    title = (
        f"{decision.num_actions} candidate paths; {name} is chosen"
        if decision.num_actions > 1
        else f"{name}, the only candidate"
    )
    return title, f"{best.length:.1f} m, {counted(best.num_new_poses, 'new pose')}, {best.closures()}"


def _shaped(low: FloatArray, high: FloatArray, aspect: float) -> tuple[FloatArray, FloatArray]:
    """The smallest rectangle around one that has the given height per width."""
    width, height = (high - low).tolist()
    more = np.array([max(0.0, height / aspect - width), max(0.0, width * aspect - height)]) / 2
    return low - more, high + more


def _draw(
    panel: Panel,
    axes: IntArray,
    graph: PoseGraph,
    world: World3D,
    paths: Sequence[FloatArray],
    sight: Sight,
    best: int,
    begin: Start,
    goals: FloatArray,
    heights: Normalize,
) -> list[Entry]:
    """One view, onto two of the three axes; returns the key."""
    key = _draw_walls(panel, axes, world)
    positions = graph.positions
    closing = np.abs(graph.edges[:, 0] - graph.edges[:, 1]) > 1
    if closing.any():
        ends = positions[graph.edges[closing]][:, :, axes]
        panel.segments(ends, colors=style.CLOSURE, linewidths=0.3, alpha=0.5, zorder=1)
        key.append(Entry("loop closures of the graph", color=style.CLOSURE, linewidth=1.0))
    if len(sight.seen):
        seen = positions[sight.seen][:, axes]
        look: dict[str, Any] = {"linestyle": "none", "marker": "o", "color": style.SEEN_AGAIN, "markeredgewidth": 0}
        panel.line(seen, markersize=5.5, zorder=2, **look)
        key.append(Entry(f"poses it sees again ({len(sight.seen)})", markersize=6, **look))
    colours = cast("Any", ScalarMappable)(heights, _HEIGHT_COLOURS)
    middle = float(np.median(positions[:, 2]))
    odometry = graph.edges[~closing]
    if len(odometry):
        behind = next(axis for axis in range(3) if axis not in axes)
        order = np.argsort(positions[odometry].mean(axis=1)[:, behind], kind="stable")
        ends = positions[odometry[order]]
        panel.segments(ends[:, :, axes], colors=colours.to_rgba(ends.mean(axis=1)[:, 2]), linewidths=0.9, zorder=3)
        key.append(Entry("odometry of the graph, by height", color=colours.to_rgba(middle), linewidth=1.2))
    others = [path for index, path in enumerate(paths) if index != best and len(path) > 1]
    for path in others:
        panel.line(path[:, axes], color=style.SURVIVOR, linewidth=0.9, alpha=0.9, zorder=5)
    panel.line(paths[best][:, axes], color=style.BEST, linewidth=2.2, casing=3.6, zorder=7)
    key.append(Entry("the best way", color=style.BEST, linewidth=2.2))
    if others:
        key.append(Entry(f"other candidates ({len(others)})", color=style.SURVIVOR, linewidth=1.0))
    marks = [("start", begin.place[None], "o", "white", 6.0)]
    if len(goals):
        marks.append(("goal" if len(goals) == 1 else f"goals ({len(goals)})", goals, "*", style.GOAL, 12.0))
    for label, places, marker, colour, size in marks:
        shape: dict[str, Any] = {
            "marker": marker, "markerfacecolor": colour, "markeredgecolor": style.INK, "markersize": size, "linestyle": "none",
        }  # fmt: skip
        panel.line(places[:, axes], zorder=9, **shape)
        key.append(Entry(label, **shape))
    return key


def _draw_walls(panel: Panel, axes: IntArray, world: World3D) -> list[Entry]:
    """Occupied cubes of a map, seen through: the darker, the more of them stand one behind another."""
    if not isinstance(world.space, Voxels):
        return []
    across = next(axis for axis in range(3) if axis not in axes)
    occupied = ~world.space.free[1:-1, 1:-1, 1:-1]
    share = occupied.mean(axis=across)
    share = np.where(share > 0, 0.15 + 0.85 * share, 0.0)
    low, high = world.corners
    panel.axes.imshow(
        share.T, origin="lower", extent=(low[axes[0]], high[axes[0]], low[axes[1]], high[axes[1]]), cmap="Greys", vmin=0,
        vmax=1.8, zorder=0, aspect="auto", interpolation="nearest",
    )  # fmt: skip
    return [Entry("occupied, darker: more of the column", patch=True, facecolor="#B9BBC0")]


def _height_bar(canvas: Canvas, heights: Normalize, x: float, y: float) -> None:
    """The colours of heights, on the right below."""
    axes = canvas.panel(x, y, 0.12, 1.1).axes
    bar = cast("Any", canvas.figure).colorbar(cast("Any", ScalarMappable)(heights, _HEIGHT_COLOURS), cax=axes)
    bar.set_label("height z (m)", fontsize=8)
    bar.outline.set_linewidth(0.5)
