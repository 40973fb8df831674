"""Pose graphs that SLAM programs draw for RViz: visualization_msgs/MarkerArray, as `ros2 topic echo` prints it.

slam_toolbox publishes a sphere a pose and lines between them (/slam_toolbox/graph_visualization), Cartographer the poses along
its trajectories (/trajectory_node_list) and lines from submaps to poses (/constraint_list). A drawing has positions and edges
alone: headings are those of travel, measurements what the poses say, and every edge weighs the same.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.errors import FileError, InvalidGraphError
from topobelief.geometry import SE2_GROUP, SE3_GROUP
from topobelief.geometry.planar import quaternions_of_headings, travel_headings
from topobelief.graph.information import block_isotropic
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.topology import Topology
from topobelief.io.echoed import EchoedValue, echoed_values
from topobelief.io.files import StrPath
from topobelief.io.part import wanted_part
from topobelief.io.reading import ReadGraph, ReadingOptions
from topobelief.io.transforms import FARTHEST
from topobelief.wording import counted

_BODIES, _STRIP, _LIST, _BODY_LISTS = (0, 1, 2, 3), 4, 5, (6, 7, 8)  # Marker.type: arrow, cube, sphere and cylinder; …
_DIGITS = 6  # of metres, to which the end of a line agrees with the pose that it belongs to
_RESOLUTION = 10.0**-_DIGITS
_NO_PAIRS = np.zeros((0, 2, 3))
_HEAD = re.compile(rb"\s*(---\s*)*markers:\s*(\[\])?\s*$", re.MULTILINE)


@dataclass
class Marker:
    """What matters of one marker; its line, if it stands in a text."""

    line: int | None = None
    namespace: str = ""
    number: int = 0
    kind: int = 0
    action: int = 0
    pose: dict[str, float] = field(default_factory=dict[str, float])
    points: list[list[float]] = field(default_factory=list[list[float]])


def is_markers(head: bytes) -> bool:
    """Whether the first line that is no comment begins a MarkerArray."""
    return _HEAD.match(re.sub(rb"(?m)^\s*#.*$", b"", head)) is not None


def read_markers(path: StrPath, options: ReadingOptions) -> ReadGraph:
    """Read the graph that markers draw: in SE(2) where it lies in one height, else in SE(3) with upright poses.

    Several messages are taken together, as of Cartographer's two topics; of a marker that comes again, the last one counts.
    Lines drawn between the same two poses are one edge. Cartographer's submaps come first and are numbered from 0, its poses
    from 1000 (or a higher power of ten) along the trajectory.

    Raises
    ------
    FileError
        If the file is no such message, or its markers show no edges between poses.
    """
    return graph_of_markers(path, _markers(path), options)


def graph_of_markers(path: StrPath, markers: Iterable[Marker], options: ReadingOptions, notes: Sequence[str] = ()) -> ReadGraph:
    """As `read_markers`, of the markers themselves, with what is to be said of where they come from."""
    markers = [
        marker for marker in {(marker.namespace, marker.number): marker for marker in markers}.values() if marker.action == 0
    ]
    bodies = sorted((marker for marker in markers if marker.kind in _BODIES), key=lambda marker: marker.number)
    strips = [marker for marker in markers if marker.kind == _STRIP and marker.points]
    lists = [marker for marker in markers if marker.kind == _LIST and marker.points]
    for marker in [*strips, *lists]:
        _require_own_frame(path, marker)
    at = [[marker.pose.get(f"position.{name}", 0.0) for name in "xyz"] for marker in bodies]
    drawn = _stacked([*(m.points for m in strips), at, *(m.points for m in markers if m.kind in _BODY_LISTS)])
    joined = [_pairs([[a, b] for a, b in pairwise(m.points)]) for m in strips]
    residuals, constraints = _of_lists(path, lists)
    lines = np.concatenate([_NO_PAIRS, *joined, constraints])
    _require_edges(path, markers, lines)
    planar = np.ptp(lines[:, :, 2]) < _RESOLUTION
    points = np.concatenate([drawn, residuals[:, 1], residuals[:, 0], lines.reshape(-1, 3)])
    positions, where = _places(points[:, :2] if planar else points)
    pairs = where[len(drawn) + 2 * len(residuals) :].reshape(-1, 2)
    ends = where[len(drawn) : len(drawn) + 2 * len(residuals)].reshape(2, -1)
    leader = _leaders(len(positions), ends)
    edges = _distinct(leader[pairs])
    _require_edges(path, markers, edges)
    poses = np.unique(leader[where[: len(drawn)]])
    others = np.setdiff1d(edges, poses)  # ends of lines at which nothing is drawn, as Cartographer's submaps
    nodes = np.concatenate([others, poses])
    index = np.zeros(len(positions), dtype=np.int64)
    index[nodes] = np.arange(len(nodes))
    try:
        graph = _graph(positions[nodes], index[edges], _ids(len(others), len(poses), len(drawn), bodies), options)
    except InvalidGraphError as error:
        raise FileError(path, str(error)) from None
    return wanted_part(path, graph, options, [*notes, _note(options)])


def _require_edges(path: StrPath, markers: list[Marker], edges: FloatArray | IntArray) -> None:
    """Refuse a drawing in which no line joins two poses."""
    if len(edges) == 0:
        found = f"{counted(len(markers), 'marker')} without any"
        raise FileError(path, f"expected lines between poses among the markers, got {found}; record the topic that shows edges")


def _ids(num_others: int, num_poses: int, num_drawn: int, bodies: list[Marker]) -> IntArray:
    """The numbers of bodies, where each pose is one; else counts, with a gap after what is no pose of the trajectory."""
    numbers = np.unique([marker.number for marker in bodies])
    if num_others == 0 and len(numbers) == len(bodies) == num_drawn == num_poses and numbers[0] >= 0:
        return numbers
    begin = 10 ** (len(str(num_others)) + 2) if num_others and num_poses else num_others
    return np.concatenate([np.arange(num_others), begin + np.arange(num_poses)])


def _graph(positions: FloatArray, edges: IntArray, ids: IntArray, options: ReadingOptions) -> PoseGraph:
    """A graph at these positions, shape (n, 2) or (n, 3), with headings of travel."""
    headings = travel_headings(positions[:, :2])
    planar = positions.shape[1] == SE2_GROUP.position_dim
    turned = headings[:, None] if planar else quaternions_of_headings(headings)
    kappa = (SE2_GROUP if planar else SE3_GROUP).tangent_dim
    information = block_isotropic(*(options.noise or (1.0, 1.0)), tangent_dim=kappa)
    return PoseGraph(np.column_stack([positions, turned]), edges, None, information, ids=ids)


def _note(options: ReadingOptions) -> str:
    missing = "markers show positions and edges alone: headings are those of travel, measurements are what the poses say"
    if options.noise is None:
        return (
            f"{missing}, and every edge weighs 1 per m^2 and rad^2; numbers of spanning trees are right, entropies and metres "
            "mean nothing before a noise is stated, with `topobelief convert --noise` (in Python noise=(metres, radians))"
        )
    return (
        f"{missing}, and every edge has the stated noise, {options.noise[0]:g} m and {math.degrees(options.noise[1]):g} degrees"
    )


def _stacked(parts: list[list[list[float]]]) -> FloatArray:
    return np.array([point for part in parts for point in part]).reshape(-1, 3)


def _pairs(points: list[list[list[float]]]) -> FloatArray:
    return np.array(points).reshape(-1, 2, 3)


def _of_lists(path: StrPath, lists: list[Marker]) -> tuple[FloatArray, FloatArray]:
    """Lines of Cartographer's residuals, from where a constraint ends to the pose that it is about, and all other lines."""
    found: tuple[list[FloatArray], list[FloatArray]] = ([_NO_PAIRS], [_NO_PAIRS])
    for marker in lists:
        if len(marker.points) % 2:
            raise FileError(path, f"expected two points a line, got {len(marker.points)} points", line=marker.line)
        found["residual" not in marker.namespace].append(np.array(marker.points).reshape(-1, 2, 3))
    return np.concatenate(found[0]), np.concatenate(found[1])


