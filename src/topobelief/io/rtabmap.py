"""Databases of RTAB-Map (introlab.github.io/rtabmap), which are SQLite files; read without RTAB-Map, and never changed.

    Node   id, map_id, pose                                                 pose by odometry
    Link   from_id, to_id, type, information_matrix, transform              measurements
    Admin  opt_ids, opt_poses                                               poses of the last optimisation

A pose or transform is the upper three rows of a matrix, 12 floats of 32 bits row by row. Information is 6 x 6 doubles, ordered
(translation, rotation). opt_ids and opt_poses are arrays, compressed by zlib and followed by three integers: rows, columns and
the type of an element. A link may be stored from both of its ends.
"""

from __future__ import annotations

import sqlite3
import zlib
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.errors import FileError, InvalidGraphError
from topobelief.geometry import SE3_GROUP
from topobelief.graph.dead_reckoning import dead_reckoned_poses
from topobelief.graph.information import positive_definite
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.topology import Topology
from topobelief.io.files import StrPath
from topobelief.io.part import wanted_part
from topobelief.io.reading import ReadGraph, ReadingOptions, by_option
from topobelief.io.rtabmap_landmarks import with_landmarks
from topobelief.io.transforms import poses_of_matrices
from topobelief.wording import counted

_COLUMNS = {"Node": ("id", "pose"), "Link": ("from_id", "to_id", "type", "information_matrix", "transform"), "Admin": ()}
_MARK = b"SQLite format 3\0"
_FOREIGN = {  # types of links that are not between two poses: the word that drops them, and what they are
    7: ("priors", "absolute pose", "absolute poses"),
    8: ("landmarks", "sighting of a landmark", "sightings of landmarks"),
    9: ("gravity", "direction of gravity", "directions of gravity"),
}
_LANDMARK = 8  # its links lead to tags, which have negative ids
_LAST_TYPE = 6  # of links between poses: odometry, closures of several kinds, and odometry across nodes that were removed
_STEPS = 100_000  # of SQLite's virtual machine between two looks at how many there were
_STEPS_PER_BYTE = 20  # more than reading every row takes
_TWIN = 1e-3  # metres and radians between a link and its inverse that are one measurement


@dataclass(frozen=True, eq=False)
class _Links:
    """Links between poses: ids of both ends, shape (m, 2), transforms (m, 7) and information (m, 6, 6)."""

    ends: IntArray
    transforms: FloatArray
    information: FloatArray

    def chosen(self, which: BoolArray) -> _Links:
        """Some of them."""
        return _Links(self.ends[which], self.transforms[which], self.information[which])


def is_database(head: bytes) -> bool:
    """Whether a file that begins so is an SQLite database."""
    return head.startswith(_MARK)


def read_rtabmap(path: StrPath, options: ReadingOptions) -> ReadGraph:
    """Read the pose graph of an RTAB-Map database, in SE(3).

    Poses are those of the last optimisation. Nodes that it left out are composed from links, outwards from those; without any,
    outwards from the first node of each component at its odometry. Nodes without a link are left out. Tags are landmarks.

    Raises
    ------
    FileError
        If the file is no such database or damaged, or holds links to neither poses nor landmarks and no option
        drops them.
    """
    try:
        uri = f"file:{quote(str(Path(path).resolve()))}?mode=ro&immutable=1"  # makes no lock and no journal beside it
        with closing(sqlite3.connect(uri, uri=True)) as database:
            return _Database(path, database, options).graph()
    except (sqlite3.Error, UnicodeDecodeError) as error:
        reason = " ".join(str(error).split())[:200]
        raise FileError(path, f"expected a database of RTAB-Map, got one that SQLite cannot read: {reason}") from None


def _text(content: bytes) -> str:
    return content.decode(errors="replace")


