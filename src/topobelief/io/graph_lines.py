"""Pose graphs as lines of text: what the g2o and TORO formats share.

A line is a tag, ids and numbers. One pass over the lines turns fields into numbers and finds the lines that are malformed;
what the numbers mean is checked on whole columns, and an error looks up the line that it came from.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.errors import DisconnectedGraphError, FileError, InvalidGraphError
from topobelief.geometry import Group
from topobelief.graph.dead_reckoning import dead_reckoned_poses
from topobelief.graph.information import checked_information
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.files import StrPath, read_text

ID_LIMIT = 2**53  # below it every whole number is a double
_QUATERNION_NORMS = (1e-6, 1e6)  # what rounding and carelessness leave of a unit quaternion


@dataclass(frozen=True)
class Tag:
    """What a line with this tag holds: ids, the numbers of a pose, and an edge's information."""

    kind: Literal["vertex", "edge"]
    group: Group

    @property
    def num_ids(self) -> int:
        """1 for a vertex, 2 for an edge."""
        return 1 if self.kind == "vertex" else 2

    @property
    def num_information(self) -> int:
        """Entries of the upper triangle for an edge, 0 for a vertex."""
        return self.group.tangent_dim * (self.group.tangent_dim + 1) // 2 if self.kind == "edge" else 0

    @property
    def num_fields(self) -> int:
        """Fields after the tag."""
        return self.num_ids + self.group.pose_size + self.num_information


@dataclass(frozen=True)
class Dialect:
    """A format of pose-graph files.

    Parameters
    ----------
    tags
        The lines that are read; "FIX" is part of every dialect.
    information_entries
        (row, column) of each number of an edge's information, in the order of the file, for each tangent dimension.
    refused
        Starts of tags that the format knows and this reader does not, and why.
    """

    tags: Mapping[str, Tag]
    information_entries: Mapping[int, tuple[IntArray, IntArray]]
    refused: Mapping[str, str]


@dataclass
class _Table:
    """Lines with one tag: their numbers in the file and all their fields as numbers, end to end."""

    tag: str
    meaning: Tag
    lines: list[int] = field(default_factory=list[int])
    numbers: list[float] = field(default_factory=list[float])

    def columns(self) -> tuple[FloatArray, FloatArray]:
        """Ids, shape (count, 1 or 2), and values, shape (count, pose numbers and information entries)."""
        rows = np.array(self.numbers).reshape(-1, self.meaning.num_fields)
        return rows[:, : self.meaning.num_ids], rows[:, self.meaning.num_ids :]


def upper_triangle(size: int) -> tuple[IntArray, IntArray]:
    """(row, column) of the entries of an upper triangle, row by row."""
    rows, columns = np.triu_indices(size)
    return rows.astype(np.int64), columns.astype(np.int64)


def read_lines(path: StrPath, dialect: Dialect) -> PoseGraph:
    """Read a pose graph.

    Raises
    ------
    FileError
        Names the file, the line, what was expected and what is there.
    DisconnectedGraphError
        If poses without a vertex line hang on none that has one; names some of them.
    """
    return _Reader(path, dialect).graph()


