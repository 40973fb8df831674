"""Pose graphs as lines of text: what the g2o and TORO formats share.

A line is a tag, ids and numbers. One pass over the lines turns fields into numbers and finds the lines that are malformed;
what the numbers mean is checked on whole columns, and an error looks up the line that it came from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.errors import DisconnectedGraphError, FileError, InvalidGraphError
from topobelief.geometry import Group
from topobelief.graph.dead_reckoning import dead_reckoned_poses
from topobelief.graph.information import positive_definite
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.readings import RELATIVE_POSE
from topobelief.graph.variable_kinds import LANDMARK, POSE
from topobelief.io.dialect import Dialect, Tag
from topobelief.io.files import StrPath, read_text
from topobelief.io.foreign_lines import ForeignLines
from topobelief.io.landmark_lines import LandmarkLines
from topobelief.io.line_fields import parsed_fields
from topobelief.io.part import in_plane, wanted_component
from topobelief.io.reading import ReadGraph, ReadingOptions, by_option
from topobelief.io.robust_edges import SWITCHES, plain_edges
from topobelief.symbols import node_name

_QUATERNION_NORMS = (1e-6, 1e6)  # what rounding and carelessness leave of a unit quaternion


@dataclass
class _Table:
    """Lines with one tag: their numbers in the file, their ids and their other numbers, end to end."""

    tag: str
    meaning: Tag
    lines: list[int] = field(default_factory=list[int])
    ids: list[int] = field(default_factory=list[int])
    numbers: list[float] = field(default_factory=list[float])

    def columns(self) -> tuple[IntArray, FloatArray]:
        """Ids, shape (count, 1 or 2), and values, shape (count, pose numbers and information entries)."""
        num_ids = self.meaning.num_ids
        ids = np.array(self.ids, dtype=np.int64).reshape(-1, num_ids)
        return ids, np.array(self.numbers).reshape(-1, self.meaning.num_fields - num_ids)


def read_lines(path: StrPath, dialects: Sequence[Dialect], options: ReadingOptions) -> ReadGraph:
    """Read a pose graph in that one of some formats to which the first line of a graph belongs.

    Raises
    ------
    FileError
        Names the file, the line, what was expected and what is there.
    DisconnectedGraphError
        If poses without a vertex line are connected to none that has one; names some of them.
    """
    return _Reader(path, dialects, options).read()


class _Reader:
    """One file on its way to a pose graph."""

    def __init__(self, path: StrPath, dialects: Sequence[Dialect], options: ReadingOptions) -> None:
        self.path = path
        self.options = options
        self.text_lines = read_text(path, any_encoding=True).split("\n")
        self.rewritten: dict[int, list[str]] = {}  # fields of robust edges as plain ones, by index of the line
        self.dialect, self.expected = self._dialect(dialects)
        self.notes: list[str] = []
        if options.robust_as_plain:
            fields = [self._fields(number) for number in range(1, len(self.text_lines) + 1)]
            self.rewritten, self.notes = plain_edges(path, fields, self.dialect.tags)
        self.foreign = ForeignLines()
        self.landmarks = LandmarkLines(path)
        self.fix_lines: list[tuple[int, list[int]]] = []
        tables = self._tables()
        self.fix_lines = [(number, self.foreign.take_fixed(number, ids)) for number, ids in self.fix_lines]
        self.foreign.refuse(path, options.drop)
        self.notes += self.foreign.notes()
        self.group = self._common_group(tables)
        self.vertices = next(table for table in tables if table.meaning == Tag("vertex", self.group))
        self.edges = next(table for table in tables if table.meaning == Tag("edge", self.group))

    def read(self) -> ReadGraph:
        """The pose graph, all of it checked, and what was dropped or assumed."""
        size = self.group.pose_size
        vertex_ids, vertex_values = self._checked_columns(self.vertices)
        edge_ids, edge_values = self._checked_columns(self.edges)
        self._refuse_repeated_ids(vertex_ids[:, 0])
        self._refuse_self_loops(edge_ids)
        named = np.unique(np.concatenate([vertex_ids.ravel(), edge_ids.ravel()]))
        if len(edge_ids) == 0 and len(named) > 1:
            raise FileError(self.path, f"expected {self.edges.tag} lines between the {len(named)} poses, got none")
        self._refuse_edges_to_other_things(vertex_ids, edge_ids)
        if 0 < len(vertex_ids) < len(named):
            self._refuse_edges_to_nowhere(vertex_ids, edge_ids)

        information, definite = self._definite(edge_values[:, size:])
        ids = np.unique(np.concatenate([vertex_ids.ravel(), edge_ids[definite].ravel()]))
        seen, landmarks = self.landmarks.observations(self.group, ids), self.landmarks.ids()
        names = np.concatenate([ids, self.landmarks.renamed(landmarks, ids)])
        observing = np.stack([np.searchsorted(ids, seen.poses), len(ids) + np.searchsorted(landmarks, seen.landmarks)], axis=1)
        between = np.searchsorted(ids, edge_ids[definite])
        inside, kept_notes = wanted_component(self.path, names, np.concatenate([between, observing]), self.options.component)
        self.notes += kept_notes
        names, landmarks, num_poses = names[inside], landmarks[inside[len(ids) :]], len(ids)
        kept_seen = inside[observing[:, 0]]
        observing = (np.cumsum(inside) - 1)[observing[kept_seen]]
        ids = ids[inside[:num_poses]]
        kept, given = definite & np.isin(edge_ids[:, 0], ids), np.isin(vertex_ids[:, 0], ids)
        edges, known = np.searchsorted(ids, edge_ids[kept]), np.searchsorted(ids, vertex_ids[given, 0])
        measurements = self.group.normalized(edge_values[kept, :size])
        poses = self._placed(ids, edges, measurements, known, self.group.normalized(vertex_values[given]))
        fixed = self._fixed(np.concatenate([named, landmarks]), np.concatenate([ids, landmarks]))
        kinds = np.repeat([POSE.name, LANDMARK.name], [len(ids), len(landmarks)])
        readings = [*[RELATIVE_POSE] * len(edges), *np.array(seen.readings, dtype=object)[kept_seen].tolist()]
        observed = np.tile(self.group.identity(), (len(observing), 1))
        observed[:, : self.group.position_dim] = seen.measurements[kept_seen]
        try:
            graph = PoseGraph(
                np.concatenate([poses, self._placed_landmarks(poses, landmarks, observing, observed)]),
                np.concatenate([edges, observing]),
                np.concatenate([measurements, observed]),
                np.concatenate([information[kept], seen.information[kept_seen]]),
                kinds if len(landmarks) else None,
                ids=names,
                fixed=fixed,
                readings=readings if len(landmarks) else None,
            )
        except InvalidGraphError as error:
            raise FileError(self.path, str(error)) from None
        graph, dropped = in_plane(self.path, graph, self.options)
        return ReadGraph(graph, (*self.notes, *dropped))

    def _dialect(self, dialects: Sequence[Dialect]) -> tuple[Dialect, str]:
        """The format of the first line that shows one, and the tags that are expected."""
        for number in range(1, len(self.text_lines) + 1):
            tag = next(iter(self._fields(number)), "")
            for dialect in dialects:
                if dialect.marks.fullmatch(tag):
                    return dialect, ", ".join(dialect.tags)
        return dialects[0], ", ".join(tag for dialect in dialects for tag in dialect.tags)

    def _tables(self) -> list[_Table]:
        """Fields by tag; blank lines, comments, parameters of sensors that nothing refers to, and what is foreign dropped."""
        tables = {tag: _Table(tag, meaning) for tag, meaning in self.dialect.tags.items()}
        for number, line in enumerate(self.text_lines, start=1):
            fields = self._fields(number)
            if not fields:
                continue
            tag = fields.pop(0)
            table = tables.get(self.dialect.aliases.get(tag, tag))
            if table is None and tag != "FIX":
                skipped = tag.startswith("PARAMS_") or (self.rewritten and tag in SWITCHES)
                if "landmarks" not in self.options.drop and self.landmarks.take(tag, number, line, fields):
                    continue
                if not skipped and not self.foreign.take(tag, number, fields):
                    raise FileError(self.path, self._refusal(tag), line=number)
                continue
            if table is not None and len(fields) != table.meaning.num_fields:
                raise FileError(self.path, _wrong_count(table, len(fields)), line=number)
            num_ids = table.meaning.num_ids if table is not None else len(fields)
            ids, numbers = parsed_fields(self.path, tag, fields, num_ids, line, number)
            if table is not None:
                table.lines.append(number)
                table.ids.extend(ids)
                table.numbers.extend(numbers)
            elif ids:
                self.fix_lines.append((number, ids))
            else:
                raise FileError(self.path, "expected at least one id for FIX, got none", line=number)
        return list(tables.values())

    def _fields(self, number: int) -> list[str]:
        line = self.text_lines[number - 1]
        if number - 1 in self.rewritten:
            return list(self.rewritten[number - 1])
        return (line.partition("#")[0] if "#" in line else line).split()

    def _refusal(self, tag: str) -> str:
        shown = tag if tag.isascii() and tag.isprintable() and len(tag) <= 40 else f"{tag[:40]!a}"
        reason = self.dialect.refused.get(tag)
        if reason is None:
            return f"expected {self.expected} or FIX, got the unknown tag {shown}; remove the line if it does not matter"
        return f"expected {self.expected} or FIX, got {shown}: {reason}"

    def _common_group(self, tables: list[_Table]) -> Group:
        """The one group of all lines."""
        found = sorted((table for table in tables if table.lines), key=lambda table: table.lines[0])
        if found and self.landmarks.first and self.landmarks.group is not found[0].meaning.group:
            number, tag = self.landmarks.first
            message = (
                f"expected lines in {found[0].meaning.group.name} as {found[0].tag} on line {found[0].lines[0]}, got {tag}"
            )
            raise FileError(self.path, message, line=number)
        if not found:
            raise FileError(self.path, f"expected lines with {self.expected}, got none")
        first = found[0]
        for table in found:
            if table.meaning.group is not first.meaning.group:
                message = (
                    f"expected lines in {first.meaning.group.name} as {first.tag} on line {first.lines[0]}, got {table.tag}"
                )
                raise FileError(self.path, message, line=table.lines[0])
        return first.meaning.group

    def _checked_columns(self, table: _Table) -> tuple[IntArray, FloatArray]:
        """Ids, and finite values with quaternions of a length that can be normalised."""
        ids, values = table.columns()
        wrong = np.argwhere(~np.isfinite(values))
        if wrong.size:
            row, column = (int(index) for index in wrong[0])
            text = self._fields(table.lines[row])[1 + table.meaning.num_ids + column]
            raise FileError(self.path, f"expected finite numbers for {table.tag}, got {text[:40]}", line=table.lines[row])
        if self.group.rotation_dim > 1:
            with np.errstate(over="ignore"):
                norms = np.linalg.norm(values[:, self.group.position_dim : self.group.pose_size], axis=1)
            zero = np.flatnonzero(~((norms >= _QUATERNION_NORMS[0]) & (norms <= _QUATERNION_NORMS[1])))
            if zero.size:
                message = f"expected a unit quaternion for {table.tag}, got one of norm {norms[zero[0]]:.3g}"
                raise FileError(self.path, message, line=table.lines[int(zero[0])])
        return ids, values

    def _refuse_repeated_ids(self, ids: IntArray) -> None:
        first_rows, row_groups = np.unique(ids, return_index=True, return_inverse=True)[1:]
        repeated = np.flatnonzero(first_rows[row_groups] != np.arange(len(ids)))
        if repeated.size:
            again, lines = int(repeated[0]), self.vertices.lines
            first = lines[int(first_rows[row_groups[again]])]
            name = node_name(int(ids[again]))
            message = f"expected one {self.vertices.tag} per id, got id {name} again (first on line {first})"
            raise FileError(self.path, message, line=lines[again])

    def _refuse_self_loops(self, ids: IntArray) -> None:
        loops = np.flatnonzero(ids[:, 0] == ids[:, 1])
        if loops.size:
            message = f"expected an edge between two poses, got a self-loop at {node_name(int(ids[loops[0], 0]))}"
            raise FileError(self.path, message, line=self.edges.lines[int(loops[0])])

    def _refuse_edges_to_other_things(self, vertices: IntArray, ids: IntArray) -> None:
        """An edge between poses cannot lead to a vertex that is no pose."""
        landmarks = set(self.landmarks.vertices) - set(vertices.ravel().tolist())  # they may be numbered apart from poses
        others = np.argwhere(np.isin(ids, [*self.foreign.vertices, *landmarks]))
        if others.size:
            row, end = (int(index) for index in others[0])
            message = f"expected an edge between poses, got one to {node_name(int(ids[row, end]))}, which is no pose"
            raise FileError(self.path, message, line=self.edges.lines[row])

    def _refuse_edges_to_nowhere(self, vertex_ids: IntArray, edge_ids: IntArray) -> None:
        """Beside vertex lines, an id without one that a single edge names, and no odometry, is more likely a slip."""
        _, where, counts = np.unique(edge_ids, return_inverse=True, return_counts=True)
        loose = (counts[where] == 1).reshape(edge_ids.shape) & ~np.isin(edge_ids, vertex_ids)
        jump = np.abs(edge_ids[:, 0] - edge_ids[:, 1]) > 1
        nowhere = np.argwhere(loose & jump[:, None])
        if nowhere.size:
            row, end = (int(index) for index in nowhere[0])
            message = (
                f"expected an edge between poses, got one to nowhere: {node_name(int(edge_ids[row, end]))} has no "
                f"{self.vertices.tag} line and no other edge; correct the id or add its line"
            )
            raise FileError(self.path, message, line=self.edges.lines[row])

    def _information(self, entries: FloatArray, order: str) -> FloatArray:
        """Information matrices whose entries stand in the named order."""
        kappa = self.group.tangent_dim
        rows, columns = self.dialect.orders[order][kappa]
        matrices = np.zeros((len(entries), kappa, kappa))
        matrices[:, rows, columns] = entries
        if order in self.dialect.roots:
            with np.errstate(over="ignore", invalid="ignore"):
                return matrices.mT @ matrices
        matrices[:, columns, rows] = entries
        if order in self.dialect.inverses:
            invertible = positive_definite(matrices)
            matrices[invertible] = np.linalg.inv(matrices[invertible])
            matrices[~invertible] = 0.0
            matrices = matrices / 2 + matrices.mT / 2
        return matrices

    def _definite(self, entries: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Information matrices, and which of them are positive definite; others are refused unless they may be dropped."""
        orders = list(self.dialect.orders)
        order = self.options.edge2_order if self.options.edge2_order in orders else orders[0]
        information = self._information(entries, order)
        definite = positive_definite(information)
        if order == orders[0] and not definite.all() and self.landmarks.states_covariances:
            stated = next(iter(self.dialect.inverses), order)
            inverted = self._information(entries, stated)
            if positive_definite(inverted).all():
                self.notes.append(
                    f"took the six numbers of {self.edges.tag} and ODOMETRY lines for covariances, as GTSAM does where "
                    "LANDMARK or BR lines state some"
                )
                return inverted, positive_definite(inverted)
        wrong = np.flatnonzero(~definite)
        if wrong.size == 0:
            return information, definite
        first = information[wrong[0]]
        got = "one that is not finite"
        if np.isfinite(first).all():
            spectrum = np.linalg.eigvalsh(first)
            got = f"eigenvalues from {spectrum[0]:.3g} to {spectrum[-1]:.3g}"
        line = self.edges.lines[int(wrong[0])]
        message = f"expected a positive definite information matrix for {self.edges.tag}, got {got}"
        for other in orders:
            if (
                other not in self.dialect.roots | self.dialect.inverses
                and positive_definite(self._information(entries, other)).all()
            ):
                advice = f'--edge2-order {other} (in Python edge2_order="{other}")'
                message += f"; in the other order of {self.edges.tag} all edges have one: read the file with {advice}"
                message += "".join(f", or {root} where they are square roots" for root in self.dialect.roots)
                raise FileError(self.path, message, line=line)
        many = f"{wrong.size} of {len(definite)} edges, whose information is not positive definite"
        if "indefinite" not in self.options.drop:
            raise FileError(self.path, f"{message}; leave out {many}, with {by_option('indefinite')}", line=line)
        self.notes.append(f"dropped {many} (the first on line {line})")
        return information, definite

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

    def _placed_landmarks(
        self, poses: FloatArray, landmarks: IntArray, observing: IntArray, observed: FloatArray
    ) -> FloatArray:
        """Landmarks as filed, the others where the first observation of each puts them; at the origin without one."""
        known, places = self.landmarks.given(landmarks, self.group)
        seen, first = np.unique(observing[:, 1], return_index=True)
        rows = seen - len(poses)
        composed = self.group.compose(poses[observing[first, 0]], observed[first])
        places[rows] = np.where(known[rows, None], places[rows], composed)
        return places

    def _fixed(self, named: IntArray, ids: IntArray) -> tuple[int, ...]:
        """Indices of the nodes that FIX lines name, in increasing order, without those that were dropped."""
        fixed: set[int] = set()
        for number, wanted in self.fix_lines:
            for value in wanted:
                if value not in named:
                    message = f"expected the id of a pose for FIX, got {node_name(value)}, which no other line names"
                    raise FileError(self.path, message, line=number)
                if value in ids:
                    fixed.add(int(np.flatnonzero(ids == value)[0]))
        return tuple(sorted(fixed))


def _wrong_count(table: _Table, got: int) -> str:
    meaning = table.meaning
    before = meaning.num_ids + meaning.group.pose_size
    if meaning.kind == "edge" and got >= before:
        return f"expected {meaning.num_information} information entries for {table.tag}, got {got - before}"
    ids = "an id" if meaning.num_ids == 1 else f"{meaning.num_ids} ids"
    more = f" and {meaning.num_information} information entries" if meaning.num_information else ""
    return f"expected {ids}, {meaning.group.pose_size} numbers{more} for {table.tag}, got {got} fields"
