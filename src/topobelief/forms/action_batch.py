"""Many actions as one: their new poses and edges stacked, so that rows and signature weights are computed for all at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.forms.of_topology import weights_of
from topobelief.graph.action import Action, landmark_ends
from topobelief.graph.fisher import FisherRows, rows_between
from topobelief.graph.information import of_positions
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg.extensions import Extensions


@dataclass(frozen=True)
class ActionBatch:
    """Checked actions on one prior.

    Parameters
    ----------
    graph
        The prior, n poses.
    actions
        K of them.
    """

    graph: PoseGraph
    actions: tuple[Action, ...]

    @property
    def count(self) -> int:
        """K."""
        return len(self.actions)

    @cached_property
    def num_new(self) -> IntArray:
        """New poses of each action, shape (K,)."""
        return np.array([action.num_new_poses for action in self.actions])

    @cached_property
    def num_edges(self) -> IntArray:
        """Edges of each action, shape (K,)."""
        return np.array([len(action.edges) for action in self.actions])

    @cached_property
    def num_closures(self) -> IntArray:
        """Edges of each action beyond the one that attaches each new pose, observations among them, shape (K,)."""
        return self.num_edges - self.num_new

    @cached_property
    def edge_start(self) -> IntArray:
        """Where the edges of each action begin, shape (K + 1,)."""
        return np.concatenate([[0], np.cumsum(self.num_edges)])

    @cached_property
    def edges(self) -> IntArray:
        """All edges as the actions have them, shape (number of edges, 2)."""
        return np.concatenate([action.edges for action in self.actions])

    @cached_property
    def extensions(self) -> Extensions:
        """The same edges, with new poses counted through the batch."""
        n, node_start = self.graph.num_nodes, np.concatenate([[0], np.cumsum(self.num_new)])
        shift = np.repeat(node_start[:-1], self.num_edges)[:, None]
        edges = np.where(self.edges >= n, self.edges + shift, self.edges)
        stems = None if self.marks is None else ~self.marks[0]
        return Extensions.of(n, edges, self.edge_start, node_start, stems)

    @cached_property
    def information(self) -> FloatArray:
        """Information matrices of all edges, (number of edges, kappa, kappa); one that all share takes the place of one."""
        kappa = self.graph.tangent_dim
        matrices = [action.information for action in self.actions if len(action.edges)]
        if not matrices:
            return np.zeros((0, kappa, kappa))  # actions without edges need not know kappa
        firsts = np.stack([each[0] for each in matrices])
        if all(each.strides[0] == 0 for each in matrices) and (firsts == firsts[0]).all():
            together = np.broadcast_to(firsts[0], (int(self.num_edges.sum()), kappa, kappa))
        else:
            together = np.concatenate(matrices)
        return together if self.marks is None else of_positions(together, self.marks[0])

    @cached_property
    def rows(self) -> FisherRows:
        """Whitened rows of all edges."""
        poses = np.concatenate([self.graph.poses, *(action.poses for action in self.actions if action.num_new_poses)])
        marks = None
        if self.graph.num_landmarks:
            new = np.zeros(len(poses) - self.graph.num_nodes, dtype=np.bool_)
            marks = np.concatenate([self.graph.is_landmark, new]), np.zeros(len(self.edges), dtype=np.bool_)
        return rows_between(self.graph.group, poses, self.extensions.edges, self.information, marks)

    @cached_property
    def marks(self) -> tuple[BoolArray, BoolArray | None] | None:
        """Which edges lead to landmarks, and that none carries a pad, for the prior's do; None without landmarks."""
        if not self.graph.num_landmarks:
            return None
        return landmark_ends(self.graph, self.edges), None

    @cached_property
    def scalar_weights(self) -> tuple[FloatArray, FloatArray]:
        """(w_p, w_r) of all edges."""
        return weights_of(self.information)

    def sums(self, values: FloatArray) -> FloatArray:
        """Sum over each action's edges, shape (K,)."""
        total = np.concatenate([[0.0], np.cumsum(values)])
        return total[self.edge_start[1:]] - total[self.edge_start[:-1]]
