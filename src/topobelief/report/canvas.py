"""Matplotlib behind typed classes: a figure measured in inches, panels on it, and a key.

Figures belong to no graphical backend and touch no global state: they are saved, not shown.
"""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import Any, Literal, cast

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch, Rectangle
from matplotlib.path import Path as Outline
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike
from shapely import MultiPolygon, Polygon

from topobelief.arrays import FloatArray
from topobelief.report import style

Align = Literal["left", "center", "right"]


class Entry:
    """One line of a key: how something looks, and what it is.

    Parameters
    ----------
    label
    patch
        Shown as an area instead of a line.
    look
        As matplotlib's lines or patches take it.
    """

    def __init__(self, label: str, *, patch: bool = False, **look: Any) -> None:
        make = cast("Any", Patch if patch else Line2D)
        self.handle: Any = make(label=label, **look) if patch else make([], [], label=label, **look)


class Panel:
    """A rectangle with axes on a canvas; all coordinates are those of its axes."""

    def __init__(self, axes: Any) -> None:
        self.axes = axes

    def line(self, points: ArrayLike, *, casing: float = 0.0, **look: Any) -> None:
        """A polyline or marks, shape (N, 2), with a white casing of a width in points where one is given."""
        x, y = np.reshape(np.asarray(points, dtype=np.float64), (-1, 2)).T
        effects = {"path_effects": [Stroke(linewidth=casing, foreground="white"), Normal()]} if casing else {}
        self.axes.plot(x, y, **effects, **look)

    def segments(self, ends: FloatArray, **look: Any) -> None:
        """Many straight lines, shape (N, 2, 2); an image in vector formats, for there may be thousands."""
        self.axes.add_collection(cast("Any", LineCollection)(list(ends), rasterized=True, **look), autolim=False)

    def region(self, shape: MultiPolygon, **look: Any) -> None:
        """Polygons with holes, filled and outlined."""
        outline = cast("Any", Outline).make_compound_path(*(_outline(polygon) for polygon in shape.geoms))
        self.axes.add_artist(cast("Any", PathPatch)(outline, **look))  # add_patch takes seconds to find the extent of curves
        self.axes.update_datalim(np.reshape(shape.bounds, (2, 2)))

    def rectangle(self, x_min: float, y_min: float, width: float, height: float, **look: Any) -> None:
        """An axis-aligned rectangle."""
        self.axes.add_patch(cast("Any", Rectangle)((x_min, y_min), width, height, **look))

    def limits(self, x: tuple[float, float], y: tuple[float, float]) -> None:
        """What the axes show."""
        self.axes.set_xlim(*x)
        self.axes.set_ylim(*y)

    def map_axes(self) -> None:
        """Metres, as long upward as across."""
        self.axes.set_aspect("equal")
        self.axes.set(xlabel="x (m)", ylabel="y (m)")

    def value_axis(self, label: str) -> None:
        """A scale along the lower edge, with a light grid, and nothing else around."""
        self.axes.set_yticks([])
        self.axes.xaxis.set_major_locator(MaxNLocator(nbins=6))
        self.axes.grid(axis="x", color=style.GRID, linewidth=0.5, zorder=1)
        self.axes.set_axisbelow(True)
        for side in ("left", "right", "top"):
            self.axes.spines[side].set_visible(False)
        self.axes.set_xlabel(label)

    def names(self, names: Sequence[str]) -> None:
        """What the rows 0, 1, … are called, along the left edge."""
        self.axes.set_yticks(range(len(names)), names)
        self.axes.tick_params(axis="y", length=0)

    def key(self, entries: Sequence[Entry]) -> None:
        """What the colours and marks mean, on the right of the axes."""
        handles = [entry.handle for entry in entries]
        self.axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0, frameon=False)

    def no_ticks(self) -> None:
        """A frame without numbers."""
        self.axes.set(xlabel="", ylabel="", xticks=[], yticks=[])


class Canvas:
    """A figure of a size in inches; places count from its lower left corner."""

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height
        self.figure = Figure(figsize=(width, height), facecolor="white")

    def panel(self, left: float, bottom: float, width: float, height: float) -> Panel:
        """Axes over a rectangle."""
        place = (left / self.width, bottom / self.height, width / self.width, height / self.height)
        return Panel(cast("Any", self.figure).add_axes(place))

    def text(self, x: float, y: float, text: str, *, align: Align = "left", **look: Any) -> None:
        """Text whose baseline begins (or is centred, or ends) at a place."""
        cast("Any", self.figure).text(x / self.width, y / self.height, text, ha=align, va="baseline", **look)

    def title(self, x: float, y: float, title: str, subtitle: str) -> None:
        """Two lines, the lower one at y."""
        self.text(x, y + 0.20, title, fontsize=10)
        self.text(x, y, subtitle, fontsize=8, color=style.MUTED)

    def key(self, entries: Sequence[Entry], x: float, y: float, *, corner: str, columns: int = 1) -> None:
        """What the colours and marks mean, with one corner at a place."""
        cast("Any", self.figure).legend(
            handles=[entry.handle for entry in entries],
            loc=corner,
            bbox_to_anchor=(x / self.width, y / self.height),
            borderaxespad=0.0,
            borderpad=0.0,
            ncols=columns,
            columnspacing=1.4,
            handlelength=1.8,
            labelspacing=0.55,
        )


def new_panel(width: float, height: float) -> Panel:
    """Axes of pyplot on a new figure of a size in inches, which a notebook shows by itself."""
    from matplotlib import pyplot as plt  # chooses a backend, so only where a caller brings no axes

    return Panel(cast("Any", plt).subplots(figsize=(width, height), layout="constrained")[1])


def save_figure(figure: Figure, path: str | PathLike[str]) -> None:
    """Write a figure; the suffix of the path chooses the format."""
    cast("Any", figure).savefig(path)


def _outline(polygon: Polygon) -> Outline:
    """Shell anticlockwise, holes clockwise, so that holes stay empty."""
    rings = [(polygon.exterior, True), *((ring, False) for ring in polygon.interiors)]
    corners = [np.asarray(ring.coords)[:: 1 if ring.is_ccw == ccw else -1, :2] for ring, ccw in rings]
    return cast("Any", Outline).make_compound_path(*(Outline(ring, closed=True) for ring in corners))
