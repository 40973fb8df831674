"""Pose graphs: poses, relative pose measurements between them, and their information.

Conventions: poses are `T_world_body`; a measurement on the edge (i, j) is `T_i_j`, made in
the frame of i; its information matrix lives in the tangent at the measured pose, ordered (translation, rotation),
as g2o and GTSAM store it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray, IntArray, ReadOnlyArrays, frozen_floats, frozen_ints, read_only
from topobelief.errors import InvalidGraphError, InvalidInputError
from topobelief.geometry import Group, group_of_size
from topobelief.graph.information import checked_information
from topobelief.graph.topology import Topology
from topobelief.symbols import find_node, node_name
from topobelief.wording import counted

_LARGEST_ID_JUMP = 100  # times the usual step of ids: what lies further on is a tag, a landmark or another robot


@dataclass(frozen=True, eq=False, init=False)
class PoseGraph(ReadOnlyArrays):
    """A pose graph; immutable, its arrays read-only.

    Parameters
    ----------
    poses : shape (n, 3) or (n, 7)
        [x, y, theta] or [x, y, z, qx, qy, qz, qw]; metres, radians. Quaternions are normalised.
    edges : shape (m, 2)
        Indices of poses. The measurement is made in the frame of `edges[:, 0]`. Each of several parallel edges is a measurement
        of its own; self-loops are rejected.
    measurements : shape (m, 3) or (m, 7), or None
        T_i_j. None: what the poses predict.
    information : shape (m, kappa, kappa) or (kappa, kappa)
        Symmetric positive definite, kappa = 3 or 6; one matrix is shared by all edges.
    kinds : shape (n,), optional
        Kind of each node; only "pose" is known.
    ids : shape (n,), optional
        What a file calls the nodes; errors name nodes by it and writers use it. Default: 0 … n - 1.
    fixed : sequence of int, optional
        Indices of poses that a file marks as fixed. Metadata: no quantity depends on it.

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
    ) -> None:
        checked_poses, group = checked_pose_rows(poses, name="poses")
        if len(checked_poses) == 0:
            raise InvalidGraphError("expected at least one pose, got none")
        topology = Topology(len(checked_poses), edges)
        if kinds is not None and np.shape(kinds) != (len(checked_poses),):
            raise InvalidGraphError(f"expected a kind per pose, shape ({len(checked_poses)},), got {np.shape(kinds)}")
        if kinds is not None and not (np.asarray(kinds) == "pose").all():
            raise InvalidGraphError('expected every kind to be "pose"; landmarks are not supported')
        if measurements is None:
            i, j = topology.edges.T
            checked_measurements = read_only(group.between(checked_poses[i], checked_poses[j]))
        else:
            checked_measurements, _ = checked_pose_rows(
                measurements, name="measurements", size=group.pose_size, count=topology.num_edges
            )
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
            "information": checked_information(information, num_edges=topology.num_edges, tangent_dim=group.tangent_dim),
            "ids": checked_ids,
            "fixed": tuple(int(index) for index in fixed),
            "topology": topology,
        }
        for name, value in fields.items():
            object.__setattr__(self, name, value)

    @classmethod
    def _from_checked(
        cls,
        topology: Topology,
        poses: FloatArray,
        measurements: FloatArray,
        information: FloatArray,
        ids: IntArray,
        fixed: tuple[int, ...],
    ) -> PoseGraph:
        """A graph of parts that are known to be valid, because they come from checked graphs and actions."""
        graph = object.__new__(cls)
        fields = {"topology": topology, "edges": topology.edges, "poses": poses, "measurements": measurements}
        for name, value in (fields | {"information": information, "ids": ids, "fixed": fixed}).items():
            object.__setattr__(graph, name, read_only(value) if isinstance(value, np.ndarray) else value)
        return graph

    def __repr__(self) -> str:
        return f"PoseGraph({self.group.name}, {counted(self.num_poses, 'pose')}, {counted(self.num_edges, 'edge')})"

    @property
    def num_poses(self) -> int:
        """n."""
        return len(self.poses)

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
        """Shape (n, k), metres, world frame."""
        return self.group.position(self.poses)

    @property
    def degrees_of_freedom(self) -> int:
        """kappa (m - (n - 1)): measured numbers beyond those that fix the free poses."""
        return self.tangent_dim * (self.num_edges - self.num_poses + 1)

    @cached_property
    def odometry_end(self) -> int | None:
        """Index of the pose where the robot is, as far as the graph says; None where no edge joins a pose to the next.

        The chain of odometry begins at the first pose that an edge joins to the next one, and goes on for as long as an edge
        joins each pose to the next. A pose whose id jumps by more than 100 times the usual step (the median over such edges)
        does not belong to it. A single pose is its own end.
        """
        if self.num_poses == 1:
            return 0
        low, high = np.sort(self.edges, axis=1).T
        joined = np.zeros(self.num_poses - 1, dtype=np.bool_)  # pose k to pose k + 1
        joined[low[high - low == 1]] = True
        if not joined.any():
            return None
        jumps = np.abs(np.diff(self.ids))
        joined &= jumps <= _LARGEST_ID_JUMP * np.median(jumps[joined])
        begin = int(np.argmax(joined))
        breaks = np.flatnonzero(~joined[begin:])
        return begin + int(breaks[0]) if breaks.size else self.num_poses - 1

    @cached_property
    def chi2(self) -> float:
        """Sum of squared whitened residuals, r^T Omega r, at these poses."""
        i, j = self.edges.T
        predicted = self.group.between(self.poses[i], self.poses[j])
        residuals = self.group.residual(self.measurements, predicted)
        return float(np.einsum("ea,eab,eb->", residuals, self.information, residuals))

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
        return PoseGraph(poses, self.edges, self.measurements, self.information, ids=self.ids, fixed=self.fixed)


def require_pose_graph(graph: object) -> None:
    """Raise `InvalidInputError` for what is no pose graph; of objects of GTSAM, say what makes one of them."""
    if not isinstance(graph, PoseGraph):
        advice = (
            "; from_gtsam makes one of factors and values, or of an ISAM2" if type(graph).__module__.startswith("gtsam") else ""
        )
        raise InvalidInputError(f"expected a PoseGraph, got {type(graph).__name__}{advice}")


def checked_pose_rows(
    values: ArrayLike, *, name: str, size: int | None = None, count: int | None = None
) -> tuple[FloatArray, Group]:
    """Poses as rows in canonical representation, read-only, and their group.

    Raises
    ------
    InvalidGraphError
        Where a row is not finite, the shape is wrong, or a quaternion is zero.
    """
    array = frozen_floats(values, name=name)
    if array.size == 0 and size is not None:
        array = array.reshape(0, size)
    expected = f"({'n' if count is None else count}, {'3 or 7' if size is None else size})"
    if array.ndim != 2 or (size is not None and array.shape[1] != size) or (count is not None and len(array) != count):
        raise InvalidGraphError(f"expected {name} of shape {expected}, got {array.shape}")
    if array.shape[1] not in (3, 7):
        raise InvalidGraphError(f"expected {name} of shape {expected}, got {array.shape}")
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if bad.size:
        raise InvalidGraphError(f"expected finite {name}, got nan or inf in row {bad[0]}")
    group = group_of_size(array.shape[1])
    if group.pose_size == 7:
        zero = np.flatnonzero(np.linalg.norm(array[:, 3:], axis=1) < 1e-6)
        if zero.size:
            raise InvalidGraphError(f"expected unit quaternions in {name}, got a zero one in row {zero[0]}")
    return read_only(group.normalized(array)), group
