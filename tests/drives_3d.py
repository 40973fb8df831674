"""Graphs in space, made for tests: drives up a ramp, flights, and what a roadmap among them is."""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

import topobelief as tb
from topobelief.candidates.roadmap import Roadmap


def ramp(*, rounds: int = 2, rise: float = 3.0, radius: float = 10.0, poses_per_round: int = 24) -> tb.PoseGraph:
    """A car that drives `rounds` times round a helical ramp, tilted by its slope; it recognises places one floor below it."""
    turn = 2 * np.pi * np.arange(rounds * poses_per_round + 1) / poses_per_round
    places = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), rise * turn / (2 * np.pi)])
    ahead = np.column_stack([-radius * np.sin(turn), radius * np.cos(turn), np.full(len(turn), rise / (2 * np.pi))])
    x = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
    y = np.cross([0.0, 0.0, 1.0], x)
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    quaternions = Rotation.from_matrix(np.stack([x, y, np.cross(x, y)], axis=2)).as_quat(canonical=True)
    chain = [(i, i + 1) for i in range(len(turn) - 1)]
    loops = [(i, i + poses_per_round) for i in range(0, (rounds - 1) * poses_per_round, 4)]
    return tb.PoseGraph(np.column_stack([places, quaternions]), chain + loops, None, np.diag([100.0] * 3 + [400.0] * 3))


def flight(seed: int, *, num_poses: int = 12) -> tb.PoseGraph:
    """A random flight in space that ends somewhere, turned anyhow, with a loop closure."""
    rng = np.random.default_rng(seed)
    places = np.cumsum(rng.normal(0.0, 0.6, (num_poses, 3)), axis=0)
    quaternions = Rotation.random(num_poses, rng=rng).as_quat(canonical=True)
    chain = [(i, i + 1) for i in range(num_poses - 1)]
    root = rng.normal(size=(6, 6)) + 4 * np.eye(6)
    return tb.PoseGraph(np.column_stack([places, quaternions]), [*chain, (0, num_poses // 2)], None, 20 * root @ root.T)


def roadmap_in_space(graph: tb.PoseGraph, seed: int, *, num_vertices: int = 6) -> Roadmap:
    """Places around the end of a flight, joined by a Delaunay triangulation; the first is where the robot is."""
    rng = np.random.default_rng(seed)
    places = np.vstack([graph.positions[-1], graph.positions[-1] + rng.uniform(-1.5, 1.5, (num_vertices - 1, 3))])
    corners = Delaunay(places).simplices
    pairs = np.concatenate([corners[:, [a, b]] for a in range(4) for b in range(a)])
    edges = np.unique(np.sort(pairs, axis=1), axis=0)
    return Roadmap(tb.World3D.from_trajectory(graph, 20.0), 0.1, None, places, edges)
