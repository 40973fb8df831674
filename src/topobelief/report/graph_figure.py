"""The picture of a pose graph by itself: odometry and loop closures from above, and the world beneath where there is one."""

from __future__ import annotations

from matplotlib.figure import Figure

from topobelief.graph.pose_graph import PoseGraph
from topobelief.report import style
from topobelief.report.canvas import Canvas
from topobelief.report.map_layers import draw_graph, draw_world, whole_view
from topobelief.report.paths_figure import map_size
from topobelief.world import World

_LEFT, _BOTTOM, _TOP = 0.75, 0.50, 0.68  # margins, inches
_SIDE_GAP, _SIDE_WIDTH = 0.15, 2.3  # the column with the key


def draw_graph_figure(graph: PoseGraph, title: str, *, world: World | None = None) -> Figure:
    """A pose graph from above.

    Parameters
    ----------
    graph
        Of one in SE(3), x and y are drawn.
    title
    world
        Drawn beneath where given.

    Returns
    -------
    Figure
        `topobelief.report.canvas.save_figure` writes it.
    """
    with style.style():
        view = whole_view(graph, world)
        width, height = map_size(view)
        view = view.reshaped(height / width)
        canvas = Canvas(_LEFT + width + _SIDE_GAP + _SIDE_WIDTH, _BOTTOM + height + _TOP)
        panel = canvas.panel(_LEFT, _BOTTOM, width, height)
        key = draw_world(panel, world, view) if world is not None else []
        key += draw_graph(panel, graph, view)
        view.shown_on(panel)
        panel.map_axes()
        landmarks = f"{graph.num_landmarks} landmarks, " if graph.num_landmarks else ""
        size = f"{graph.num_poses} poses, {landmarks}{graph.num_edges} edges"
        canvas.title(_LEFT, _BOTTOM + height + 0.10, title, size)
        if key:
            canvas.key(key, _LEFT + width + _SIDE_GAP, _BOTTOM + height, corner="upper left")
    return canvas.figure
