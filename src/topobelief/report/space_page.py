"""A decision in space as one HTML page that needs no network: turn it, zoom in, hover over a path."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import BoolArray, FloatArray
from topobelief.candidates.start import Start, find_start
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.json_values import json_in_script
from topobelief.optional import load
from topobelief.report import style
from topobelief.report.map_layers import Sight
from topobelief.world import World3D
from topobelief.world.voxels import Voxels

_MOST_CUBES = 40_000  # drawn
_EYE = {"x": 1.5, "y": -1.8, "z": 1.3}  # of the one who looks, in sides of the scene
_DIGITS = 3  # of coordinates, millimetres

_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<style>
html, body {{ margin: 0; height: 100%; font: 14px/1.4 system-ui, sans-serif; color: #222; }}
body {{ display: flex; flex-direction: column; }}
header {{ padding: 10px 16px 0; }}
h1 {{ font-size: 17px; margin: 0; }} p {{ margin: 2px 0 0; color: #5a5a5a; }}
#scene {{ flex: 1; min-height: 0; }}
</style></head><body>
<header><h1>{title}</h1><p>{subtitle}</p></header>
<div id="scene"></div>
<script>{plotly}</script>
<script>
const scene = {data};
Plotly.newPlot("scene", scene.data, scene.layout, {{responsive: true, displaylogo: false}});
</script>
</body></html>
"""


def space_page(
    graph: PoseGraph,
    world: World3D,
    paths: Sequence[FloatArray],
    action: Action,
    best: int,
    names: Sequence[str],
    title: str,
    subtitle: str,
    *,
    goals: FloatArray,
    start: int | ArrayLike | Start | None = None,
) -> str:
    """The page; parameters as for `draw_space`, and what each path is called when a pointer is on it.

    Raises
    ------
    InvalidInputError
        Where plotly is not installed.
    """
    begin = find_start(graph, start)
    sight = Sight.of(graph, begin, action)
    positions = graph.positions
    closing: BoolArray = np.abs(graph.edges[:, 0] - graph.edges[:, 1]) > 1
    data: list[dict[str, Any]] = []
    if isinstance(world.space, Voxels):
        walls = world.space.walls
        low, high = world.corners
        walls = walls[((walls > low) & (walls < high)).all(axis=1)]
        walls = walls[:: max(1, -(-len(walls) // _MOST_CUBES))]
        marker = {
            "size": 2,
            "color": walls[:, 2].round(_DIGITS).tolist(),
            "colorscale": "Greys",
            "opacity": 0.15,
            "symbol": "square",
        }
        data.append(_trace("occupied", walls, mode="markers", marker=marker, hoverinfo="skip"))
    data.append(_lines("loop closures of the graph", positions[graph.edges[closing]], style.CLOSURE, 1, visible="legendonly"))
    steps = _joined(positions[graph.edges[~closing]])
    heights = np.where(np.isnan(steps[:, 2]), positions[:, 2].mean(), steps[:, 2]).round(_DIGITS).tolist()
    line = {"width": 4, "color": heights, "colorscale": "Cividis"}
    data.append(_trace("odometry of the graph, by height", steps, mode="lines", line=line, hoverinfo="skip"))
    seen = {"size": 4, "color": style.PREDICTED_CLOSURE, "opacity": 0.6}
    data.append(_trace(f"poses it sees again ({len(sight.seen)})", positions[sight.seen], mode="markers", marker=seen))
    order = [index for index in range(len(paths)) if index != best] + [best]
    for index in order:
        chosen = index == best
        look = {"width": 9 if chosen else 4, "color": style.BEST if chosen else style.SURVIVOR}
        data.append(
            _trace(names[index], paths[index], mode="lines", line=look, hoverinfo="name", opacity=1.0 if chosen else 0.6)
        )
    data.append(_trace("start", begin.place[None], mode="markers", marker={"size": 6, "color": style.INK}))
    if len(goals):
        look = {"size": 7, "color": style.GOAL, "symbol": "diamond", "line": {"width": 1, "color": style.INK}}
        data.append(_trace("goal" if len(goals) == 1 else "goals", goals, mode="markers", marker=look))
    axes = {f"{axis}axis": {"title": {"text": f"{axis} (m)"}} for axis in "xyz"}
    layout = {
        "scene": {**axes, "aspectmode": "data", "camera": {"eye": _EYE}},
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "legend": {"x": 0.01, "y": 0.99, "bgcolor": "rgba(255,255,255,0.7)"},
        "hoverlabel": {"namelength": -1},
    }
    plotly = load("plotly.offline", "page").get_plotlyjs()
    document = json_in_script({"data": data, "layout": layout})
    return _PAGE.format(title=escape(title), subtitle=escape(subtitle), plotly=plotly, data=document)


def _trace(name: str, points: FloatArray, **look: Any) -> dict[str, Any]:
    columns = {axis: points[:, k].round(_DIGITS).tolist() for k, axis in enumerate("xyz")}
    return {"type": "scatter3d", "name": name, **columns, **look}


def _lines(name: str, ends: FloatArray, colour: str, width: float, **look: Any) -> dict[str, Any]:
    """Many straight lines, shape (N, 2, 3)."""
    return _trace(name, _joined(ends), mode="lines", line={"width": width, "color": colour}, hoverinfo="skip", **look)


def _joined(ends: FloatArray) -> FloatArray:
    """Lines one after the other, with nan between them, which lifts the pen; shape (3 N, 3)."""
    gaps = np.full((len(ends), 1, 3), np.nan)
    return np.concatenate([ends, gaps], axis=1).reshape(-1, 3)
