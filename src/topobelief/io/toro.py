"""The TORO text format in 2D: VERTEX2, EDGE2 (openslam-org.github.io/toro), and the same lines as iSAM writes them.

    VERTEX2 id x y theta
    EDGE2 i j x y theta I11 I12 I22 I33 I13 I23

Note the order of the information. Files in the style of iSAM have EDGE2, ODOMETRY or Constraint2 with I11 I12 I13 I22 I23 I33,
and iSAM itself takes these six for a square root of the information; GTSAM may take them for a covariance. All are options, and
the last is the default for a file with LANDMARK or BR lines that allows no other. TORO files in 3D
(VERTEX3, EDGE3) are refused: programs disagree whether their information is per Euler angle or per rotation vector, and a guess
would silently change every weight.
"""

from __future__ import annotations

import re
from typing import Unpack

import numpy as np

from topobelief.geometry import SE2_GROUP
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.dialect import Dialect, Tag, upper_triangle
from topobelief.io.files import StrPath, write_text
from topobelief.io.graph_lines import read_lines
from topobelief.io.graph_text import graph_text
from topobelief.io.reading import ReadingKeywords, ReadingOptions

_SPACE = (
    "3D TORO files are not supported, because programs disagree about the meaning of their information; convert the file to g2o"
)
TORO = Dialect(
    name="TORO",
    tags={"VERTEX2": Tag("vertex", SE2_GROUP), "EDGE2": Tag("edge", SE2_GROUP)},
    marks=re.compile(r"(VERTEX|EDGE)[23]|EQUIV|LANDMARK|BR|ODOMETRY|Constraint2"),
    orders={
        "toro": {SE2_GROUP.tangent_dim: (np.array([0, 0, 1, 2, 0, 1]), np.array([0, 1, 1, 2, 2, 2]))},
        "isam": {SE2_GROUP.tangent_dim: upper_triangle(SE2_GROUP.tangent_dim)},
        "isam_root": {SE2_GROUP.tangent_dim: upper_triangle(SE2_GROUP.tangent_dim)},
        "covariance": {SE2_GROUP.tangent_dim: upper_triangle(SE2_GROUP.tangent_dim)},
    },
    aliases={"ODOMETRY": "EDGE2", "Constraint2": "EDGE2"},
    roots=frozenset({"isam_root"}),
    inverses=frozenset({"covariance"}),
    refused={
        "VERTEX3": _SPACE,
        "EDGE3": _SPACE,
        **dict.fromkeys(
            ("VERTEX_SE2", "EDGE_SE2", "VERTEX_SE3:QUAT", "EDGE_SE3:QUAT"),
            "it belongs to the format g2o, and a file is in one format; read a g2o file with read_g2o or read_pose_graph",
        ),
    },
)


def read_toro(path: StrPath, **options: Unpack[ReadingKeywords]) -> PoseGraph:
    """Read a planar pose graph from a TORO file.

    Ids, comments, FIX lines and poses without a VERTEX2 line are treated as `topobelief.read_g2o` does.

    Parameters
    ----------
    path
        The file. Metres and radians.
    **options
        As for `topobelief.read_g2o`; `edge2_order="isam"` takes the information for the upper triangle row by row,
        `edge2_order="isam_root"` for that of its square root R, as iSAM does (information R^T R), and `drop="equiv"` ignores
        EQUIV lines.

    Raises
    ------
    FileError
        If the file cannot be read or a line is wrong: names the line, what was expected and what is there.
    DisconnectedGraphError
        If poses without a VERTEX2 line are connected to none that has one; names some of them.
    """
    return read_lines(path, (TORO,), ReadingOptions(**options)).warned()


def write_toro(graph: PoseGraph, path: StrPath) -> None:
    """Write a planar pose graph as a TORO file; whole or not at all. Doubles, ids, order of edges and FIX lines are kept.

    Raises
    ------
    FileError
        If the file cannot be written.
    InvalidInputError
        If the graph is in SE(3), or an id is negative, which `read_toro` would refuse.
    """
    write_text(path, graph_text(graph, TORO))
