"""Pictures for a notebook or a figure of one's own: matplotlib axes in, axes out.

The same layers as in the pictures of the command line, on axes that the caller brings or on new ones of pyplot.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from typing import Any

from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray
from topobelief.candidates.start import Start
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision import Decision
from topobelief.report import style
from topobelief.report.bounds_figure import draw_rows
from topobelief.report.canvas import Panel, new_panel
from topobelief.report.map_layers import Scene, draw_world, whole_view
from topobelief.report.map_layers import draw_graph as draw_graph_layer
from topobelief.report.paths_figure import map_size
from topobelief.world import World

_KEY_WIDTH = 2.6  # inches, of the key beside new axes
_ROW = 0.22  # inches
_BOUNDS_WIDTH = 7.5  # inches


def draw_graph(graph: PoseGraph, *, world: World | None = None, axes: Any = None) -> Any:
    """A pose graph from above: odometry and loop closures.

    Parameters
    ----------
    graph
        In SE(3), x and y are drawn.
    world
        Drawn beneath where given.
    axes : matplotlib.axes.Axes, optional
        Default: new ones of pyplot.

    Returns
    -------
    matplotlib.axes.Axes
        Metres, with a key on their right.
    """
    view = whole_view(graph, world)
    width, height = map_size(view)
    with _panel(axes, width + _KEY_WIDTH, height) as panel:
        key = draw_world(panel, world, view) if world is not None else []
        key += draw_graph_layer(panel, graph, view)
        view.shown_on(panel)
        panel.map_axes()
        panel.key(key)
    return panel.axes


def draw_paths(
    graph: PoseGraph,
    paths: Sequence[FloatArray],
    actions: Sequence[Action],
    decision: Decision,
    *,
    world: World | None = None,
    goal: ArrayLike | None = None,
    start: int | ArrayLike | Start | None = None,
    axes: Any = None,
) -> Any:
    """Candidate paths on the pose graph, the chosen one with what it sees again.

    Parameters
    ----------
    graph
        The prior, in SE(2).
    paths
        K polylines of shape (waypoints, 2), metres, world frame.
    actions
        K, what each path adds to the graph.
    decision
        On these actions.
    world
        Where the robot may be; drawn beneath where given.
    goal : shape (2,) or (G, 2), optional
        Metres. Default: where the chosen path ends.
    start
        As given to `predict_actions`. Default: the last pose.
    axes : matplotlib.axes.Axes, optional
        Default: new ones of pyplot.

    Returns
    -------
    matplotlib.axes.Axes
        Metres; limited to the part that the candidates fill where that is small. With a key on their right.
    """
    scene = Scene.of(graph, world, paths, actions, decision, goal=goal, start=start)
    width, height = map_size(scene.view)
    with _panel(axes, width + _KEY_WIDTH, height) as panel:
        panel.key(scene.draw(panel, scene.view))
    return panel.axes


def draw_bounds(decision: Decision, entropies: ArrayLike | None = None, *, axes: Any = None) -> Any:
    """Interval of each action from its lower to its upper bound, a row each, in the order of the ranking.

    Parameters
    ----------
    decision
        Its bounds may be missing.
    entropies : shape (K,), optional
        Exact objective of each action, cost excluded, nan where unknown. Default: those that the decision evaluated.
    axes : matplotlib.axes.Axes, optional
        Default: new ones of pyplot.

    Returns
    -------
    matplotlib.axes.Axes
        With a key on their right. What lies right of the dashed line as a whole cannot be the best.
    """
    ranking: list[int] = decision.ranking.tolist()
    with _panel(axes, _BOUNDS_WIDTH, 1.0 + _ROW * len(ranking)) as panel:
        key = draw_rows(panel, decision, entropies)
        panel.names([style.short_name(decision, action) for action in ranking])
        panel.key(key)
    return panel.axes


@contextmanager
def _panel(axes: Any, width: float, height: float) -> Generator[Panel]:
    """The caller's axes with the caller's settings, or new ones with ours."""
    if axes is not None:
        yield Panel(axes)
        return
    with style.style():
        yield new_panel(width, height)
