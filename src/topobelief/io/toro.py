"""The TORO text format in 2D: VERTEX2, EDGE2 (openslam-org.github.io/toro).

    VERTEX2 id x y theta
    EDGE2 i j x y theta I11 I12 I22 I33 I13 I23

Note the order of the information. TORO files in 3D (VERTEX3, EDGE3) are refused: programs disagree whether their information
is per Euler angle or per rotation vector, and a guess would silently change every weight.
"""

from __future__ import annotations

import numpy as np

from topobelief.geometry import SE2_GROUP
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.files import StrPath
from topobelief.io.graph_lines import Dialect, Tag, read_lines

_SPACE = (
    "3D TORO files are not supported, because programs disagree about the meaning of their information; convert the file to g2o"
)
_LANDMARKS = "landmarks are not supported yet; remove the lines of landmarks and of their edges"
_TORO = Dialect(
    tags={"VERTEX2": Tag("vertex", SE2_GROUP), "EDGE2": Tag("edge", SE2_GROUP)},
    information_entries={SE2_GROUP.tangent_dim: (np.array([0, 0, 1, 2, 0, 1]), np.array([0, 1, 1, 2, 2, 2]))},
    refused={
        "VERTEX3": _SPACE,
        "EDGE3": _SPACE,
        "EQUIV": "merging two poses into one is not supported; write an EDGE2 with high information instead",
        "LANDMARK": _LANDMARKS,
        "BR": _LANDMARKS,
    },
)


def read_toro(path: StrPath) -> PoseGraph:
    """Read a planar pose graph from a TORO file.

    Ids, comments, FIX lines and poses without a VERTEX2 line are treated as `topobelief.read_g2o` does.

    Parameters
    ----------
    path
        The file. Metres and radians.

    Raises
    ------
    FileError
        If the file cannot be read or a line is wrong: names the line, what was expected and what is there.
    DisconnectedGraphError
        If poses without a VERTEX2 line are connected to none that has one; names some of them.
    """
    return read_lines(path, _TORO)
