"""Pose graphs in whatever format the name of the file says."""

from __future__ import annotations

from pathlib import Path

from topobelief.errors import FileError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.files import StrPath
from topobelief.io.g2o import read_g2o
from topobelief.io.toro import read_toro

_READERS = {".g2o": read_g2o, ".toro": read_toro, ".graph": read_toro}


def read_pose_graph(path: StrPath) -> PoseGraph:
    """Read a pose graph: .g2o as g2o, .toro and .graph as TORO; upper or lower case.

    Raises
    ------
    FileError
        If the suffix is another one, or the file is wrong.
    DisconnectedGraphError
        If poses that the file does not give cannot be composed from its edges.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in _READERS:
        raise FileError(
            path, f"expected a name that ends in {', '.join(_READERS)}, got {suffix or 'no suffix'!r}; rename the file"
        )
    return _READERS[suffix](path)
