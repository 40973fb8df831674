"""Random pose graphs: speed and fidelity of signatures over sizes and densities (Kitanov and Indelman, arXiv 1903.00927).

n poses, odometry along a walk, and LC = round(dd n / 2) loop closures, so that closures raise the average degree by dd. The
walk takes steps of 1 m, turns by a normal angle of 0.5 rad at each, and keeps inside a square of side 2 sqrt(n) m by heading
for its middle from the border. Closures are drawn uniformly, none twice, from the pairs (i, j), j <= i - 2, that are nearer
than 3 m, or than the least multiple of 3 m that has enough of them. Noise is the paper's middle one, xi = 0.35.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from topobelief.arrays import FloatArray, IntArray
from topobelief.benchmark.baselines import baselines
from topobelief.entropy import joint_entropy
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.reproduction.planning_sessions import session_information
from topobelief.signatures.spanning_trees import spanning_tree_signature
from topobelief.signatures.von_neumann import von_neumann_entropy, von_neumann_entropy_approx

XI = 0.35
"""rad/m."""

_TURN, _REACH = 0.5, 3.0  # rad, m


@dataclass(frozen=True, slots=True)
class RandomGraphRow:
    """One random graph; entropies and signatures in nats, times in seconds (medians).

    Attributes
    ----------
    num_poses, degree_increase, index
        Which one.
    num_closures
    joint
    spanning_trees, von_neumann, von_neumann_approx, von_neumann_normalized
        The exact von Neumann entropy is nan above the size up to which it was asked for.
    spanning_trees_seconds, von_neumann_seconds, von_neumann_approx_seconds
        From the graph's edges, from scratch.
    standard_seconds
        Standard belief space planning: GTSAM's elimination, with its graph at hand.
    """

    num_poses: int
    degree_increase: float
    index: int
    num_closures: int
    joint: float
    spanning_trees: float
    von_neumann: float
    von_neumann_approx: float
    von_neumann_normalized: float
    spanning_trees_seconds: float
    von_neumann_seconds: float
    von_neumann_approx_seconds: float
    standard_seconds: float


def random_graph(num_poses: int, degree_increase: float, *, rng: np.random.Generator) -> PoseGraph:
    """A random pose graph in SE(2), with block-isotropic noise.

    Parameters
    ----------
    num_poses
        n, at least 4.
    degree_increase
        dd, by which closures raise the average degree.
    rng
    """
    poses = _walk(num_poses, rng)
    odometry = np.column_stack([np.arange(num_poses - 1), np.arange(1, num_poses)])
    pairs = _near_pairs(poses[:, :2], round(degree_increase * num_poses / 2))
    closures = rng.choice(pairs, round(degree_increase * num_poses / 2), replace=False)
    return PoseGraph(poses, np.concatenate([odometry, closures]), None, session_information(XI))


def random_graph_row(
    num_poses: int, degree_increase: float, index: int, seed: int, *, largest_spectrum: int, repetitions: int = 3
) -> RandomGraphRow:
    """Draw a graph, evaluate it and time its signatures.

    Parameters
    ----------
    num_poses, degree_increase, index, seed
        Which graph.
    largest_spectrum
        Poses above which the exact von Neumann entropy, a dense spectrum, is left out.
    repetitions
        Of each timing.
    """
    key = [seed, num_poses, round(1000 * degree_increase), index]
    graph = random_graph(num_poses, degree_increase, rng=np.random.default_rng(key))
    topology, information = graph.topology, graph.information
    noise = information[0]
    trees, trees_seconds = _timed(lambda: spanning_tree_signature(topology, noise), repetitions)
    by_degrees, by_degrees_seconds = _timed(lambda: von_neumann_entropy_approx(topology), repetitions)
    spectral, spectral_seconds = math.nan, math.nan
    if num_poses <= largest_spectrum:
        spectral, spectral_seconds = _timed(lambda: von_neumann_entropy(topology), 1)
    _, standard_seconds = _timed(_standard(graph), repetitions)
    return RandomGraphRow(
        num_poses=num_poses,
        degree_increase=degree_increase,
        index=index,
        num_closures=graph.num_edges - num_poses + 1,
        joint=joint_entropy(graph),
        spanning_trees=trees,
        von_neumann=spectral,
        von_neumann_approx=by_degrees,
        von_neumann_normalized=von_neumann_entropy_approx(topology, information=noise),
        spanning_trees_seconds=trees_seconds,
        von_neumann_seconds=spectral_seconds,
        von_neumann_approx_seconds=by_degrees_seconds,
        standard_seconds=standard_seconds,
    )


def _walk(num_poses: int, rng: np.random.Generator) -> FloatArray:
    """Poses of the walk, shape (n, 3)."""
    half = math.sqrt(num_poses)
    turns = rng.normal(scale=_TURN, size=num_poses)
    poses = np.zeros((num_poses, 3))
    x = y = heading = 0.0
    for index in range(1, num_poses):
        outside = max(abs(x), abs(y)) > half
        heading = math.atan2(-y, -x) if outside else heading + float(turns[index])
        x, y = x + math.cos(heading), y + math.sin(heading)
        poses[index] = x, y, heading
    return poses


def _near_pairs(positions: FloatArray, count: int) -> IntArray:
    """All (later, earlier) pairs within the least reach that has `count` of them, shape (pairs, 2), sorted."""
    tree, reach = KDTree(positions), _REACH
    while True:
        pairs = tree.query_pairs(reach, output_type="ndarray")
        pairs = pairs[pairs[:, 1] - pairs[:, 0] >= 2]
        if len(pairs) >= count:
            return pairs[np.lexsort(pairs.T)][:, ::-1]
        reach += _REACH


def _standard(graph: PoseGraph) -> Callable[[], float]:
    """The benchmark's way to evaluate an action, for the one that adds nothing."""
    stay = Action(np.zeros((0, 3)), np.zeros((0, 2), dtype=np.int64), graph.information[0])
    elimination = next(baseline for baseline in baselines() if baseline.kind == "standard")
    return elimination.prepare(graph)(stay)


def _timed(compute: Callable[[], float], repetitions: int) -> tuple[float, float]:
    """The value and the median seconds."""
    seconds: list[float] = []
    value = math.nan
    for _ in range(repetitions):
        begin = time.perf_counter()
        value = compute()
        seconds.append(time.perf_counter() - begin)
    return value, statistics.median(seconds)
