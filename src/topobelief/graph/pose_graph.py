"""Pose graphs: poses, relative pose measurements between them, and their information; landmarks that poses observe.

Conventions: poses are `T_world_body`; a measurement on the edge (i, j) is `T_i_j`, made in
the frame of i; its information matrix lives in the tangent at the measured pose, ordered (translation, rotation),
as g2o and GTSAM store it. A landmark is a point; an observation of it is made and has its information in the frame of the pose.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from topobelief.arrays import BoolArray, FloatArray, IntArray, ReadOnlyArrays, frozen_ints, read_only
from topobelief.errors import InvalidGraphError, InvalidInputError
from topobelief.geometry import Group, group_of_size
from topobelief.graph.information import checked_information
from topobelief.graph.observations import (
    ReadingCodes,
    checked_readings,
    information_at,
    names_of,
    numbers_read,
    observations_by_kind,
    observed_residuals,
    seen_positions,
    within_readings,
)
from topobelief.graph.pose_rows import checked_pose_rows, without_rotations
from topobelief.graph.readings import POSITION, RELATIVE_POSE
from topobelief.graph.topology import Topology
from topobelief.graph.variable_kinds import LANDMARK, POSE, first_edges_of, points_among, require_observers
from topobelief.symbols import find_node, node_name
from topobelief.wording import counted

_LARGEST_ID_JUMP = 100  # times the usual step of ids: what lies further on is a tag, a landmark or another robot


@dataclass(frozen=True, eq=False, init=False)
class PoseGraph(ReadOnlyArrays):
    """A pose graph; immutable, its arrays read-only.

    Parameters
    ----------
    poses : shape (n, 3) or (n, 7)
        [x, y, theta] or [x, y, z, qx, qy, qz, qw]; metres, radians. Quaternions are normalised. Of a landmark the position
        counts; its rotation is taken for none.
    edges : shape (m, 2)
        Indices of nodes. The measurement is made in the frame of `edges[:, 0]`, a pose. Each of several parallel edges is a
        measurement of its own; self-loops are rejected.
    measurements : shape (m, 3) or (m, 7), or None
        T_i_j; of a landmark its position in the frame of i (see `readings`). None: what the poses predict.
    information : shape (m, kappa, kappa) or (kappa, kappa)
        Symmetric positive definite, kappa = 3 or 6; one matrix is shared by all edges. Of an observation of a landmark the
        first rows and columns count, as many as it reads numbers.
    kinds : shape (n,), optional
        Kind of each node, "pose" or "landmark". Default: all are poses.
    ids : shape (n,), optional
        What a file calls the nodes; errors name nodes by it and writers use it. Default: 0 … n - 1.
    fixed : sequence of int, optional
        Indices of poses that a file marks as fixed. Metadata: no quantity depends on it.
    readings : shape (m,), optional
        What each edge reads: "pose" between poses; of a landmark its "position" (the default), "bearing_range", "range" or
        "bearing". The measurement of the latter is stored as a position: range times direction, direction, or range along x.

    Attributes
    ----------
    information : shape (m, kappa, kappa)
        At these poses, in the tangent of positions and rotations.
    noise : shape (m, kappa, kappa)
        The information as it was given, in the numbers that are read.

    Raises
    ------
    InvalidGraphError
        Names the array, pose or edge to blame.

    Examples
    --------
    >>> graph = PoseGraph([[0, 0, 0], [1, 0, 0]], [(0, 1)], None, np.eye(3))
    >>> graph.num_poses, graph.tangent_dim, graph.measurements.tolist()
    (2, 3, [[1.0, 0.0, 0.0]])
    """

    poses: FloatArray
    edges: IntArray
    measurements: FloatArray
    information: FloatArray
    ids: IntArray
    fixed: tuple[int, ...]
    topology: Topology
    is_landmark: BoolArray
    reading_codes: ReadingCodes
    noise: FloatArray

    def __init__(
        self,
        poses: ArrayLike,
        edges: ArrayLike,
        measurements: ArrayLike | None,
        information: ArrayLike,
        kinds: ArrayLike | None = None,
        *,
        ids: ArrayLike | None = None,
        fixed: tuple[int, ...] = (),
        readings: ArrayLike | None = None,
    ) -> None:
        checked_poses, group = checked_pose_rows(poses, name="poses")
        if len(checked_poses) == 0:
            raise InvalidGraphError("expected at least one pose, got none")
        topology = Topology(len(checked_poses), edges)
        is_landmark = points_among(kinds, len(checked_poses))
        checked_poses = without_rotations(group, checked_poses, is_landmark)
        require_observers(is_landmark, topology.edges)
        observing = is_landmark[topology.edges[:, 1]]
        if measurements is None:
            i, j = topology.edges.T
            checked_measurements = read_only(group.between(checked_poses[i], checked_poses[j]))
        else:
            checked_measurements, _ = checked_pose_rows(
                measurements, name="measurements", size=group.pose_size, count=topology.num_edges
            )
        checked_measurements = without_rotations(group, checked_measurements, observing)
        checked, noise = checked_readings(readings, observing), information
        if observing.any():
            noise = within_readings(noise, checked, group)
        noise = checked_information(noise, num_edges=topology.num_edges, tangent_dim=group.tangent_dim, points=observing)
        checked_ids = frozen_ints(np.arange(len(checked_poses)) if ids is None else ids, name="ids")
        if checked_ids.shape != (len(checked_poses),) or len(np.unique(checked_ids)) != len(checked_ids):
            raise InvalidGraphError(f"expected {len(checked_poses)} different ids, got shape {checked_ids.shape}")
        for index in fixed:
            if not 0 <= index < len(checked_poses):
                raise InvalidGraphError(f"expected fixed poses from 0 to {len(checked_poses) - 1}, got {index}")
        fields = {
            "poses": checked_poses,
            "edges": topology.edges,
            "measurements": checked_measurements,
            "information": information_at(group, checked_poses, topology.edges, noise, checked, checked_ids),
            "ids": checked_ids,
            "fixed": tuple(int(index) for index in fixed),
            "topology": topology,
            "is_landmark": is_landmark,
            "reading_codes": checked,
            "noise": noise,
        }
        for name, value in fields.items():
            object.__setattr__(self, name, value)

    def _with_more(
        self, poses: FloatArray, edges: IntArray, measurements: FloatArray, information: FloatArray, ids: IntArray
    ) -> PoseGraph:
        """The graph with more poses and edges that are known to be valid, because they come from a checked action.

        Parameters
        ----------
        poses : shape (L, pose_size)
        edges, measurements, information
            Of the new edges; observations are of positions.
        ids : shape (L,)
        """
        graph = object.__new__(PoseGraph)
        everything = np.concatenate([self.poses, poses]) if len(poses) else self.poses
        topology = Topology(len(everything), np.concatenate([self.edges, edges]))
        noise, whole = np.concatenate([self.noise, information]), self.information
        is_landmark = np.concatenate([self.is_landmark, np.zeros(len(poses), dtype=np.bool_)])
        fields = {
            "poses": everything,
            "edges": topology.edges,
            "measurements": np.concatenate([self.measurements, measurements]),
            "information": noise if whole is self.noise else np.concatenate([whole, information]),
            "ids": np.concatenate([self.ids, ids]),
            "fixed": self.fixed,
            "topology": topology,
            "is_landmark": is_landmark,
            "reading_codes": np.concatenate([self.reading_codes, is_landmark[edges[:, 1]].astype(np.int8)]),
            "noise": noise,
        }
        for name, value in fields.items():
            object.__setattr__(graph, name, read_only(value) if isinstance(value, np.ndarray) else value)
        return graph

    def __repr__(self) -> str:
        landmarks = f"{counted(self.num_landmarks, 'landmark')}, " if self.num_landmarks else ""
        return f"PoseGraph({self.group.name}, {counted(self.num_poses, 'pose')}, {landmarks}{counted(self.num_edges, 'edge')})"

    @property
    def num_nodes(self) -> int:
        """Poses and landmarks."""
        return len(self.poses)

    @property
    def num_poses(self) -> int:
        """n, landmarks not counted."""
        return len(self.poses) - self.num_landmarks

    @cached_property
    def num_landmarks(self) -> int:
        """Nodes that are landmarks."""
        return int(np.count_nonzero(self.is_landmark))

    @property
    def kinds(self) -> NDArray[np.str_]:
        """Kind of each node, shape (num_nodes,)."""
        return np.where(self.is_landmark, LANDMARK.name, POSE.name)

    @property
    def readings(self) -> NDArray[np.str_]:
        """What each edge reads, shape (m,)."""
        return names_of(self.reading_codes)

    @cached_property
    def pose_indices(self) -> IntArray:
        """Indices of the nodes that are poses, ascending."""
        return read_only(np.flatnonzero(~self.is_landmark).astype(np.int64))

    @cached_property
    def poses_alone(self) -> PoseGraph:
        """The poses and the edges between them, in their order; the graph itself where it has no landmarks."""
        return self.part(self.pose_indices) if self.num_landmarks else self

    @property
    def last_pose(self) -> int:
        """Index of the last node that is a pose."""
        return int(self.pose_indices[-1])

    @cached_property
    def carries_pad(self) -> BoolArray:
        """Which edges carry the pad of a landmark (`variable_kinds`), shape (m,)."""
        return read_only(first_edges_of(self.is_landmark, self.edges[:, 1]))

    @property
    def num_edges(self) -> int:
        """m, parallel edges counted."""
        return len(self.edges)

    @property
    def group(self) -> Group:
        """SE(2) or SE(3)."""
        return group_of_size(self.poses.shape[1])

    @property
    def tangent_dim(self) -> int:
        """kappa: 3 in SE(2), 6 in SE(3)."""
        return self.group.tangent_dim

    @property
    def positions(self) -> FloatArray:
        """Shape (num_nodes, k), metres, world frame."""
        return self.group.position(self.poses)

    @property
    def degrees_of_freedom(self) -> int:
        """Measured numbers beyond those that fix the free poses and landmarks: kappa (m - (n - 1)) without landmarks."""
        split = self.group.position_dim, self.group.rotation_dim
        free = POSE.dimension(*split) * (self.num_poses - 1) + LANDMARK.dimension(*split) * self.num_landmarks
        return numbers_read(self.reading_codes, self.group) - free

    @cached_property
    def odometry_end(self) -> int | None:
        """Index of the pose where the robot is, as far as the graph says; None where no edge joins a pose to the next.

        The chain of odometry begins at the first pose that an edge joins to the next one, and goes on for as long as an edge
        joins each pose to the next. A pose whose id jumps by more than 100 times the usual step (the median over such edges)
        does not belong to it. A single pose is its own end.
        """
        poses = self.pose_indices
        if len(poses) == 1:
            return int(poses[0])
        place = np.full(self.num_nodes, -2)
        place[poses] = np.arange(len(poses))
        low, high = np.sort(place[self.edges[self.reading_codes == 0]], axis=1).T
        joined = np.zeros(len(poses) - 1, dtype=np.bool_)  # pose k to pose k + 1
        joined[low[high - low == 1]] = True
        if not joined.any():
            return None
        jumps = np.abs(np.diff(self.ids[poses]))
        joined &= jumps <= _LARGEST_ID_JUMP * np.median(jumps[joined])
        begin = int(np.argmax(joined))
        breaks = np.flatnonzero(~joined[begin:])
        return int(poses[begin + int(breaks[0])]) if breaks.size else self.last_pose

    @cached_property
    def chi2(self) -> float:
        """Sum of squared whitened residuals, r^T Omega r, at these poses."""
        i, j = self.edges.T
        predicted = self.group.between(self.poses[i], self.poses[j])
        residuals = self.group.residual(self.measurements, predicted)
        if self.num_landmarks:
            observing, k = self.reading_codes > 0, self.group.position_dim
            residuals[observing] = 0.0
            residuals[observing, :k] = observed_residuals(
                self.measurements[observing, :k],
                seen_positions(self.group, self.poses, self.edges[observing]),
                self.reading_codes[observing],
            )
        return float(np.einsum("ea,eab,eb->", residuals, self.noise, residuals))

    def label(self, index: int) -> str:
        """What a person calls the pose of this index: x3 for a symbol of GTSAM, else its id.

        Examples
        --------
        >>> graph = PoseGraph([[0, 0, 0], [1, 0, 0]], [(0, 1)], None, np.eye(3), ids=[(ord("x") << 56) + 3, 7])
        >>> graph.label(0), graph.label(1), graph.index("x3"), graph.index(7)
        ('x3', '7', 0, 1)
        """
        return node_name(int(self.ids[index]))

    def index(self, label: int | str) -> int:
        """Index of the pose with this id or label.

        Raises
        ------
        InvalidInputError
            If there is none.
        """
        found = find_node(self.ids.tolist(), label)
        if found is None:
            raise InvalidInputError(
                f"expected the id or label of a pose, as {self.label(0)} or {self.label(-1)}, got {label!r}"
            )
        return found

    def with_poses(self, poses: ArrayLike) -> PoseGraph:
        """The same measurements at other poses."""
        return PoseGraph(
            poses,
            self.edges,
            self.measurements,
            self.noise,
            self.kinds if self.num_landmarks else None,
            ids=self.ids,
            fixed=self.fixed,
            readings=self.readings if self.num_landmarks else None,
        )

    def with_positions(self) -> PoseGraph:
        """The same graph with readings of bearings and ranges taken for positions, to first order at these poses.

        Entropies at these poses, chi^2 and its gradient stay as they are. A range alone says something of one direction, so
        that the information of such a position is singular.
        """
        measurements, k = self.measurements.copy(), self.group.position_dim
        for kind, which in observations_by_kind(self.reading_codes):
            if not kind.linear:
                seen = seen_positions(self.group, self.poses, self.edges[which])
                residuals = kind.residual(measurements[which, :k], seen)
                back = np.linalg.pinv(kind.jacobian(seen))
                measurements[which, :k] = seen - (back @ residuals[:, :, None])[:, :, 0]
        readings = np.where(self.reading_codes > 0, POSITION.name, RELATIVE_POSE)
        return PoseGraph(
            self.poses,
            self.edges,
            measurements,
            self.information,
            self.kinds,
            ids=self.ids,
            fixed=self.fixed,
            readings=readings,
        )

    def part(self, nodes: IntArray) -> PoseGraph:
        """Some nodes and the edges among them; ids, the order of poses and of edges, and fixed poses are kept.

        Parameters
        ----------
        nodes
            Indices in increasing order.
        """
        inside = np.isin(self.edges, nodes).all(axis=1)
        return PoseGraph(
            self.poses[nodes],
            np.searchsorted(nodes, self.edges[inside]),
            self.measurements[inside],
            self.noise[inside] if inside.any() else np.eye(self.tangent_dim),
            self.kinds[nodes] if self.num_landmarks else None,
            ids=self.ids[nodes],
            fixed=tuple(int(np.searchsorted(nodes, index)) for index in self.fixed if index in nodes),
            readings=self.readings[inside] if self.num_landmarks else None,
        )


def require_pose_graph(graph: object) -> None:
    """Raise `InvalidInputError` for what is no pose graph; of objects of GTSAM, say what makes one of them."""
    if not isinstance(graph, PoseGraph):
        advice = (
            "; from_gtsam makes one of factors and values, or of an ISAM2" if type(graph).__module__.startswith("gtsam") else ""
        )
        raise InvalidInputError(f"expected a PoseGraph, got {type(graph).__name__}{advice}")