class _Database:
    """One open database."""

    def __init__(self, path: StrPath, database: sqlite3.Connection, options: ReadingOptions) -> None:
        self.path, self.options = path, options
        size = Path(path).stat().st_size
        self._database = database
        database.text_factory = _text
        self._left = _STEPS_PER_BYTE * size // _STEPS + 10
        database.set_progress_handler(self._out_of_steps, _STEPS)
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(size, 2**30))
        self._size = size
        self.notes: list[str] = []

    def graph(self) -> ReadGraph:
        """The graph, and what was dropped or assumed."""
        self._require_tables()
        every = self._without_twins(self._definite(self._links()))
        sighting: BoolArray = np.min(every.ends, axis=1, initial=0) < 0
        links, sightings = every.chosen(~sighting), every.chosen(sighting)
        ids, edges = np.unique(links.ends, return_inverse=True)
        edges = edges.reshape(-1, 2)
        odometry = self._odometry()
        self._require_nodes(links, odometry)
        optimised = self._optimised()
        known = {node: pose for node, pose in optimised.items() if node in odometry}
        if len(ids) == 0:
            ids = np.array(sorted(known or odometry)[:1], dtype=np.int64)
        if len(ids) == 0:
            raise FileError(self.path, "expected nodes in the table Node, got none")
        poses = self._placed(ids, edges, links.transforms, known, odometry)
        loose = len(odometry) - len(ids)
        if loose:
            self.notes.append(f"left out {counted(loose, 'node')} without a link to another")
        information = links.information if len(edges) else np.eye(SE3_GROUP.tangent_dim)
        try:
            graph = PoseGraph(poses, edges, links.transforms, information, ids=ids)
            if len(sightings.ends):
                graph, notes = with_landmarks(graph, sightings.ends, sightings.transforms, sightings.information, optimised)
                self.notes += notes
        except InvalidGraphError as error:
            raise FileError(self.path, str(error)) from None
        return wanted_part(self.path, graph, self.options, self.notes)

    def _out_of_steps(self) -> bool:
        self._left -= 1
        return self._left < 0

    def _require_tables(self) -> None:
        """Refuse other databases, and those of versions whose links have no information matrix."""
        names = {str(name) for (name,) in self._database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        missing = [name for name in _COLUMNS if name not in names]
        if missing:
            shown = ", ".join(sorted(names)[:5])[:80] or "none"
            raise FileError(self.path, f"expected a database of RTAB-Map with the table {missing[0]}, got tables: {shown}")
        for table, needed in _COLUMNS.items():
            columns = self._columns(table)
            absent = [name for name in needed if name not in columns]
            if absent:
                advice = "open it once with a current RTAB-Map, which brings it up to date"
                raise FileError(self.path, f"expected the column {absent[0]} in the table {table}, got none; {advice}")

    def _columns(self, table: str) -> set[str]:
        return {str(row[1]) for row in self._database.execute(f"PRAGMA table_info({table})")}

    def _links(self) -> _Links:
        """Links between poses, and to landmarks; the others are dropped or refused."""
        foreign: dict[int, int] = {}
        ends: list[tuple[int, int]] = []
        transforms: list[FloatArray] = []
        information: list[FloatArray] = []
        query = "SELECT from_id, to_id, type, transform, information_matrix FROM Link ORDER BY rowid"
        for start, end, kind, transform, matrix in self._database.execute(query):
            name = f"the link {start} - {end}"
            seen = kind == _LANDMARK and _FOREIGN[_LANDMARK][0] not in self.options.drop
            if kind in _FOREIGN and not seen:
                foreign[kind] = foreign.get(kind, 0) + 1
                continue
            if kind not in range(_LAST_TYPE + 1) and not seen:
                raise FileError(self.path, f"expected types of links from 0 to 9, got {kind!r} for {name}")
            if seen:
                if not all(isinstance(node, int) for node in (start, end)) or not -(2**31) < min(start, end) < 0 < max(
                    start, end
                ):
                    raise FileError(self.path, f"expected a node and a landmark at the ends of {name}, got others")
            elif not all(isinstance(node, int) and node > 0 for node in (start, end)) or start == end:
                raise FileError(self.path, f"expected a link between two nodes with ids from 1, got {start!r} - {end!r}")
            ends.append((start, end))
            transforms.append(self._numbers(transform, 12, np.float32, f"the transform of {name}"))
            information.append(self._numbers(matrix, 36, np.float64, f"the information of {name}"))
        self._refuse_foreign(foreign)
        order = np.array(ends, dtype=np.int64).reshape(-1, 2)
        if not len(order):
            return _Links(order, np.zeros((0, 7)), np.zeros((0, 6, 6)))
        matrices = np.array(information).reshape(-1, 6, 6)
        poses = self._poses(np.array(transforms), [f"the link {i} - {j}" for i, j in ends])
        return _Links(order, poses, matrices / 2 + matrices.mT / 2)

    def _refuse_foreign(self, counts: dict[int, int]) -> None:
        """Refuse links that are not between poses, all kinds at once, or note those that are dropped."""
        found = {kind: counted(count, *_FOREIGN[kind][1:]) for kind, count in sorted(counts.items())}
        refused = [kind for kind in found if _FOREIGN[kind][0] not in self.options.drop]
        if refused:
            advice = by_option(*(_FOREIGN[kind][0] for kind in refused))
            listed = " and ".join(found[kind] for kind in refused)
            raise FileError(
                self.path, f"expected links to poses and landmarks alone, got {listed}; leave them out with {advice}"
            )
        self.notes += [f"dropped {shown}; what they measure is not counted" for shown in found.values()]

    def _numbers(self, blob: object, count: int, kind: type, name: str) -> FloatArray:
        """The numbers of a field, all finite."""
        size = count * np.dtype(kind).itemsize
        if not isinstance(blob, bytes) or len(blob) != size:
            got = f"{len(blob)} bytes" if isinstance(blob, bytes) else "none"
            raise FileError(self.path, f"expected {size} bytes for {name}, got {got}")
        numbers = np.frombuffer(blob, dtype=np.dtype(kind).newbyteorder("<")).astype(np.float64)
        if not np.isfinite(numbers).all():
            raise FileError(self.path, f"expected finite numbers for {name}, got nan or infinity")
        return numbers

    def _poses(self, transforms: FloatArray, names: Sequence[str]) -> FloatArray:
        """Poses of shape (n, 7) from 12 numbers each."""
        poses, wrong = poses_of_matrices(transforms.reshape(-1, 3, 4))
        if wrong is not None:
            raise FileError(
                self.path, f"expected a rotation and a position within 1e9 m for {names[wrong]}, got another matrix"
            )
        return poses

    def _definite(self, links: _Links) -> _Links:
        """Links whose information is positive definite; others are refused unless they may be dropped."""
        definite = positive_definite(links.information)
        wrong = np.flatnonzero(~definite)
        if wrong.size == 0:
            return links
        start, end = links.ends[wrong[0]].tolist()
        if "indefinite" not in self.options.drop:
            message = f"expected a positive definite information matrix for the link {start} - {end}, got another"
            raise FileError(self.path, f"{message}; leave out {wrong.size} such links with {by_option('indefinite')}")
        self.notes.append(f"dropped {wrong.size} of {len(definite)} links, whose information is not positive definite")
        return links.chosen(definite)

    def _without_twins(self, links: _Links) -> _Links:
        """One of each two links that are a measurement stored from both of its ends, the one from the lower id."""
        if len(links.ends) == 0:
            return links
        pairs, pair = np.unique(np.sort(links.ends, axis=1), axis=0, return_inverse=True)
        forward = links.ends[:, 0] < links.ends[:, 1]
        first = np.full(len(pairs), -1)  # link from the lower id
        first[pair[forward][::-1]] = np.flatnonzero(forward)[::-1]
        outward = np.where(forward[:, None], links.transforms, SE3_GROUP.inverse(links.transforms))
        apart = np.abs(SE3_GROUP.log(SE3_GROUP.between(outward[first[pair]], outward))).max(axis=1)
        scale = 1 + np.abs(outward[:, :3]).max(axis=1)
        return links.chosen(forward | (first[pair] < 0) | (apart > _TWIN * scale))

    def _odometry(self) -> dict[int, object]:
        """The pose by odometry of each node, as it is stored."""
        nodes = self._database.execute("SELECT id, pose FROM Node")
        return {node: pose for node, pose in nodes if isinstance(node, int) and node > 0}

    def _require_nodes(self, links: _Links, odometry: dict[int, object]) -> None:
        for start, end in links.ends.tolist():
            if start not in odometry or end not in odometry:
                absent = start if start not in odometry else end
                message = f"expected a node at both ends of the link {start} - {end}, got none with id {absent}"
                raise FileError(self.path, message)

    def _optimised(self) -> dict[int, FloatArray]:
        """Poses of the last optimisation by id; landmarks have negative ids."""
        if not {"opt_ids", "opt_poses"} <= self._columns("Admin"):
            return {}
        row = self._database.execute("SELECT opt_ids, opt_poses FROM Admin LIMIT 1").fetchone()
        if row is None or not row[0] or not row[1]:
            return {}
        ids = self._array(row[0], np.int32, "opt_ids")
        numbers = self._array(row[1], np.float32, "opt_poses")
        if len(numbers) != 12 * len(ids):
            raise FileError(self.path, f"expected {12 * len(ids)} numbers in opt_poses for {len(ids)} ids, got {len(numbers)}")
        real = ids != 0
        names = [f"the optimised pose of node {node}" for node in ids[real].tolist()]
        poses = self._poses(numbers.reshape(-1, 12)[real].astype(np.float64), names)
        return dict(zip(ids[real].tolist(), poses, strict=True))

    def _array(self, blob: object, kind: type, name: str) -> NDArray[Any]:
        """A compressed array, flat; never more than a hundred times the size of the file."""
        content = blob if isinstance(blob, bytes) else b""
        rows, columns = np.frombuffer(content[-12:-4], dtype="<i4").tolist() if len(content) > 12 else (0, 0)
        expected = rows * columns * np.dtype(kind).itemsize
        try:
            raw = zlib.decompressobj().decompress(content[:-12], max(expected, 1)) if 0 < expected <= 100 * self._size else b""
        except zlib.error:
            raw = b""
        if len(raw) != expected or not raw:
            raise FileError(self.path, f"expected a compressed array in the field {name} of the table Admin, got damaged bytes")
        return np.frombuffer(raw, dtype=np.dtype(kind).newbyteorder("<"))

    def _placed(
        self,
        ids: IntArray,
        edges: IntArray,
        transforms: FloatArray,
        optimised: dict[int, FloatArray],
        odometry: dict[int, object],
    ) -> FloatArray:
        """Optimised poses; the rest composed from links, where need be from the first node of a component at its odometry."""
        known = {index: optimised[node] for index, node in enumerate(ids.tolist()) if node in optimised}
        labels = Topology(len(ids), edges).component_labels
        _, firsts = np.unique(labels, return_index=True)
        held = {int(labels[index]) for index in known}
        for index in firsts.tolist():
            if int(labels[index]) not in held:
                known[index] = self._odometry_pose(int(ids[index]), odometry)
        composed = sum(node not in optimised for node in ids.tolist())
        if composed:
            without = f"{composed} of {counted(len(ids), 'node')}"
            self.notes.append(
                f"composed poses from odometry and links for {without} without an optimised one; optimise the graph"
            )
        indices = sorted(known)
        poses = np.array([known[index] for index in indices])
        return dead_reckoned_poses(SE3_GROUP, len(ids), edges, transforms, known=indices, known_poses=poses)

    def _odometry_pose(self, node: int, odometry: dict[int, object]) -> FloatArray:
        if odometry[node] is None:
            return SE3_GROUP.identity()
        name = f"the pose of node {node}"
        return self._poses(self._numbers(odometry[node], 12, np.float32, name), [name])[0]
