"""Graphs that tests share: named ones with closed-form answers, and Hypothesis strategies for random ones.

Random pose graphs are drawn by a few numbers that shrink (sizes, noise, xi times the edge length) and a seed for the rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from topobelief.geometry import SE2_GROUP, SE3_GROUP, Group
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.topology import Topology

NOISES = ("equal", "isotropic", "full")
"""One block-isotropic Omega on all edges; block-isotropic but different on each edge; any positive definite matrices."""


# Named graphs -----------------------------------------------------------------------------------------------------------


def path(n: int) -> Topology:
    return Topology(n, [(i, i + 1) for i in range(n - 1)])


def cycle(n: int) -> Topology:
    return Topology(n, [(i, (i + 1) % n) for i in range(n)])


def star(n: int) -> Topology:
    return Topology(n, [(0, i) for i in range(1, n)])


def complete(n: int) -> Topology:
    return Topology(n, [(i, j) for i in range(n) for j in range(i)])


def complete_bipartite(a: int, b: int) -> Topology:
    return Topology(a + b, [(i, a + j) for i in range(a) for j in range(b)])


def petersen() -> Topology:
    outer = [(i, (i + 1) % 5) for i in range(5)]
    spokes = [(i, i + 5) for i in range(5)]
    inner = [(5 + i, 5 + (i + 2) % 5) for i in range(5)]
    return Topology(10, outer + spokes + inner)


def wheel(n: int) -> Topology:
    """A hub and a rim of n nodes."""
    return Topology(n + 1, [(0, i + 1) for i in range(n)] + [(i + 1, (i + 1) % n + 1) for i in range(n)])


def ladder(n: int) -> Topology:
    """Two paths of n nodes and the n rungs between them."""
    rails = [(i, i + 1) for i in range(n - 1)] + [(n + i, n + i + 1) for i in range(n - 1)]
    return Topology(2 * n, rails + [(i, n + i) for i in range(n)])


def bundle(multiplicity: int) -> Topology:
    """Two nodes and parallel edges in both directions."""
    return Topology(2, [(i % 2, 1 - i % 2) for i in range(multiplicity)])


def _golden_trees(n: int) -> int:
    """Lucas number L_2n less 2: the spanning trees of a wheel."""
    a, b = 2, 1
    for _ in range(2 * n):
        a, b = b, a + b
    return a - 2


def _ladder_trees(n: int) -> int:
    """1, 4, 15, 56, …: each rung makes four times the last less the one before."""
    a, b = 0, 1
    for _ in range(n - 1):
        a, b = b, 4 * b - a
    return b


SPANNING_TREES: dict[str, tuple[Topology, int]] = {
    "one node": (Topology(1, []), 1),
    "path of 7": (path(7), 1),
    "path of 2500": (path(2500), 1),
    "star of 9": (star(9), 1),
    "cycle of 3": (cycle(3), 3),
    "cycle of 400": (cycle(400), 400),
    "K_2": (complete(2), 1),
    "K_4": (complete(4), 4**2),
    "K_12": (complete(12), 12**10),
    "K_60": (complete(60), 60**58),
    "K_1,5": (complete_bipartite(1, 5), 1),
    "K_3,4": (complete_bipartite(3, 4), 3**3 * 4**2),
    "K_20,9": (complete_bipartite(20, 9), 20**8 * 9**19),
    "Petersen": (petersen(), 2000),
    "wheel of 3": (wheel(3), 16),
    "wheel of 8": (wheel(8), _golden_trees(8)),
    "ladder of 30": (ladder(30), _ladder_trees(30)),
    "bundle of 5": (bundle(5), 5),
}
"""Name -> graph and its number of spanning trees, an integer of any size."""


# Random topologies ------------------------------------------------------------------------------------------------------


@st.composite
def connected_topologies(draw, *, max_nodes: int = 9, max_extra: int = 10, min_nodes: int = 1) -> Topology:
    """A random tree, more edges on top (parallel ones among them), shuffled, turned and relabelled."""
    num_nodes = draw(st.integers(min_nodes, max_nodes))
    num_extra = draw(st.integers(0, max_extra)) if num_nodes > 1 else 0
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return Topology(num_nodes, _random_edges(rng, num_nodes, num_extra))


def _random_edges(rng: np.random.Generator, num_nodes: int, num_extra: int) -> NDArray:
    edges = [(int(rng.integers(i)), i) for i in range(1, num_nodes)]
    for _ in range(num_extra):
        if rng.random() < 0.2:
            edges.append(edges[rng.integers(len(edges))])
        else:
            edges.append(tuple(rng.choice(num_nodes, size=2, replace=False).tolist()))
    array = np.array(edges, dtype=np.int64).reshape(-1, 2)
    turned = rng.random(len(array)) < 0.5
    array[turned] = array[turned][:, ::-1]
    return rng.permutation(num_nodes)[rng.permutation(array)]


def relabelled(graph: PoseGraph, permutation: NDArray) -> PoseGraph:
    """Pose i is called permutation[i] and stands in that row."""
    poses = np.empty_like(graph.poses)
    poses[permutation] = graph.poses
    return PoseGraph(poses, permutation[graph.edges], graph.measurements, graph.information)


# Random pose graphs -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Noise:
    """Where a graph's information matrices are drawn from.

    Parameters
    ----------
    group
    kind
        One of `NOISES`.
    position_weight
        Information of a position, 1/m^2.
    ratio
        xi times the typical edge length.
    length
        Typical edge length, m.
    spread
        Decades over which block-isotropic weights, and eigenvalues of full matrices, differ.
    """

    group: Group
    kind: str
    position_weight: float
    ratio: float
    length: float
    spread: float = 2.0

    def draw(self, rng: np.random.Generator, count: int) -> NDArray:
        """Information matrices, shape (count, kappa, kappa)."""
        k, q = self.group.position_dim, self.group.rotation_dim
        rotation_weight = self.position_weight * (self.length / self.ratio) ** 2  # xi^2 = w_p / w_r
        scale = np.sqrt(np.r_[np.full(k, self.position_weight), np.full(q, rotation_weight)])
        if self.kind == "equal":
            factors = np.tile(np.eye(k + q), (count, 1, 1))
        elif self.kind == "isotropic":
            decades = rng.uniform(-self.spread / 2, self.spread / 2, size=(count, 2))
            factors = (
                np.stack([np.diag(np.repeat(10.0**pair, [k, q])) for pair in decades]) if count else np.zeros((0, k + q, k + q))
            )
        else:
            bases = np.linalg.qr(rng.normal(size=(count, k + q, k + q)))[0]
            eigenvalues = 10.0 ** rng.uniform(-self.spread / 2, self.spread / 2, size=(count, 1, k + q))
            factors = (bases * eigenvalues) @ bases.transpose(0, 2, 1)
        information = factors * (scale[:, None] * scale)
        return (information + information.transpose(0, 2, 1)) / 2


def random_poses(rng: np.random.Generator, group: Group, edges: NDArray, num_poses: int, length: float) -> NDArray:
    """Poses any way up, such that edges are about as long as `length`: a walk over the graph from its first edge."""
    k = group.position_dim
    positions = np.zeros((num_poses, k))
    placed = {int(edges[0, 0]) if len(edges) else 0}
    while len(placed) < num_poses:
        for i, j in edges.tolist():
            if (i in placed) != (j in placed):
                known, new = (i, j) if i in placed else (j, i)
                positions[new] = positions[known] + length * rng.normal(size=k) / math.sqrt(k)
                placed.add(new)
    if group is SE2_GROUP:
        return np.column_stack([positions, rng.uniform(-math.pi, math.pi, num_poses)])
    return np.column_stack([positions, rng.normal(size=(num_poses, 4))])


@st.composite
def noises(
    draw, *, kinds: tuple[str, ...] = NOISES, groups: tuple[Group, ...] = (SE2_GROUP, SE3_GROUP), log_ratio=(-3.0, 2.0)
) -> Noise:
    """Noise with xi times the edge length from 10^log_ratio[0] to 10^log_ratio[1]."""
    return Noise(
        group=draw(st.sampled_from(groups)),
        kind=draw(st.sampled_from(kinds)),
        position_weight=10.0 ** draw(st.integers(-2, 4)),
        ratio=10.0 ** draw(st.floats(*log_ratio)),
        length=10.0 ** draw(st.integers(-1, 2)),
    )


def random_pose_graph(rng: np.random.Generator, noise: Noise, num_poses: int, num_extra: int) -> PoseGraph:
    """A connected pose graph with `num_extra` edges beyond a tree."""
    edges = _random_edges(rng, num_poses, num_extra if num_poses > 1 else 0)
    poses = random_poses(rng, noise.group, edges, num_poses, noise.length)
    information = np.tile(noise.draw(rng, 1), (len(edges), 1, 1)) if noise.kind == "equal" else noise.draw(rng, len(edges))
    return PoseGraph(poses, edges, None, information)


@st.composite
def pose_graphs(draw, *, max_poses: int = 8, max_extra: int = 8, min_poses: int = 1, **noise) -> PoseGraph:
    """A connected pose graph; keywords as for `noises`."""
    drawn = draw(noises(**noise))
    num_poses = draw(st.integers(min_poses, max_poses))
    num_extra = draw(st.integers(0, max_extra))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return random_pose_graph(rng, drawn, num_poses, num_extra)


# Random actions ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Session:
    """A prior and actions on it."""

    graph: PoseGraph
    actions: tuple[Action, ...]


def random_action(
    rng: np.random.Generator, graph: PoseGraph, noise: Noise, *, max_new: int = 5, max_closures: int = 5
) -> Action:
    """New poses hung anywhere, in chains, branches or several chains, and any closures: parallel, turned, among new poses."""
    n, num_new, num_closures = graph.num_poses, int(rng.integers(max_new + 1)), int(rng.integers(max_closures + 1))
    chained = rng.random() < 0.5
    hang = int(rng.integers(n))
    edges = [
        (n + new - 1 if chained and new else hang if chained else int(rng.integers(n + new)), n + new) for new in range(num_new)
    ]
    total = n + num_new
    for _ in range(num_closures if total > 1 else 0):
        if edges and rng.random() < 0.2:
            edges.append(edges[rng.integers(len(edges))])
        else:
            edges.append(tuple(rng.choice(total, size=2, replace=False).tolist()))
    array = np.array(edges, dtype=np.int64).reshape(-1, 2)
    turned = rng.random(len(array)) < 0.5
    array[turned] = array[turned][:, ::-1]
    array = rng.permutation(array)
    shared = noise.kind == "equal" and graph.num_edges
    information = (
        graph.information[0] if shared else noise.draw(rng, 1)[0] if noise.kind == "equal" else noise.draw(rng, len(array))
    )
    poses = random_poses(
        rng, noise.group, np.array([(0, new) for new in range(1, num_new)]).reshape(-1, 2), max(num_new, 1), noise.length
    )
    poses[:, : noise.group.position_dim] += graph.positions[hang]
    cost = float(rng.choice([0.0, rng.uniform(-3, 3)]))
    return Action(poses[:num_new], array, information, label=f"a{rng.integers(100)}", cost=cost)


@st.composite
def sessions(draw, *, max_actions: int = 6, max_poses: int = 6, min_actions: int = 1, **noise) -> Session:
    """A prior and between `min_actions` and `max_actions` actions; some of them may be the same one."""
    drawn = draw(noises(**noise))
    num_poses, num_extra = draw(st.integers(1, max_poses)), draw(st.integers(0, 5))
    num_actions = draw(st.integers(min_actions, max_actions))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    graph = random_pose_graph(rng, drawn, num_poses, num_extra)
    actions = [random_action(rng, graph, drawn) for _ in range(num_actions)]
    if num_actions > 1 and rng.random() < 0.2:
        actions[-1] = actions[0]
    return Session(graph, tuple(actions))


def shares_isotropic_noise(session: Session) -> bool:
    """Whether one block-isotropic Omega serves the prior and all actions, as the paper's bounds demand."""
    matrices = np.concatenate([session.graph.information, *(action.information for action in session.actions)])
    if len(session.graph.information) == 0:
        return False
    k, q = session.graph.group.position_dim, session.graph.group.rotation_dim
    diagonal = np.diagonal(matrices[0])
    return bool((matrices == np.diag(np.repeat([diagonal[0], diagonal[-1]], [k, q]))).all())