class _Reader:
    """One file on its way to a pose graph."""

    def __init__(self, path: StrPath, dialect: Dialect) -> None:
        self.path = path
        self.dialect = dialect
        self.text_lines = read_text(path).split("\n")
        self.fix_lines: list[tuple[int, list[float]]] = []
        tables = self._tables()
        self.group = self._common_group(tables)
        self.vertices = next(table for table in tables if table.meaning == Tag("vertex", self.group))
        self.edges = next(table for table in tables if table.meaning == Tag("edge", self.group))

    def graph(self) -> PoseGraph:
        """The pose graph, all of it checked."""
        vertex_ids, vertex_values = self._checked_columns(self.vertices)
        edge_ids, edge_values = self._checked_columns(self.edges)
        self._refuse_repeated_ids(vertex_ids[:, 0])
        self._refuse_self_loops(edge_ids)
        ids = np.unique(np.concatenate([vertex_ids.ravel(), edge_ids.ravel()]))
        if len(edge_ids) == 0 and len(ids) > 1:
            raise FileError(self.path, f"expected {self.edges.tag} lines between the {len(ids)} poses, got none")
        if 0 < len(vertex_ids) < len(ids):
            self._refuse_edges_to_nowhere(vertex_ids, edge_ids)

        kappa, size = self.group.tangent_dim, self.group.pose_size
        rows, columns = self.dialect.information_entries[kappa]
        information = np.empty((len(edge_ids), kappa, kappa))
        information[:, rows, columns] = information[:, columns, rows] = edge_values[:, size:]
        edges, known = np.searchsorted(ids, edge_ids), np.searchsorted(ids, vertex_ids[:, 0])
        measurements = self.group.normalized(edge_values[:, :size])
        poses = self._placed(ids, edges, measurements, known, self.group.normalized(vertex_values))
        fixed = self._fixed(ids)
        try:
            return PoseGraph(poses, edges, measurements, information, ids=ids, fixed=fixed)
        except InvalidGraphError as error:
            raise self._information_error(information) or FileError(self.path, str(error)) from None

    def _tables(self) -> list[_Table]:
        """Fields by tag; blank lines and comments dropped."""
        tables = {tag: _Table(tag, meaning) for tag, meaning in self.dialect.tags.items()}
        for number, line in enumerate(self.text_lines, start=1):
            fields = self._fields(number)
            if not fields:
                continue
            tag = fields.pop(0)
            table = tables.get(tag)
            if table is None and tag != "FIX":
                raise FileError(self.path, self._refusal(tag), line=number)
            if table is not None and len(fields) != table.meaning.num_fields:
                raise FileError(self.path, _wrong_count(table, len(fields)), line=number)
            try:
                numbers = [float(text) for text in fields]
                plain = line.isascii() and line.count("_") == tag.count("_")  # float takes other digits, and 1_000
            except ValueError:
                numbers, plain = [], False
            if not plain and (wrong := next((text for text in fields if not _is_number(text)), None)) is not None:
                raise FileError(self.path, f"expected a number for {tag}, got {wrong[:40]!r}", line=number)
            if table is None:
                self.fix_lines.append((number, numbers))
            else:
                table.lines.append(number)
                table.numbers.extend(numbers)
        return list(tables.values())

    def _fields(self, number: int) -> list[str]:
        line = self.text_lines[number - 1]
        return (line.partition("#")[0] if "#" in line else line).split()

    def _refusal(self, tag: str) -> str:
        shown = tag if tag.isprintable() and len(tag) <= 40 else f"{tag[:40]!a}"
        reason = next((why for start, why in self.dialect.refused.items() if tag.startswith(start)), None)
        expected = f"expected {', '.join(self.dialect.tags)} or FIX"
        if reason is None:
            return f"{expected}, got the unknown tag {shown}; remove the line if it does not matter"
        return f"{expected}, got {shown}: {reason}"

    def _common_group(self, tables: list[_Table]) -> Group:
        """The one group of all lines."""
        found = sorted((table for table in tables if table.lines), key=lambda table: table.lines[0])
        if not found:
            raise FileError(self.path, f"expected lines with {', '.join(self.dialect.tags)}, got none")
        first = found[0]
        for table in found:
            if table.meaning.group is not first.meaning.group:
                message = (
                    f"expected lines in {first.meaning.group.name} as {first.tag} on line {first.lines[0]}, got {table.tag}"
                )
                raise FileError(self.path, message, line=table.lines[0])
        return first.meaning.group

    def _checked_columns(self, table: _Table) -> tuple[IntArray, FloatArray]:
        """Ids as integers and finite values, quaternions of a length that can be normalised."""
        raw_ids, values = table.columns()
        self._refuse(table, ~_is_id(raw_ids), "expected whole ids from 0 to 2^53 - 1", advice="; renumber the poses")
        self._refuse(table, ~np.isfinite(values), "expected finite numbers", offset=table.meaning.num_ids)
        if self.group.rotation_dim > 1:
            with np.errstate(over="ignore"):
                norms = np.linalg.norm(values[:, self.group.position_dim : self.group.pose_size], axis=1)
            wrong = np.flatnonzero(~((norms >= _QUATERNION_NORMS[0]) & (norms <= _QUATERNION_NORMS[1])))
            if wrong.size:
                message = f"expected a unit quaternion for {table.tag}, got one of norm {norms[wrong[0]]:.3g}"
                raise FileError(self.path, message, line=table.lines[int(wrong[0])])
        return raw_ids.astype(np.int64), values

    def _refuse(self, table: _Table, wrong: BoolArray, expected: str, *, offset: int = 0, advice: str = "") -> None:
        """Name the line and field of the first wrong entry, if there is one."""
        if wrong.any():
            row, column = np.unravel_index(int(np.argmax(wrong)), wrong.shape)
            line = table.lines[int(row)]
            text = self._fields(line)[1 + offset + int(column)]
            raise FileError(self.path, f"{expected} for {table.tag}, got {text}{advice}", line=line)

    def _refuse_repeated_ids(self, ids: IntArray) -> None:
        first_rows, row_groups = np.unique(ids, return_index=True, return_inverse=True)[1:]
        repeated = np.flatnonzero(first_rows[row_groups] != np.arange(len(ids)))
        if repeated.size:
            again, lines = int(repeated[0]), self.vertices.lines
            first = lines[int(first_rows[row_groups[again]])]
            message = f"expected one {self.vertices.tag} per id, got id {ids[again]} again (first on line {first})"
            raise FileError(self.path, message, line=lines[again])

    def _refuse_self_loops(self, ids: IntArray) -> None:
        loops = np.flatnonzero(ids[:, 0] == ids[:, 1])
        if loops.size:
            message = f"expected an edge between two poses, got a self-loop at {ids[loops[0], 0]}"
            raise FileError(self.path, message, line=self.edges.lines[int(loops[0])])

    def _refuse_edges_to_nowhere(self, vertex_ids: IntArray, edge_ids: IntArray) -> None:
        """Beside vertex lines, an id without one that a single edge names, and no odometry, is more likely a slip."""
        _, where, counts = np.unique(edge_ids, return_inverse=True, return_counts=True)
        loose = (counts[where] == 1).reshape(edge_ids.shape) & ~np.isin(edge_ids, vertex_ids)
        jump = np.abs(edge_ids[:, 0] - edge_ids[:, 1]) > 1
        nowhere = np.argwhere(loose & jump[:, None])
        if nowhere.size:
            row, end = (int(index) for index in nowhere[0])
            message = (
                f"expected an edge between poses, got one to nowhere: {edge_ids[row, end]} has no {self.vertices.tag} line "
                "and no other edge; correct the id or add its line"
            )
            raise FileError(self.path, message, line=self.edges.lines[row])

    def _placed(
        self, ids: IntArray, edges: IntArray, measurements: FloatArray, known: IntArray, known_poses: FloatArray
    ) -> FloatArray:
        """Poses as filed, the others composed from edges; the lowest id is the origin where no pose is given."""
        if len(known) == 0:
            known, known_poses = np.zeros(1, dtype=np.int64), self.group.identity()[None]
        poses = dead_reckoned_poses(self.group, len(ids), edges, measurements, known=known, known_poses=known_poses)
        unreached = np.isnan(poses[:, 0])
        if unreached.any():
            raise DisconnectedGraphError(ids[unreached].tolist(), anchor=int(ids[known.min()]), what=f"graph in {self.path}")
        return poses

    def _fixed(self, ids: IntArray) -> tuple[int, ...]:
        """Indices of the poses that FIX lines name, in increasing order."""
        fixed: set[int] = set()
        for number, wanted in self.fix_lines:
            if not wanted:
                raise FileError(self.path, "expected at least one id for FIX, got none", line=number)
            for value in wanted:
                if value not in ids:
                    message = f"expected the id of a pose for FIX, got {value:.17g}, which no other line names"
                    raise FileError(self.path, message, line=number)
                fixed.add(int(np.searchsorted(ids, int(value))))
        return tuple(sorted(fixed))

    def _information_error(self, information: FloatArray) -> FileError | None:
        """The first edge whose information is refused."""
        for line, matrix in zip(self.edges.lines, information, strict=True):
            try:
                checked_information(matrix, num_edges=1, tangent_dim=len(matrix))
            except InvalidGraphError:
                spectrum = np.linalg.eigvalsh(matrix)
                message = (
                    f"expected a positive definite information matrix for {self.edges.tag}, "
                    f"got eigenvalues from {spectrum[0]:.3g} to {spectrum[-1]:.3g}"
                )
                return FileError(self.path, message, line=line)
        return None


def _wrong_count(table: _Table, got: int) -> str:
    meaning = table.meaning
    before = meaning.num_ids + meaning.group.pose_size
    if meaning.kind == "edge" and got >= before:
        return f"expected {meaning.num_information} information entries for {table.tag}, got {got - before}"
    ids = "an id" if meaning.num_ids == 1 else f"{meaning.num_ids} ids"
    more = f" and {meaning.num_information} information entries" if meaning.num_information else ""
    return f"expected {ids}, {meaning.group.pose_size} numbers{more} for {table.tag}, got {got} fields"


def _is_id(values: FloatArray) -> BoolArray:
    return (values >= 0) & (values < ID_LIMIT) & (values == np.floor(values))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return text.isascii() and "_" not in text
