"""The world of a plan: a map, or what lies along the trajectory; whether it suits the graph, and which poses are in it."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import typer

from topobelief.candidates.attitude import is_upright
from topobelief.cli.console import Reporter
from topobelief.cli.plan_stages import read_graph
from topobelief.errors import FileError, PlanningError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.projection import is_planar, projected_to_plane
from topobelief.io import floor_plan
from topobelief.io.map_3d import is_map_3d, read_world_3d
from topobelief.io.reading import ReadingOptions
from topobelief.io.ros_map import Unknown
from topobelief.world import FreeSpace, World, World3D
from topobelief.world.space import require_room_for, seen_by
from topobelief.world.trajectory import default_width
from topobelief.world.world_3d import DRIVING_HEIGHT

_DOUBTFUL_SHARE = 0.1  # of the poses outside free space, above which map and graph may not belong together


@dataclass(frozen=True, slots=True)
class WorldChoice:
    """What the options say about the world.

    Attributes
    ----------
    map_file
        None: along the trajectory.
    along_trajectory
        Whether that is said; in 3D it goes without saying.
    width
        Metres to each side of the trajectory; None for the usual one.
    unknown
        What unknown cells are taken for.
    flying
        In 3D without a map: whether the robot flies; None for what the poses suggest.
    height
        Metres above and below the trajectory; None for the usual one.
    resolution
        Of a 3D map, metres; None for that of its kind.
    origin
        Lowest corner of a grid in .npy, metres.
    topic
        Of a bag, the topic that holds the map; None for the only one.
    """

    map_file: Path | None
    along_trajectory: bool
    width: float | None = None
    unknown: Unknown = "occupied"
    flying: bool | None = None
    height: float | None = None
    resolution: float | None = None
    origin: tuple[float, ...] | None = None
    topic: str | None = None

    @property
    def is_map_3d(self) -> bool:
        """Whether a 3D map is given."""
        return self.map_file is not None and is_map_3d(self.map_file)

    def check(self) -> None:
        """Refuse options that contradict each other, whatever the graph.

        Raises
        ------
        typer.BadParameter
        """
        if self.map_file is not None and self.along_trajectory:
            raise typer.BadParameter("expected one of --map FILE and --along-trajectory.", param_hint="the world")
        for option, given in (("--flying or --driving", self.flying is not None), ("--height", self.height is not None)):
            if given and self.map_file is not None:
                raise typer.BadParameter(
                    f"expected no --map with {option}, which is about the space along the trajectory; leave out one of them.",
                    param_hint="the world",
                )
        for option, given in (("--resolution", self.resolution is not None), ("--origin", self.origin is not None)):
            if given and not self.is_map_3d:
                raise typer.BadParameter(
                    f"expected a 3D map (.npy, .ply or .pcd) with {option}, got none.", param_hint="the world"
                )
        if self.flying is False and self.height is not None and self.width is not None and self.height >= self.width:
            raise typer.BadParameter(
                f"expected --height below --width for a robot that drives, got {self.height:g}.", param_hint="--height"
            )

    def accepted(self, file: Path, graph: PoseGraph, reporter: Reporter) -> PoseGraph:
        """The graph to work with: one that lies in a plane and was saved in 3D is projected, and that is said.

        Raises
        ------
        FileError
            Where map and graph are not of the same dimension.
        typer.BadParameter
            Where a graph in the plane comes without a world, or with options of 3D.
        """
        if is_planar(graph) and not self.is_map_3d:
            graph, dropped = projected_to_plane(graph)
            reporter.note(f"{file}: the graph lies in a plane and is {dropped}")
        if graph.group.position_dim == 3:
            if self.map_file is not None and not self.is_map_3d:
                raise FileError(
                    file,
                    f"expected a 3D map (.npy, .ply or .pcd) or none for a graph in {graph.group.name}, got {self.map_file}; "
                    "to plan in the plane, pass --planar",
                )
            return graph
        if self.is_map_3d:
            raise FileError(
                file, f"expected a floor plan (.yaml or .csv) for a graph in {graph.group.name}, got the 3D map {self.map_file}"
            )
        if self.map_file is None and not self.along_trajectory:
            raise typer.BadParameter("expected one of --map FILE and --along-trajectory.", param_hint="the world")
        for option, given in (("--flying or --driving", self.flying is not None), ("--height", self.height is not None)):
            if given:
                raise typer.BadParameter(
                    f"expected a graph in SE(3) with {option}, got one in {graph.group.name}.", param_hint="the world"
                )
        return graph


def read_world(choice: WorldChoice, graph: PoseGraph, reporter: Reporter) -> FreeSpace:
    """The map, or what lies along the trajectory where there is none; told."""
    with reporter.stage("world"):
        if choice.map_file is None:
            world, source = _along_trajectory(choice, graph)
        elif choice.is_map_3d:
            world = read_world_3d(choice.map_file, resolution=choice.resolution, origin=choice.origin, unknown=choice.unknown)
            source = str(choice.map_file)
        else:
            world, source = (
                floor_plan.read_world(choice.map_file, unknown=choice.unknown, topic=choice.topic),
                str(choice.map_file),
            )
    require_room_for(graph, world)
    low, high = world.corners
    reporter.say(f"world: {source}, {' × '.join(f'{side:.1f}' for side in (high - low).tolist())} m")
    if message := poses_outside(graph, world):
        reporter.note(message)
    return world


def read_planar(
    choice: WorldChoice, file: Path, reporter: Reporter, *, optimized: bool, reading: ReadingOptions
) -> tuple[PoseGraph, World]:
    """A graph and its world for what works in the plane alone.

    Raises
    ------
    FileError
        For a graph in space, besides all that `plan_stages.read_graph` refuses.
    """
    graph = read_graph(
        file, reporter, optimized=optimized, reading=reading, accepted=lambda filed: choice.accepted(file, filed, reporter)
    )
    world = read_world(choice, graph, reporter)
    if not isinstance(world, World):
        raise FileError(file, f"expected a graph in the plane, got one in {graph.group.name}; `topobelief plan` plans in space")
    return graph, world


def _along_trajectory(choice: WorldChoice, graph: PoseGraph) -> tuple[FreeSpace, str]:
    """The space along the trajectory, and what it is called."""
    width = default_width(graph) if choice.width is None else choice.width
    if graph.group.position_dim == 2:
        return World.from_trajectory(graph, width), f"within {width:.2f} m of the trajectory"
    flying = not is_upright(graph) if choice.flying is None else choice.flying
    if flying:
        height = min(width, choice.height or width)
        how = "for a robot that flies (--driving for one that drives)"
        where = f"within {width:.2f} m of the trajectory"
        where += f", {height:.2f} m above and below it" if height < width else ""
    else:
        height = choice.height or min(DRIVING_HEIGHT, width / 2)
        how = "for a robot that drives (--flying for one that flies)"
        where = f"within {width:.2f} m of the trajectory, {height:.2f} m above and below it"
    return World3D.from_trajectory(graph, width, height), f"{where}, {how}"


@contextmanager
def told_of_poses_outside(graph: PoseGraph, world: FreeSpace) -> Generator[None]:
    """Where there is no way, add that poses are not in free space, which may be the cause."""
    try:
        yield
    except PlanningError as error:
        if outside := poses_outside(graph, world):
            raise PlanningError(f"{error}; {outside}") from None
        raise


def poses_outside(graph: PoseGraph, world: FreeSpace) -> str | None:
    """How many poses are not in free space, and what that may mean; None where all are."""
    places = seen_by(world, graph.positions[graph.pose_indices])
    outside, total = int(np.count_nonzero(~world.contains(places))), graph.num_poses
    if not outside:
        return None
    question = ": another map or another frame?" if outside > _DOUBTFUL_SHARE * total else ""
    return f"{outside} of {total} poses {'is' if outside == 1 else 'are'} not in free space{question}"
