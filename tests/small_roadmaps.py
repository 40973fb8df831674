"""Small random roadmaps around a robot that has driven a loop, and all simple walks on them."""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay

import topobelief as tb
from topobelief.candidates.roadmap import Roadmap

OPEN = tb.World.from_boxes([], bounds=(-50, -50, 50, 50))
"""A world without walls."""


def drive(rng, *, num_poses=14, noise=0.1):
    """A pose graph along a random drive that ends at the origin, with a loop closure or two."""
    headings = np.cumsum(rng.normal(0.0, 0.5, num_poses))
    steps = np.stack([np.cos(headings), np.sin(headings)], axis=1)
    x_y = np.cumsum(steps, axis=0)
    poses = np.column_stack([x_y - x_y[-1], headings])
    chain = [(i, i + 1) for i in range(num_poses - 1)]
    loops = [(0, num_poses // 2)] if rng.random() < 0.5 else []
    information = np.diag([1, 1, 4]) / noise**2
    return tb.PoseGraph(poses, chain + loops, None, information)


def small_roadmap(rng, graph, *, num_vertices=9, extent=4.0):
    """Places around the drive joined by a planar triangulation; the first is where the robot stands, the second the goal."""
    low, high = graph.positions.min(axis=0) - 1, graph.positions.max(axis=0) + 1
    low, high = np.maximum(low, -extent), np.minimum(high, extent)
    vertices = np.vstack([graph.positions[-1], rng.uniform(low, high, (num_vertices - 1, 2))])
    triangles = Delaunay(vertices).simplices
    edges = np.unique(
        np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [0, 2]]]), axis=1), axis=0
    )
    return Roadmap(OPEN, 0.1, OPEN.component((0.0, 0.0), 0.1), vertices, edges)


def simple_walks(roadmap, max_length, *, end=None):
    """All walks from the first vertex within a length that pass no vertex twice, to the end or, without one, to anywhere."""
    neighbours = [[] for _ in roadmap.vertices]
    for (a, b), length in zip(roadmap.edges.tolist(), roadmap.lengths.tolist(), strict=True):
        neighbours[a].append((b, length))
        neighbours[b].append((a, length))
    walks, stack = [], [((0,), 0.0)]
    while stack:
        walk, so_far = stack.pop()
        if end is None or walk[-1] == end:
            walks.append(walk)
        if end is not None and walk[-1] == end:
            continue
        for vertex, length in neighbours[walk[-1]]:
            if vertex not in walk and so_far + length <= max_length:
                stack.append(((*walk, vertex), so_far + length))
    return walks


def values_of(graph, roadmap, walks, *, objective, closures):
    """The exact objective after each walk."""
    paths = [roadmap.vertices[list(walk)] for walk in walks]
    actions = tb.predict_actions(graph, paths, closures=closures, turn=None)
    return tb.Planner(graph, objective=objective).entropies(actions)
