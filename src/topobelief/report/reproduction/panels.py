"""What the figures have in common: a grid of panels, colours of signatures and noises, real minus signs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from topobelief.report import style
from topobelief.report.canvas import Canvas, Panel

SIGNATURE_LOOKS: dict[str, tuple[str, str, str]] = {
    "spanning_trees": ("s_ST", style.SURVIVOR, "o"),
    "von_neumann": ("s_VN", style.PREDICTED_CLOSURE, "s"),
    "von_neumann_approx": ("ŝ_VN", style.BEST, "^"),
    "von_neumann_normalized": ("normalised ŝ_VN", "#CC79A7", "v"),
}
"""Label, colour and mark of each signature, in the order in which they stand."""

CHOOSER_NAMES = {
    "resistance": "s_R, resistance",
    "map": "map entropy, exact",
    "map_spanning_trees": "s_map",
    "joint": "joint entropy, exact",
    "spanning_trees": "s_ST",
    "von_neumann": "s_VN",
    "von_neumann_approx": "ŝ_VN, degrees",
    "shortest": "the shortest",
    "random": "at random",
}
"""Ways to choose that lose expected error, in the order in which they stand."""

CLOSURE_NAMES = {"learned": "learned closures", "single": "one closure a pose", "paper": "the paper's closures"}
"""What is predicted along a path."""

NOISE_COLOURS = ("#7DB8DE", "#2F7FBF", "#0B2F5B")
"""From the least noise to the largest."""

MARGIN = 0.25


class Grid:
    """A canvas with rows and columns of equal panels, room for a title above and a key below.

    Parameters
    ----------
    rows, columns
    width, height
        Of a panel, inches, as all lengths here.
    across, down
        Between panels.
    left, bottom, top
        Around all of them.
    """

    def __init__(
        self,
        rows: int,
        columns: int,
        *,
        width: float,
        height: float,
        across: float = 0.55,
        down: float = 0.62,
        left: float = 0.75,
        bottom: float = 0.95,
        top: float = 0.95,
    ) -> None:
        self.canvas = Canvas(
            left + columns * width + (columns - 1) * across + 0.2, bottom + rows * height + (rows - 1) * down + top
        )
        self._places = [
            [(left + c * (width + across), bottom + (rows - 1 - r) * (height + down)) for c in range(columns)]
            for r in range(rows)
        ]
        self._size = width, height

    def panel(self, row: int, column: int, title: str = "") -> Panel:
        """The panel at a place, with its title above."""
        x, y = self._places[row][column]
        width, height = self._size
        if title:
            self.canvas.text(x, y + height + 0.07, title, fontsize=8.5)
        panel = self.canvas.panel(x, y, width, height)
        for side in ("right", "top"):
            panel.axes.spines[side].set_visible(False)
        return panel

    def headline(self, title: str, subtitle: str) -> None:
        """Above all panels."""
        self.canvas.title(MARGIN, self.canvas.height - 0.45, title, subtitle)


def light_grid(axes: Any, which: str = "both") -> None:
    """Lines behind the data."""
    axes.grid(axis=which, color=style.GRID, linewidth=0.5, zorder=0)
    axes.set_axisbelow(True)


def plain_log_ticks(axis: Any, ticks: Sequence[float]) -> None:
    """Numbers as people write them on a logarithmic axis."""
    axis.set_ticks(list(ticks), [f"{tick:g}" for tick in ticks])
    axis.set_ticks([], minor=True)


def signed(value: float, digits: int = 2) -> str:
    """With a real minus sign."""
    return f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}")
