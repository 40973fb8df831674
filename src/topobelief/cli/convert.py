"""`topobelief convert`: a pose graph from any format that is read to any that is written, or the map in a bag to a ROS map."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from topobelief.cli import plan_arguments as values
from topobelief.cli.reading import Component, Drop, Edge2OrderOption, Planar, RobustAsPlain, Topic, reading_options
from topobelief.wording import counted

if TYPE_CHECKING:
    from topobelief.cli.console import Reporter

_UNSTATED = "Files that state no noise: trajectories, and graphs drawn as markers"


def convert(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="IN",
            help="g2o, TORO, iSAM, RTAB-Map .db, trajectory (TUM or KITTI), a MarkerArray as `ros2 topic echo` prints it, or a "
            "bag of ROS 1 or 2; told by content.",
            show_default=False,
        ),
    ],
    target: Annotated[
        Path,
        typer.Argument(
            metavar="OUT",
            help=".g2o, .graph or .toro (TORO, 2D), or .tum (poses alone); .yaml: the map in a bag, as a ROS map.",
            show_default=False,
        ),
    ],
    noise: Annotated[
        tuple[float, float] | None,
        typer.Option(
            metavar="M DEG",
            help="Standard deviations of each edge, metres and degrees.",
            show_default=False,
            rich_help_panel=_UNSTATED,
        ),
    ] = None,
    spacing: Annotated[
        float,
        typer.Option(metavar="M", help="Keep a pose of a trajectory every so many metres; 0: all.", rich_help_panel=_UNSTATED),
    ] = 0.0,
    closure_radius: Annotated[
        float | None,
        typer.Option(
            metavar="M",
            help="Close loops of a trajectory between poses as near as this.",
            show_default="none",
            rich_help_panel=_UNSTATED,
            callback=values.above_zero,
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
    drop: Drop = None,
    robust_as_plain: RobustAsPlain = False,
    edge2_order: Edge2OrderOption = "toro",
    component: Component = "all",
    planar: Planar = False,
    topic: Topic = None,
) -> None:
    """Convert a pose graph, or the map in a bag, to another format, from whatever it is read from."""
    from topobelief.cli.console import Reporter

    reporter = Reporter(as_json=as_json)
    with reporter.stage("start-up"):
        from topobelief.cli.prior import read_filed
        from topobelief.io.graph_formats import keeps_edges, require_graph_suffix, write_pose_graph
    if target.suffix.lower() in (".yaml", ".yml"):
        _convert_map(source, target, topic, reporter)
        return
    require_graph_suffix(target)
    stated = reading_options(
        drop, robust_as_plain=robust_as_plain, edge2_order=edge2_order, component=component, planar=planar, topic=topic
    )
    deviations = None if noise is None else (noise[0], math.radians(noise[1]))
    reading = replace(stated, noise=deviations, spacing=spacing, closure_radius=closure_radius)
    graph = read_filed(source, reporter, reading=reading)
    if not keeps_edges(target):
        reporter.note(f"{target}: holds the poses alone; edges, their information and ids are not written")
    elif (graph.reading_codes > 1).any():
        graph = graph.with_positions()
        reporter.note(f"{target}: bearings and ranges are written as the positions that they are to first order at these poses")
    write_pose_graph(graph, target)
    landmarks = f"{counted(graph.num_landmarks, 'landmark')}, " if graph.num_landmarks else ""
    edges = counted(graph.num_edges, "edge")
    reporter.say(f"{target}: {graph.group.name}, {counted(graph.num_poses, 'pose')}, {landmarks}{edges}.")
    size = {
        "space": graph.group.name,
        "num_poses": graph.num_poses,
        "num_landmarks": graph.num_landmarks,
        "num_edges": graph.num_edges,
    }
    reporter.answer({"file": str(target), **size, "notes": reporter.notes})


def _convert_map(source: Path, target: Path, topics: list[str] | None, reporter: Reporter) -> None:
    """Write the occupancy grid of a bag as a ROS map."""
    from topobelief.errors import FileError, InvalidInputError
    from topobelief.io.bag_maps import read_bag_grid
    from topobelief.io.bags import is_bag
    from topobelief.io.ros_map import write_ros_map

    if not is_bag(source):
        raise FileError(source, "expected a bag to take a map from, got another file; a graph is written as .g2o")
    if topics is not None and len(topics) > 1:
        raise InvalidInputError(f"expected one topic of a map, got {len(topics)}")
    with reporter.stage("reading"):
        grid = read_bag_grid(source, topic=topics[0] if topics else None)
    write_ros_map(target, grid.cells, resolution=grid.resolution, origin=grid.origin)
    rows, columns = grid.cells.shape
    reporter.say(f"{target}: a map of {columns} x {rows} cells of {grid.resolution:g} m.")
    size = {"columns": columns, "rows": rows, "resolution": grid.resolution, "origin": list(grid.origin)}
    reporter.answer({"file": str(target), **size, "notes": reporter.notes})
