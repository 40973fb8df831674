"""Pose graphs written in whatever format the suffix of their file names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from topobelief.errors import FileError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.files import StrPath, write_text
from topobelief.io.g2o import G2O
from topobelief.io.graph_text import graph_text
from topobelief.io.toro import TORO
from topobelief.io.tum import tum_of_path


def _g2o(graph: PoseGraph) -> str:
    return graph_text(graph, G2O)


def _toro(graph: PoseGraph) -> str:
    return graph_text(graph, TORO)


def _tum(graph: PoseGraph) -> str:
    return tum_of_path(graph.poses[graph.pose_indices])


_WRITERS: dict[str, Callable[[PoseGraph], str]] = {".g2o": _g2o, ".graph": _toro, ".toro": _toro, ".tum": _tum}


def write_pose_graph(graph: PoseGraph, path: StrPath) -> None:
    """Write a pose graph; whole or not at all.

    Parameters
    ----------
    graph
    path
        .g2o, .graph or .toro (TORO, SE(2) alone), or .tum (poses alone: edges and ids are lost, and the times count poses).

    Raises
    ------
    FileError
        For another suffix, or where the file cannot be written.
    InvalidInputError
        If the format has no room for the graph: TORO in space, negative ids.
    """
    require_graph_suffix(path)
    write_text(path, _WRITERS[Path(path).suffix.lower()](graph))


def require_graph_suffix(path: StrPath) -> None:
    """Raise `FileError` where no format that is written has this suffix."""
    suffix = Path(path).suffix.lower()
    if suffix not in _WRITERS:
        found = suffix or "no suffix"
        raise FileError(path, f"expected a graph that ends in .g2o, .graph or .toro (TORO), or .tum (poses alone), got {found}")


def keeps_edges(path: StrPath) -> bool:
    """Whether the format that the suffix names has edges."""
    return Path(path).suffix.lower() != ".tum"
