"""Random graphs with landmarks, actions on them, and their matrices without the padding that the package gives them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

import topobelief as tb
from graphs import Noise, Session, noises, random_action, random_pose_graph
from references import LOG_2_PI_E
from topobelief.graph.fisher import fisher_rows


def with_landmarks(rng: np.random.Generator, graph: tb.PoseGraph, noise: Noise, num_landmarks: int) -> tb.PoseGraph:
    """The graph with landmarks that poses see, in any order of nodes; one in three by several readings of range and bearing."""
    group, n, k = graph.group, graph.num_poses, graph.group.position_dim
    rows, edges, readings = [], [], []
    for landmark in range(num_landmarks):
        near = graph.positions[rng.integers(n)]
        row = np.array(group.identity())
        row[:k] = near + noise.length * rng.normal(size=k)
        rows.append(row)
        seen = rng.integers(1, 4)
        edges += [(int(rng.integers(n)), n + landmark) for _ in range(seen)]
        readings += rng.choice(["position", "bearing_range"], size=seen).tolist()
    information = np.concatenate([graph.information, noise.draw(rng, len(edges))])
    if noise.kind in ("equal", "isotropic"):
        readings = ["position"] * len(edges)
    whole = tb.PoseGraph(
        np.concatenate([graph.poses, np.array(rows).reshape(-1, group.pose_size)]),
        np.concatenate([graph.edges, np.array(edges, dtype=np.int64).reshape(-1, 2)]),
        None,
        information,
        ["pose"] * n + ["landmark"] * num_landmarks,
        readings=["pose"] * graph.num_edges + readings,
    )
    return shuffled(rng, whole)


def shuffled(rng: np.random.Generator, graph: tb.PoseGraph) -> tb.PoseGraph:
    """The same graph with nodes and edges in another order."""
    order, edge_order = rng.permutation(graph.num_nodes), rng.permutation(graph.num_edges)
    place = np.argsort(order)
    return tb.PoseGraph(
        graph.poses[order],
        place[graph.edges[edge_order]],
        graph.measurements[edge_order],
        graph.noise[edge_order],
        graph.kinds[order],
        readings=graph.readings[edge_order],
    )


def observing_action(rng: np.random.Generator, graph: tb.PoseGraph, noise: Noise) -> tb.Action:
    """A random action between poses that also sees landmarks, from old and new poses."""
    poses_alone = graph.part(graph.pose_indices)
    plain = random_action(rng, poses_alone, noise)
    n, num_old = graph.num_nodes, poses_alone.num_poses
    node = np.concatenate([graph.pose_indices, n + np.arange(plain.num_new_poses)])
    landmarks = np.flatnonzero(graph.is_landmark)
    count = int(rng.integers(4)) if len(landmarks) else 0
    seen = np.stack([rng.choice(node, count), rng.choice(landmarks, count)], axis=1) if count else np.zeros((0, 2), int)
    edges = np.concatenate([node[plain.edges], seen])
    between = plain.information if len(plain.edges) else noise.draw(rng, 0)
    information = np.concatenate([between, noise.draw(rng, count)]) if len(edges) else noise.draw(rng, 1)[0]
    order = rng.permutation(len(edges))
    assert num_old == len(graph.pose_indices)
    return tb.Action(plain.poses, edges[order], information[order] if len(edges) else information, label=plain.label)


@st.composite
def landmark_sessions(draw, *, max_poses: int = 6, max_landmarks: int = 4, max_actions: int = 4, **noise) -> Session:
    """A prior with landmarks and actions that see some of them; keywords as for `noises`."""
    drawn = draw(noises(**noise))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    poses = random_pose_graph(rng, drawn, draw(st.integers(1, max_poses)), draw(st.integers(0, 5)))
    graph = with_landmarks(rng, poses, drawn, draw(st.integers(1, max_landmarks)))
    actions = [observing_action(rng, graph, drawn) for _ in range(draw(st.integers(1, max_actions)))]
    return Session(graph, tuple(actions))


@dataclass(frozen=True)
class DenseInformation:
    """The information matrix of the variables that exist: landmarks have no rotation, and nothing is padded."""

    matrix: NDArray
    node: NDArray  # of each variable
    is_position: NDArray

    @staticmethod
    def of(graph: tb.PoseGraph) -> DenseInformation:
        form = replace(fisher_rows(graph), observing=None, pads=None, weights=None).joint()
        m, r, b = form.rows_i.shape
        rows = np.zeros((m, r, graph.num_nodes, b))
        rows[np.arange(m), :, graph.edges[:, 0]] = form.rows_i
        rows[np.arange(m), :, graph.edges[:, 1]] = form.rows_j
        flat = rows.reshape(m * r, graph.num_nodes * b)
        node, variable = np.divmod(np.arange(graph.num_nodes * b), b)
        is_position = variable < graph.group.position_dim
        exists = is_position | ~graph.is_landmark[node]
        return DenseInformation((flat.T @ flat)[np.ix_(exists, exists)], node[exists], is_position[exists])

    def log_det(self, *, held) -> float:
        free = ~np.isin(self.node, held)
        return log_det(self.matrix[np.ix_(free, free)])

    def dimension(self, *, held) -> int:
        return int(np.count_nonzero(~np.isin(self.node, held)))

    def entropy(self, *, held) -> float:
        return self.dimension(held=held) / 2 * LOG_2_PI_E - self.log_det(held=held) / 2

    def marginal_entropy(self, focus, *, anchor: int) -> float:
        """Of some nodes but the anchor."""
        free = self.node != anchor
        covariance = np.linalg.inv(self.matrix[np.ix_(free, free)])
        wanted = np.isin(self.node[free], list(set(focus) - {anchor}))
        return wanted.sum() / 2 * LOG_2_PI_E + log_det(covariance[np.ix_(wanted, wanted)]) / 2


def log_det(matrix: NDArray) -> float:
    if len(matrix) == 0:
        return 0.0
    scale = np.sqrt(np.diagonal(matrix))
    return float(np.linalg.slogdet(matrix / scale[:, None] / scale)[1] + 2 * np.log(scale).sum())
