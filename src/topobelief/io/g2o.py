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

from topobelief.errors import InvalidInputError
from topobelief.geometry import SE2_GROUP, SE3_GROUP
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.files import StrPath, write_text
from topobelief.io.graph_lines import ID_LIMIT, Dialect, Tag, read_lines, upper_triangle

_LANDMARKS = "landmarks are not supported yet; remove the lines of landmarks and of their edges"
_SENSORS = "sensor parameters are not supported; remove the line if the edges are between poses"
_G2O = Dialect(
    tags={
        "VERTEX_SE2": Tag("vertex", SE2_GROUP),
        "EDGE_SE2": Tag("edge", SE2_GROUP),
        "VERTEX_SE3:QUAT": Tag("vertex", SE3_GROUP),
        "EDGE_SE3:QUAT": Tag("edge", SE3_GROUP),
    },
    information_entries={group.tangent_dim: upper_triangle(group.tangent_dim) for group in (SE2_GROUP, SE3_GROUP)},
    refused={
        "VERTEX_XY": _LANDMARKS,
        "VERTEX_TRACKXYZ": _LANDMARKS,
        "VERTEX_POINT": _LANDMARKS,
        "EDGE_SE2_": _LANDMARKS,
        "EDGE_SE3_": _LANDMARKS,
        "EDGE_BEARING_": _LANDMARKS,
        "EDGE_RANGE_": _LANDMARKS,
        "PARAMS_": _SENSORS,
    },
)


def read_g2o(path: StrPath) -> PoseGraph:
    """Read a pose graph from a g2o file.

    Ids may be in any order and leave gaps: poses are sorted by id and `PoseGraph.ids` keeps the ids; edges keep the order
    of the file. `#` starts a comment. A pose without a VERTEX line is composed from edges along a spanning tree that prefers
    odometry, outwards from the poses that have one; where no pose has one, from the lowest id at the origin. FIX lines are
    kept as `PoseGraph.fixed`.

    Parameters
    ----------
    path
        The file. Metres and radians.

    Returns
    -------
    PoseGraph
        In SE(2) or SE(3). It may be disconnected if all poses have VERTEX lines.

    Raises
    ------
    FileError
        If the file cannot be read or a line is wrong: names the line, what was expected and what is there. Where the file has
        VERTEX lines, an id without one that a single edge names is refused (an edge to nowhere) unless that edge
        links consecutive ids.
    DisconnectedGraphError
        If poses without a VERTEX line are connected to none that has one; names some of them.
    """
    return read_lines(path, _G2O)


def write_g2o(graph: PoseGraph, path: StrPath) -> None:
    """Write a pose graph as a g2o file; whole or not at all.

    Every double is written so that reading returns it to the last bit. Ids, the order of edges and FIX lines are kept.

    Raises
    ------
    FileError
        If the file cannot be written.
    InvalidInputError
        If an id is negative or so large that `read_g2o` would refuse it.
    """
    if graph.ids.min() < 0 or graph.ids.max() >= ID_LIMIT:
        raise InvalidInputError(
            "expected ids from 0 to 2^53 - 1 for a file, "
            f"got ids from {graph.ids.min()} to {graph.ids.max()}; renumber the poses"
        )
    vertex, edge = (tag for tag, meaning in _G2O.tags.items() if meaning.group is graph.group)
    rows, columns = upper_triangle(graph.tangent_dim)
    lines = [f"{vertex} {name} {_joined(pose)}" for name, pose in zip(graph.ids.tolist(), graph.poses.tolist(), strict=True)]
    lines += [f"FIX {graph.ids[index]}" for index in graph.fixed]
    lines += [
        f"{edge} {i} {j} {_joined(measured)} {_joined(entries)}"
        for (i, j), measured, entries in zip(
            graph.ids[graph.edges].tolist(),
            graph.measurements.tolist(),
            graph.information[:, rows, columns].tolist(),
            strict=True,
        )
    ]
    write_text(path, "\n".join(lines) + "\n")


def _joined(numbers: list[float]) -> str:
    return " ".join(map(repr, numbers))