def _places(points: FloatArray) -> tuple[FloatArray, IntArray]:
    """Distinct positions in the order in which they come, and which of them each point is."""
    rounded = np.round(points, _DIGITS) + 0.0
    _, first, which = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    return points[np.sort(first)], rank[which.ravel()]


def _leaders(num_places: int, ends: IntArray) -> IntArray:
    """For each place the first of those that residuals join to it, which is a pose."""
    labels = Topology(num_places, ends[:, ends[0] != ends[1]].T).component_labels
    _, first = np.unique(labels, return_index=True)
    return first[labels]


def _distinct(pairs: IntArray) -> IntArray:
    """Edges between different places, each once, in the order in which they come."""
    edges = pairs[pairs[:, 0] != pairs[:, 1]]
    _, first = np.unique(np.sort(edges, axis=1), axis=0, return_index=True)
    return edges[np.sort(first)]


def _require_own_frame(path: StrPath, marker: Marker) -> None:
    """Refuse lines that are drawn in a frame of their own; a height is how far Cartographer lifts some to show them."""
    moved = [name for name, value in marker.pose.items() if value != 0 and name not in ("position.z", "orientation.w")]
    if moved:
        raise FileError(
            path, f"expected lines in the frame of the map, got a marker with pose.{moved[0]} not 0", line=marker.line
        )


def _markers(path: StrPath) -> list[Marker]:
    """The markers of all messages, in their order."""
    found: list[Marker] = []
    begun = 0
    for value in echoed_values(path):
        if value.names[:2] != ("markers", "-"):
            continue
        if value.item != begun:
            found.append(Marker(value.line))
            begun = value.item
        _take(path, found[-1], value)
    return found


def _take(path: StrPath, marker: Marker, value: EchoedValue) -> None:
    """Put one value where it belongs."""
    match value.names[2:]:
        case ("ns",):
            marker.namespace = value.value.strip("'\"")
        case ("id",):
            marker.number = _whole(path, value)
        case ("type",):
            marker.kind = _whole(path, value)
        case ("action",):
            marker.action = _whole(path, value)
        case ("pose", "position" | "orientation" as part, name):
            marker.pose[f"{part}.{name}"] = _number(path, value)
        case ("points", "-", "x" | "y" | "z" as axis):
            if axis == "x":
                marker.points.append([0.0, 0.0, 0.0])
            elif not marker.points:
                raise FileError(path, f"expected a point that begins with x, got {axis}", line=value.line)
            marker.points[-1]["xyz".index(axis)] = _number(path, value)
        case ("points",) if value.value not in ("", "[]"):
            message = "expected points as `ros2 topic echo` prints them, one number a line, got them in brackets"
            raise FileError(path, message, line=value.line)
        case _:
            pass


def _number(path: StrPath, value: EchoedValue) -> float:
    try:
        number = float(value.value)
    except ValueError:
        number = math.nan
    if not abs(number) <= FARTHEST:
        raise FileError(path, f"expected a number of metres for {value.names[-1]}, got {value.value[:40]!r}", line=value.line)
    return number


def _whole(path: StrPath, value: EchoedValue) -> int:
    if not re.fullmatch(r"-?[0-9]{1,10}", value.value):
        raise FileError(path, f"expected a whole number for {value.names[-1]}, got {value.value[:40]!r}", line=value.line)
    return int(value.value)
