"""The options that say which graph, in which world, from where to where: of `topobelief plan`, `info`, `serve` and `ros`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from topobelief.cli import plan_arguments as values
from topobelief.cli.plan_arguments import GivenPlace

# As `read_ros_map` has it, repeated so that help need not load it; a test holds them together.
Unknown = Literal["occupied", "free"]

_WORLD = "Where the robot may drive"

GraphFile = Annotated[
    Path, typer.Argument(metavar="GRAPH", help="Pose graph: g2o, TORO, RTAB-Map .db or markers, told by content.")
]
Goals = Annotated[
    list[GivenPlace] | None,
    typer.Option(
        "--goal",
        metavar="ID | X Y [Z]",
        parser=values.place,
        help="Where to go: id of a pose, or X Y (in 3D X Y Z) in metres. Repeat it to compare several goals.",
        show_default=False,
    ),
]
Start = Annotated[
    GivenPlace | None,
    typer.Option(
        metavar="ID | X Y [Z]",
        parser=values.place,
        help="Where the robot starts: id of a pose, or X Y (in 3D X Y Z) in metres.",
        show_default="the last pose",
    ),
]
Optimize = Annotated[
    bool, typer.Option("--optimize/--no-optimize", metavar="", help="Compute the maximum-likelihood poses first.")
]

MapFile = Annotated[
    Path | None,
    typer.Option(
        "--map",
        metavar="FILE",
        help="ROS map (.yaml), walls (.csv), or a bag; in 3D a grid (.npy) or point cloud (.ply, .pcd).",
        rich_help_panel=_WORLD,
    ),
]
MapTopic = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="Of a bag, the topic that holds the map.",
        show_default="the only one",
        rich_help_panel=_WORLD,
    ),
]
AlongTrajectory = Annotated[
    bool,
    typer.Option(
        "--along-trajectory",
        metavar="",
        help="Use no map: where the robot has been counts as free. In 3D that is so without a map.",
        rich_help_panel=_WORLD,
    ),
]
Width = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        help="Free width on each side of the trajectory, metres.",
        show_default="twice its typical step",
        callback=values.above_zero,
        rich_help_panel=_WORLD,
    ),
]
UnknownCells = Annotated[
    Unknown,
    typer.Option(metavar="WHAT", help="Treat unknown cells of a ROS map as occupied or free.", rich_help_panel=_WORLD),
]
Flying = Annotated[
    bool | None,
    typer.Option(
        "--flying/--driving",
        metavar="",
        help="In 3D without a map: whether the robot flies near its trajectory, or drives on the surface that this spans.",
        show_default="driving if all poses are upright",
        rich_help_panel=_WORLD,
    ),
]
Height = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        help="… free height above and below the trajectory, metres.",
        show_default="1 if it drives, else the width",
        callback=values.above_zero,
        rich_help_panel=_WORLD,
    ),
]
Resolution = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        help="Side of a cell of a 3D map, metres.",
        show_default="0.2 for point clouds",
        callback=values.above_zero,
        rich_help_panel=_WORLD,
    ),
]
Origin = Annotated[
    object | None,
    typer.Option(
        metavar="X Y Z",
        parser=values.corner,
        help="Lowest corner of a grid in .npy, metres.",
        show_default="0 0 0",
        rich_help_panel=_WORLD,
    ),
]
RobotRadius = Annotated[float, typer.Option(metavar="M", help="Metres.", callback=values.above_zero, rich_help_panel=_WORLD)]
