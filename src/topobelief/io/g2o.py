"""The g2o text format: VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT, FIX; after the file format pages of g2o.

    VERTEX_SE2 id x y theta
    EDGE_SE2 i j x y theta I11 I12 I13 I22 I23 I33
    VERTEX_SE3:QUAT id x y z qx qy qz qw
    EDGE_SE3:QUAT i j x y z qx qy qz qw I11 I12 … I66
    FIX id …

Information is the upper triangle, row by row, in the tangent at the measured pose, ordered (translation, rotation). The
rotation part is taken per radian squared, as GTSAM takes it. (g2o itself differentiates EDGE_SE3:QUAT by the vector part
of the quaternion, half the angle, so a file that states information per radian squared weighs rotations four times less there.)
"""

from __future__ import annotations

import re
from typing import Unpack

from topobelief.geometry import SE2_GROUP, SE3_GROUP
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.dialect import Dialect, Tag, upper_triangle
from topobelief.io.files import StrPath, write_text
from topobelief.io.graph_lines import read_lines
from topobelief.io.graph_text import graph_text
from topobelief.io.reading import ReadingKeywords, ReadingOptions

_OFFSET = "it measures between sensors that sit off the poses; convert it to an edge between the poses"
G2O = Dialect(
    name="g2o",
    tags={
        "VERTEX_SE2": Tag("vertex", SE2_GROUP),
        "EDGE_SE2": Tag("edge", SE2_GROUP),
        "VERTEX_SE3:QUAT": Tag("vertex", SE3_GROUP),
        "EDGE_SE3:QUAT": Tag("edge", SE3_GROUP),
    },
    marks=re.compile(r"(VERTEX|EDGE|PARAMS)_.*"),
    orders={"g2o": {group.tangent_dim: upper_triangle(group.tangent_dim) for group in (SE2_GROUP, SE3_GROUP)}},
    refused={
        "EDGE_SE2_OFFSET": _OFFSET,
        "EDGE_SE3_OFFSET": _OFFSET,
        **dict.fromkeys(
            ("VERTEX2", "EDGE2", "VERTEX3", "EDGE3"),
            "it belongs to the format TORO, and a file is in one format; read a TORO file with read_toro or read_pose_graph",
        ),
    },
)


def read_g2o(path: StrPath, **options: Unpack[ReadingKeywords]) -> PoseGraph:
    """Read a pose graph from a g2o file.

    Ids may be in any order and leave gaps: poses are sorted by id and `PoseGraph.ids` keeps the ids; edges keep the order
    of the file. `#` starts a comment. A pose without a VERTEX line is composed from edges along a spanning tree that prefers
    odometry, outwards from the poses that have one; where no pose has one, from the lowest id at the origin. FIX lines are
    kept as `PoseGraph.fixed`. PARAMS lines, the offsets of sensors, are skipped.

    Parameters
    ----------
    path
        The file. Metres and radians. Bytes that are no text matter only outside of comments.
    **options
        What to drop or assume instead of refusing the file: see `topobelief.ReadingOptions`. What an option changed is
        issued as a `ReadingWarning`.

    Returns
    -------
    PoseGraph
        In SE(2) or SE(3). It may be disconnected if all poses have VERTEX lines.

    Raises
    ------
    FileError
        If the file cannot be read, a line is wrong, or it holds more than poses and plain edges and no option says what to do
        about that: names the line, what was expected and what is there. Where the file has VERTEX lines, an id without one
        that a single edge names is refused (an edge to nowhere) unless that edge links consecutive ids.
    DisconnectedGraphError
        If poses without a VERTEX line are connected to none that has one; names some of them.
    """
    return read_lines(path, (G2O,), ReadingOptions(**options)).warned()


def write_g2o(graph: PoseGraph, path: StrPath) -> None:
    """Write a pose graph as a g2o file; whole or not at all.

    Every double is written so that reading returns it to the last bit. Ids, the order of edges and FIX lines are kept.

    Raises
    ------
    FileError
        If the file cannot be written.
    InvalidInputError
        If an id is negative, which `read_g2o` would refuse.
    """
    write_text(path, graph_text(graph, G2O))
