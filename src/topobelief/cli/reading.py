"""Options of every command that reads a pose graph: what to leave out of the file, and what to assume about it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal, cast

import typer

if TYPE_CHECKING:
    from topobelief.io.reading import ReadingOptions

# The readers' own choices, repeated so that help need not load them; a test holds them together.
Edge2Order = Literal["toro", "isam", "isam_root", "covariance"]

_READING = "Reading the graph"

Drop = Annotated[
    list[str] | None,
    typer.Option(
        metavar="WHAT",
        help="Leave out priors, gps, gravity, planes, landmarks, robust (edges), equiv, or indefinite (edges of such "
        "information); may be repeated.",
        rich_help_panel=_READING,
    ),
]
RobustAsPlain = Annotated[
    bool,
    typer.Option(
        "--robust-as-plain",
        metavar="",
        help="Treat switchable and max-mixture edges as plain ones.",
        rich_help_panel=_READING,
    ),
]
Edge2OrderOption = Annotated[
    Edge2Order,
    typer.Option(
        metavar="NAME",
        help="What entries of EDGE2 lines are: information as toro or isam orders it, its root (isam_root), or a covariance.",
        rich_help_panel=_READING,
    ),
]
Component = Annotated[
    str,
    typer.Option(
        metavar="WHICH",
        help="Part of a disconnected graph: all, largest, or the one with this pose id.",
        rich_help_panel=_READING,
    ),
]
Planar = Annotated[
    bool,
    typer.Option("--planar", metavar="", help="Project a graph in 3D onto the plane.", rich_help_panel=_READING),
]
Topic = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME",
        help="Of a bag, the topic to read; may be repeated for markers that draw one graph together.",
        show_default="the only one",
        rich_help_panel=_READING,
    ),
]


def reading_options(
    drop: list[str] | None,
    *,
    robust_as_plain: bool,
    edge2_order: Edge2Order,
    component: str,
    planar: bool,
    topic: list[str] | None,
) -> ReadingOptions:
    """What these options ask the readers for."""
    from topobelief.io.reading import Droppable, ReadingOptions

    return ReadingOptions(
        drop=cast("list[Droppable]", drop or []),  # which checks them
        robust_as_plain=robust_as_plain,
        edge2_order=edge2_order,
        component=component,
        planar=planar,
        topic=topic or (),
    )
