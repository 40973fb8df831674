"""Lines of landmarks in pose-graph files: those of g2o, and of the plain dialect that GTSAM reads.

    VERTEX_XY id x y
    EDGE_SE2_XY i l x y I11 I12 I22                 position in the frame of pose i, and its information
    EDGE_BEARING_SE2_XY i l bearing I               angle off the direction ahead, and its information
    LANDMARK2 i l x y I11 I12 I22                   as EDGE_SE2_XY
    LANDMARK i l x y C11 C12 C22                    position with its covariance
    BR i l bearing range sigma_bearing sigma_range
    VERTEX_TRACKXYZ id x y z
    EDGE_SE3_TRACKXYZ i l p x y z I11 I12 I13 I22 I23 I33
    PARAMS_SE3OFFSET p x y z qx qy qz qw            the sensor p of EDGE_SE3_TRACKXYZ in the frame of the pose

An isotropic covariance in a LANDMARK line is taken as GTSAM takes it: for that of a position at a range of 10 m, so that it
means a bearing of variance C11/10 and a range of variance C11 at any range. Another covariance is that of the position.

Landmarks may be numbered apart from poses. Where an id is that of a pose too, all landmarks of the file get GTSAM's symbols:
l5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.errors import FileError, InvalidInputError
from topobelief.geometry import SE2_GROUP, SE3_GROUP, Group
from topobelief.graph.information import positive_definite
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.readings import BEARING, BEARING_RANGE, POSITION
from topobelief.io.files import StrPath
from topobelief.io.line_fields import parsed_fields
from topobelief.symbols import node_name

_SYMBOL = ord("l") << 56
_ISOTROPIC = 1e-4  # m^2; GTSAM's tolerance
_STATED_RANGE = 10.0  # m; where GTSAM takes the covariance of a LANDMARK line to hold


@dataclass(frozen=True)
class _Tag:
    """What a line holds: ids, then numbers."""

    group: Group
    num_ids: int
    num_numbers: int
    meaning: str


_BEARING = "EDGE_BEARING_SE2_XY"
_TAGS = {
    "VERTEX_XY": _Tag(SE2_GROUP, 1, 2, "an id and 2 numbers"),
    "EDGE_SE2_XY": _Tag(SE2_GROUP, 2, 5, "2 ids, 2 numbers and 3 information entries"),
    _BEARING: _Tag(SE2_GROUP, 2, 2, "2 ids, a bearing and its information"),
    "LANDMARK2": _Tag(SE2_GROUP, 2, 5, "2 ids, 2 numbers and 3 information entries"),
    "LANDMARK": _Tag(SE2_GROUP, 2, 5, "2 ids, 2 numbers and 3 covariances"),
    "BR": _Tag(SE2_GROUP, 2, 4, "2 ids, bearing, range and their standard deviations"),
    "VERTEX_TRACKXYZ": _Tag(SE3_GROUP, 1, 3, "an id and 3 numbers"),
    "EDGE_SE3_TRACKXYZ": _Tag(SE3_GROUP, 3, 9, "3 ids, 3 numbers and 6 information entries"),
}
_OFFSET = "PARAMS_SE3OFFSET"
_COVARIANCES = ("LANDMARK", "BR")


class Observations(NamedTuple):
    """Observations of landmarks in the order of the file.

    Attributes
    ----------
    poses, landmarks : shape (m,)
        Ids as in the file.
    measurements : shape (m, k)
        Positions in the frames of the poses.
    information : shape (m, kappa, kappa)
        In the numbers that are read.
    readings : shape (m,)
        Names of what is read.
    """

    poses: IntArray
    landmarks: IntArray
    measurements: FloatArray
    information: FloatArray
    readings: list[str]


@dataclass
class LandmarkLines:
    """Lines of landmarks of one file, collected while it is read."""

    path: StrPath
    vertices: dict[int, tuple[int, list[float]]] = field(default_factory=dict[int, tuple[int, list[float]]])
    _seen: list[tuple[int, str, list[int], list[float]]] = field(default_factory=list[tuple[int, str, list[int], list[float]]])
    _offsets: dict[int, list[float]] = field(default_factory=dict[int, list[float]])
    first: tuple[int, str] | None = None

    def take(self, tag: str, number: int, line: str, fields: list[str]) -> bool:
        """Whether the line is one of a landmark; if so it is kept."""
        if tag == _OFFSET:
            self._take_offset(fields, line, number)
            return True
        meaning = _TAGS.get(tag)
        if meaning is None:
            return False
        if len(fields) != meaning.num_ids + meaning.num_numbers:
            raise FileError(self.path, f"expected {meaning.meaning} for {tag}, got {len(fields)} fields", line=number)
        ids, numbers = parsed_fields(self.path, tag, fields, meaning.num_ids, line, number)
        wrong = next(
            (text for text, value in zip(fields[meaning.num_ids :], numbers, strict=True) if not math.isfinite(value)), None
        )
        if wrong is not None:
            raise FileError(self.path, f"expected finite numbers for {tag}, got {wrong[:40]}", line=number)
        self.first = self.first or (number, tag)
        if _TAGS[self.first[1]].group is not meaning.group:
            message = f"expected landmarks in {_TAGS[self.first[1]].group.name} as on line {self.first[0]}, got {tag}"
            raise FileError(self.path, message, line=number)
        if meaning.num_ids > 1:
            self._seen.append((number, tag, ids, numbers))
        elif ids[0] in self.vertices:
            message = f"expected one {tag} per id, got id {node_name(ids[0])} again (first on line {self.vertices[ids[0]][0]})"
            raise FileError(self.path, message, line=number)
        else:
            self.vertices[ids[0]] = number, numbers
        return True

    def _take_offset(self, fields: list[str], line: str, number: int) -> None:
        """Offsets matter only where an observation refers to them; others may have any form."""
        if len(fields) == 8:
            try:
                [name], numbers = parsed_fields(self.path, _OFFSET, fields, 1, line, number)
            except FileError:
                return
            self._offsets[name] = numbers

    @property
    def group(self) -> Group | None:
        """SE(2) or SE(3); None without landmarks."""
        return None if self.first is None else _TAGS[self.first[1]].group

    @property
    def states_covariances(self) -> bool:
        """Whether there are lines of a dialect that states covariances."""
        return any(tag in _COVARIANCES for _, tag, _, _ in self._seen)

    def observations(self, group: Group, poses: IntArray) -> Observations:
        """All observations, checked against the ids of the poses of the file.

        Raises
        ------
        FileError
            For an unknown pose or offset, or information that is not positive definite.
        """
        k, kappa = group.position_dim, group.tangent_dim
        known = set(poses.tolist())
        count = len(self._seen)
        measurements, information = np.zeros((count, k)), np.zeros((count, kappa, kappa))
        readings = list[str]()
        for row, (number, tag, ids, numbers) in enumerate(self._seen):
            if ids[0] not in known:
                message = f"expected an observation by a pose, got one by {node_name(ids[0])}, which no other line names"
                raise FileError(self.path, message, line=number)
            with np.errstate(over="ignore", invalid="ignore"):
                measurements[row], block, reading = self._read(tag, ids, numbers, number)
            if not np.isfinite(measurements[row]).all():
                raise FileError(self.path, f"expected a landmark within reach of numbers for {tag}, got another", line=number)
            if not positive_definite(block[None])[0]:
                what = "covariance" if tag in _COVARIANCES else "information matrix"
                raise FileError(self.path, f"expected a positive definite {what} for {tag}, got another", line=number)
            information[row, : len(block), : len(block)] = block
            readings.append(reading)
        self._require_places()
        pairs = np.array([ids[:2] for _, _, ids, _ in self._seen], dtype=np.int64).reshape(-1, 2)
        return Observations(pairs[:, 0], pairs[:, 1], measurements, information, readings)

    def _require_places(self) -> None:
        """Refuse landmarks without a line of their own where the first observation is a bearing, which puts them nowhere."""
        placed = set(self.vertices)
        for number, tag, ids, _ in self._seen:
            if tag == _BEARING and ids[1] not in placed:
                message = f"expected a line VERTEX_XY for landmark {node_name(ids[1])}, which is seen by its bearing first"
                raise FileError(self.path, f"{message}, got none; say about where it is", line=number)
            placed.add(ids[1])

    def _read(self, tag: str, ids: list[int], numbers: list[float], number: int) -> tuple[FloatArray, FloatArray, str]:
        """Position in the frame of the pose, information, and what is read."""
        if tag == "BR":
            bearing, distance, *deviations = numbers
            if not distance > 0 or not min(deviations) > 0:
                raise FileError(self.path, "expected a range and standard deviations above 0 for BR, got others", line=number)
            position = distance * np.array([math.cos(bearing), math.sin(bearing)])
            return position, np.diag(np.array(deviations) ** -2.0), BEARING_RANGE.name
        if tag == _BEARING:
            return np.array([math.cos(numbers[0]), math.sin(numbers[0])]), np.array([[numbers[1]]]), BEARING.name
        if tag == "EDGE_SE3_TRACKXYZ":
            return self._from_sensor(ids[2], numbers, number)
        position, matrix = np.array(numbers[:2]), _symmetric(numbers[2:])
        if tag != "LANDMARK":
            return position, matrix, POSITION.name
        if not positive_definite(matrix[None])[0]:
            return position, np.zeros((2, 2)), POSITION.name
        if abs(matrix[0, 0] - matrix[1, 1]) < _ISOTROPIC and matrix[0, 1] == 0 and position.any():
            return position, np.diag([_STATED_RANGE / matrix[0, 0], 1 / matrix[0, 0]]), BEARING_RANGE.name
        return position, np.asarray(np.linalg.inv(matrix), dtype=np.float64), POSITION.name

    def _from_sensor(self, offset: int, numbers: list[float], number: int) -> tuple[FloatArray, FloatArray, str]:
        """What a sensor that is set off from the pose sees, in the frame of the pose."""
        stated = self._offsets.get(offset)
        if stated is None or not np.isfinite(stated).all() or not np.linalg.norm(stated[3:]) > 0:
            message = f"expected a line {_OFFSET} {offset} with a pose for EDGE_SE3_TRACKXYZ, got none"
            raise FileError(self.path, message, line=number)
        pose = SE3_GROUP.normalized(np.array(stated))
        turn = SE3_GROUP.rotation_matrix(pose)
        information = turn @ _symmetric(numbers[3:]) @ turn.T
        return turn @ np.array(numbers[:3]) + pose[:3], information / 2 + information.T / 2, POSITION.name

    def renamed(self, landmarks: IntArray, poses: IntArray) -> IntArray:
        """Ids of landmarks in the graph: their own, or symbols where one is that of a pose."""
        return landmarks + _SYMBOL if self._collides(poses) and (landmarks < 2**48).all() else landmarks

    def _collides(self, poses: IntArray) -> bool:
        ids = {ids[1] for _, _, ids, _ in self._seen} | set(self.vertices)
        return not ids.isdisjoint(poses.tolist())

    def ids(self) -> IntArray:
        """Ids of all landmarks as in the file, ascending."""
        return np.array(sorted({ids[1] for _, _, ids, _ in self._seen} | set(self.vertices)), dtype=np.int64)

    def given(self, landmarks: IntArray, group: Group) -> tuple[BoolArray, FloatArray]:
        """Which of these landmarks have a line of their own, and what it says, as poses."""
        poses = np.tile(group.identity(), (len(landmarks), 1))
        known = np.array([landmark in self.vertices for landmark in landmarks.tolist()], dtype=np.bool_)
        for row in np.flatnonzero(known):
            poses[row, : group.position_dim] = self.vertices[int(landmarks[row])][1]
        return known, poses


def _symmetric(entries: list[float]) -> FloatArray:
    """The symmetric matrix whose upper triangle stands row by row."""
    size = 2 if len(entries) == 3 else 3
    matrix = np.zeros((size, size))
    matrix[np.triu_indices(size)] = entries
    return matrix + np.triu(matrix, 1).T


def vertex_lines(graph: PoseGraph) -> list[str]:
    """Lines of landmarks, in the order of the graph."""
    k, tag = graph.group.position_dim, "VERTEX_XY" if graph.group is SE2_GROUP else "VERTEX_TRACKXYZ"
    places = zip(graph.ids[graph.is_landmark].tolist(), graph.positions[graph.is_landmark].tolist(), strict=True)
    lines = [f"{tag} {name} {' '.join(map(repr, place))}" for name, place in places]
    return [*lines, f"{_OFFSET} 0 0 0 0 0 0 0 1"] if lines and k == SE3_GROUP.position_dim else lines


def observation_lines(graph: PoseGraph) -> list[str]:
    """Lines of observations of positions, and in the plane of bearings, in the order of the graph.

    Raises
    ------
    InvalidInputError
        Where something else is read.
    """
    observing, k = np.flatnonzero(graph.reading_codes), graph.group.position_dim
    in_plane = graph.group is SE2_GROUP
    written = {POSITION.name, BEARING.name} if in_plane else {POSITION.name}
    readings = graph.readings
    others = sorted(set(readings[observing].tolist()) - written)
    if others:
        raise InvalidInputError(
            f"expected observations of {' or '.join(sorted(written))} for a file, got "
            f"{' and '.join(others).replace('_', ' and ')}; "
            "take them for positions at the estimate with PoseGraph.with_positions()"
        )
    tag, sensor = ("EDGE_SE2_XY", "") if in_plane else ("EDGE_SE3_TRACKXYZ", " 0")
    rows, columns = np.triu_indices(k)
    lines = list[str]()
    for edge in observing.tolist():
        (i, j), measured, noise = graph.ids[graph.edges[edge]].tolist(), graph.measurements[edge, :k], graph.noise[edge]
        if readings[edge] == BEARING.name:
            lines.append(f"{_BEARING} {i} {j} {math.atan2(measured[1], measured[0])!r} {float(noise[0, 0])!r}")
        else:
            numbers = [*measured.tolist(), *noise[rows, columns].tolist()]
            lines.append(f"{tag} {i} {j}{sensor} {' '.join(map(repr, numbers))}")
    return lines
