"""Graphs in space, made for tests: drives up a ramp and over hills, flights, and what a roadmap among them is.

`PYTHONPATH=src python tests/drives_3d.py FOLDER` writes the large ones of the page on three dimensions there, as g2o.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import gtsam
import numpy as np
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

import topobelief as tb
from topobelief.candidates.roadmap import Roadmap
from topobelief.geometry import SE3_GROUP
from topobelief.io.g2o import write_g2o


def ramp(*, rounds: int = 2, rise: float = 3.0, radius: float = 10.0, poses_per_round: int = 24) -> tb.PoseGraph:
    """A car that drives `rounds` times round a helical ramp, tilted by its slope; it recognises places one floor below it."""
    turn = 2 * np.pi * np.arange(rounds * poses_per_round + 1) / poses_per_round
    places = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), rise * turn / (2 * np.pi)])
    ahead = np.column_stack([-radius * np.sin(turn), radius * np.cos(turn), np.full(len(turn), rise / (2 * np.pi))])
    chain = [(i, i + 1) for i in range(len(turn) - 1)]
    loops = [(i, i + poses_per_round) for i in range(0, (rounds - 1) * poses_per_round, 4)]
    return tb.PoseGraph(poses_of(places, ahead), chain + loops, None, np.diag([100.0] * 3 + [400.0] * 3))


def poses_of(places: np.ndarray, ahead: np.ndarray, up: np.ndarray | tuple[float, ...] = (0.0, 0.0, 1.0)) -> np.ndarray:
    """Poses with x ahead, and z as near to `up` as can be."""
    x = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
    y = np.cross(up, x)
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    rotation = Rotation.from_matrix(np.stack([x, y, np.cross(x, y)], axis=2))
    return np.column_stack([places, rotation.as_quat(canonical=True)])


def measured(poses: np.ndarray, edges: list[tuple[int, int]], *, metres: float, radians: float, seed: int = 0) -> tb.PoseGraph:
    """A graph at the true poses whose measurements have noise, and the information of that noise."""
    sigmas = np.repeat([metres, radians], 3)
    a, b = np.array(edges).T
    noise = SE3_GROUP.exp(np.random.default_rng(seed).normal(size=(len(edges), 6)) * sigmas)
    measurements = SE3_GROUP.compose(SE3_GROUP.between(poses[a], poses[b]), noise)
    return tb.PoseGraph(poses, edges, measurements, np.diag(sigmas**-2.0))


def torus(*, windings: int = 100, poses_per_winding: int = 50, closing: float = 0.83, seed: int = 0) -> tb.PoseGraph:
    """A robot on the hull of a torus, as in the benchmark graph torus3D: it winds around the tube, and most poses close a loop
    with the winding before. By default 5000 poses a metre apart, the tube 16 m thick and 48 m from middle to middle, and some
    9000 edges with noise of 0.05 m and 0.01 rad.
    """
    count = windings * poses_per_winding
    small = 2 * np.pi * np.arange(count) / poses_per_winding
    large = small / windings
    thick = poses_per_winding / (2 * np.pi)  # radius of the tube: a pose a metre
    out = np.column_stack([np.cos(large), np.sin(large), np.zeros(count)])
    normal = np.cos(small)[:, None] * out + np.sin(small)[:, None] * [0, 0, 1]
    places = 3 * thick * out + thick * normal
    chain = [(i, i + 1) for i in range(count - 1)]
    chosen = np.random.default_rng(seed).uniform(size=count) < closing
    loops = [(i - poses_per_winding, i) for i in range(poses_per_winding, count) if chosen[i]]
    poses = poses_of(places, np.gradient(places, axis=0), normal)
    return measured(poses, chain + loops, metres=0.05, radians=0.01, seed=seed)


def hills(*, junctions: int = 40, block: float = 100.0, step: float = 5.0, seed: int = 0) -> tb.PoseGraph:
    """A car on the streets of a hilly town: from junction to junction without turning back, loops where it comes by again.

    Streets are 5 by 4 blocks of 100 m over hills of 20 m; noise of 0.1 m and 0.01 rad.
    """
    rng = np.random.default_rng(seed)
    corner, heading = np.array([0, 0]), np.array([1, 0])
    corners = [corner]
    for _ in range(junctions):
        turns = [heading, np.array([-heading[1], heading[0]]), np.array([heading[1], -heading[0]])]
        inside = [turn for turn in turns if ((corner + turn >= 0) & (corner + turn <= (5, 4))).all()]
        heading = inside[rng.integers(len(inside))]
        corner = corner + heading
        corners.append(corner)
    shares = np.arange(0, 1, step / block)[:, None]
    flat = np.concatenate([block * (a + shares * (b - a)) for a, b in pairwise(corners)])
    height = 10 * np.sin(flat[:, 0] / 90) * np.cos(flat[:, 1] / 70)
    places = np.column_stack([flat, height])
    chain = [(i, i + 1) for i in range(len(places) - 1)]
    poses = poses_of(places, np.diff(places, axis=0, append=places[-1:] + (places[-1:] - places[-2:-1])))
    return measured(poses, chain + closures_of(places, within=step, apart=30), metres=0.1, radians=0.01, seed=seed)


def closures_of(places: np.ndarray, *, within: float, apart: int) -> list[tuple[int, int]]:
    """Each place and the nearest one within a distance that is so many places earlier."""
    loops: list[tuple[int, int]] = []
    for new in range(apart, len(places)):
        away = np.linalg.norm(places[: new - apart + 1] - places[new], axis=1)
        if away.min() <= within:
            loops.append((int(np.argmin(away)), new))
    return loops


def kitti() -> tb.PoseGraph:
    """A real drive of 3.7 km through a town: positions by GPS from the gtsam wheel, a second apart, headed as they go.

    The car comes by former places; loops close there within 12 m. Noise of 0.1 m and 0.01 rad is added to what positions say.
    """
    file = Path(gtsam.__file__).parent / "Data" / "KittiGps_converted.txt"
    places = np.loadtxt(file, delimiter=",", skiprows=1)[:, 1:]
    places = places[np.r_[True, np.linalg.norm(np.diff(places, axis=0), axis=1) > 0.5]]
    chain = [(i, i + 1) for i in range(len(places) - 1)]
    poses = poses_of(places, np.gradient(places, axis=0))
    return measured(poses, chain + closures_of(places, within=12.0, apart=20), metres=0.1, radians=0.01)


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


if __name__ == "__main__":
    for name, graph in (("torus", torus()), ("hills", hills()), ("kitti", kitti())):
        write_g2o(graph, Path(sys.argv[1], f"{name}.g2o"))
        print(f"{name}: {graph}")
