"""One look for all figures: colours that a colour-blind reader can tell apart, and quiet axes.

The colours are those of Okabe and Ito, "Color Universal Design" (2008). Nothing changes matplotlib's global settings:
figures are drawn within `style()`, after which the caller's own settings are back.
"""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from typing import Any, cast

import matplotlib as mpl

from topobelief.planning.decision import Decision

BEST = "#D55E00"  # vermilion
SURVIVOR = "#0072B2"  # blue
RULED_OUT = "#8C8C8C"
ODOMETRY = "#5B6C7D"
CLOSURE = "#8CC5E3"
PREDICTED_CLOSURE = "#009E73"  # bluish green
LANDMARK = "#CC79A7"  # reddish purple
OBSERVATION = "#EBC9DC"  # the same, light
SEEN_AGAIN = "#B5E3D4"  # the same, light: a band beneath other lines
GOAL = "#F0E442"  # yellow, always with a dark edge
INK = "#222222"
MUTED = "#5A5A5A"
GRID = "#DADADA"
STRIPE = "#F6F6F7"
FREE = "#FFFFFF"
NOT_FREE = "#EBECEE"
WALL = "#A5A8AD"

_SETTINGS = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],  # comes with matplotlib, so a figure is the same on every machine
    "font.size": 8.5,
    "axes.labelsize": 8.5,
    "axes.labelcolor": INK,
    "axes.edgecolor": "#7A7A7A",
    "axes.linewidth": 0.7,
    "axes.formatter.useoffset": False,
    "text.color": INK,
    "text.parse_math": False,  # labels come from callers
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.solid_capstyle": "round",
    "lines.solid_joinstyle": "round",
    "figure.dpi": 200,  # of pictures saved at "figure" resolution, matplotlib's default
}


@contextmanager
def style() -> Generator[None]:
    """Settings within which a figure is drawn."""
    with cast("Any", mpl).rc_context(_SETTINGS):
        yield


def standing_colours(decision: Decision) -> list[str]:
    """Colour of each action by what the decision says of it: the best, still possible, ruled out."""
    surviving = set(decision.survivors.tolist())
    return [
        BEST if action == decision.best else SURVIVOR if action in surviving else RULED_OUT
        for action in range(decision.num_actions)
    ]


def short_name(decision: Decision, action: int, *, limit: int = 20) -> str:
    """What to call an action where there is little room."""
    name = decision.name(action)
    return name if len(name) <= limit else name[: limit - 1] + "…"
