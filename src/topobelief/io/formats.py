"""Pose graphs in whatever format the content of the file shows."""

from __future__ import annotations

from typing import Unpack

from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.files import StrPath
from topobelief.io.g2o import G2O
from topobelief.io.graph_lines import read_lines
from topobelief.io.reading import ReadGraph, ReadingKeywords, ReadingOptions
from topobelief.io.toro import TORO


def read_pose_graph(path: StrPath, **options: Unpack[ReadingKeywords]) -> PoseGraph:
    """Read a pose graph in g2o or TORO format; the first line of a graph shows which; the name of the file does not matter.

    Parameters
    ----------
    path
        The file. Metres and radians.
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
    return read_lines(path, (G2O, TORO), options)
