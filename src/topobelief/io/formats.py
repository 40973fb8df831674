"""Pose graphs in whatever format the content of the file shows."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Unpack

from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.bag_graphs import read_bag
from topobelief.io.bags import is_bag
from topobelief.io.boost_archive import is_boost_archive, refuse_boost_archive
from topobelief.io.files import StrPath, read_head
from topobelief.io.g2o import G2O
from topobelief.io.graph_lines import read_lines
from topobelief.io.markers import is_markers, read_markers
from topobelief.io.reading import ReadGraph, ReadingKeywords, ReadingOptions
from topobelief.io.rtabmap import is_database, read_rtabmap
from topobelief.io.toro import TORO
from topobelief.io.trajectory import is_trajectory, read_trajectory

_BY_HEAD: tuple[tuple[Callable[[bytes], bool], Callable[[StrPath, ReadingOptions], ReadGraph]], ...] = (
    (is_database, read_rtabmap),
    (is_boost_archive, refuse_boost_archive),
    (is_markers, read_markers),
    (is_trajectory, read_trajectory),
)


def read_pose_graph(path: StrPath, **options: Unpack[ReadingKeywords]) -> PoseGraph:
    """Read a pose graph in whatever format its content shows; the name of the file does not matter.

    Formats: g2o; TORO, also as iSAM writes it; databases of RTAB-Map; trajectories in TUM or KITTI format, for which `noise`
    has to be stated; the graph that slam_toolbox or Cartographer draws, a visualization_msgs/MarkerArray as
    `ros2 topic echo` prints it; and bags of ROS 1 and 2 (`topic` says what of them; needs the extra `ros`).

    Parameters
    ----------
    path
        The file, or the folder of a bag. Metres and radians.
    **options
        What to drop or assume instead of refusing the file: see `topobelief.ReadingOptions`. What an option changed is
        issued as a `ReadingWarning`.

    Raises
    ------
    FileError
        If the file is wrong, or holds more than poses and plain edges and no option says what to do about that.
    DisconnectedGraphError
        If poses that the file does not give cannot be composed from its edges.
    """
    return read_graph_file(path, ReadingOptions(**options)).warned()


def read_graph_file(path: StrPath, options: ReadingOptions) -> ReadGraph:
    """As `read_pose_graph`, with what was dropped or assumed as notes in place of warnings."""
    if is_bag(path):
        return read_bag(path, options)
    head = (
        read_head(path) if Path(path).is_file() else b""
    )  # what comes through a pipe can be read once, and is taken for lines
    reader = next((reader for recognises, reader in _BY_HEAD if recognises(head)), None)
    return read_lines(path, (G2O, TORO), options) if reader is None else reader(path, options)
