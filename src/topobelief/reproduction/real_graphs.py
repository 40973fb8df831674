"""Decisions on real pose graphs: signatures and exact entropies of paths through the map of a file.

Files are optimised first. Candidates set out from the last pose and head for poses of the map, one after the other; they close
loops with old poses that they pass, and their noise is the file's own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.benchmark.sessions import BenchmarkSession, candidate_paths
from topobelief.estimation import optimize
from topobelief.io.formats import read_pose_graph
from topobelief.planning.planner import Planner
from topobelief.reproduction.bounds_quality import BoundsRow, bounds_rows


@dataclass(frozen=True, slots=True)
class RealActionRow:
    """One candidate on the graph of a file; nats.

    Attributes
    ----------
    prior, num_poses, num_edges, tangent_dim
        The file's name and graph.
    action, num_new_poses, num_closures
    joint, map
        The exact objectives.
    spanning_trees, von_neumann, von_neumann_approx
        Signatures; nan where the exact von Neumann entropy would take too long.
    """

    prior: str
    num_poses: int
    num_edges: int
    tangent_dim: int
    action: int
    num_new_poses: int
    num_closures: int
    joint: float
    map: float
    spanning_trees: float
    von_neumann: float
    von_neumann_approx: float


@lru_cache(maxsize=8)
def real_decision(path: Path, num_actions: int, seed: int) -> BenchmarkSession:
    """The graph of a file, optimised, and candidates on it.

    Raises
    ------
    FileError, EstimationError
        Where the file cannot be read or has no estimate.
    """
    graph = optimize(read_pose_graph(path))
    actions = candidate_paths(graph, num_actions, num_new_poses=40, num_closures=10, rng=np.random.default_rng(seed))
    return BenchmarkSession(path.stem, graph, actions)


def real_action_rows(path: Path, num_actions: int, seed: int, *, largest_spectrum: int) -> list[RealActionRow]:
    """Signatures and exact objectives of all candidates.

    Parameters
    ----------
    path, num_actions, seed
    largest_spectrum
        Poses above which the exact von Neumann entropy is left out.
    """
    session = real_decision(path, num_actions, seed)
    graph, actions = session.graph, session.actions

    def signature(name: str) -> FloatArray:
        if name == "von_neumann" and graph.num_poses > largest_spectrum:
            return np.full(len(actions), math.nan)
        return Planner(graph, signature=name).decide(actions, proof="none").signatures

    columns = {
        "joint": Planner(graph).entropies(actions),
        "map": Planner(graph, objective="map").entropies(actions),
        "spanning_trees": signature("spanning_trees"),
        "von_neumann": signature("von_neumann"),
        "von_neumann_approx": signature("von_neumann_approx"),
    }
    return [
        RealActionRow(
            prior=session.name,
            num_poses=graph.num_poses,
            num_edges=graph.num_edges,
            tangent_dim=graph.tangent_dim,
            action=index,
            num_new_poses=action.num_new_poses,
            num_closures=action.num_closures,
            **{name: float(values[index]) for name, values in columns.items()},
        )
        for index, action in enumerate(actions)
    ]


def real_bounds_rows(path: Path, num_actions: int, seed: int) -> list[BoundsRow]:
    """What bounds are worth on a file's graph, for the joint and the map entropy."""
    session = real_decision(path, num_actions, seed)
    return bounds_rows(session.name, math.nan, seed, session.graph, session.actions, ("joint", "map"))
