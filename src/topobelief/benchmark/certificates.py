"""How much the bounds certify: the error bound of each family, and how many exact values a proof of the optimum takes."""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from topobelief.benchmark.sessions import ClosureStyle, candidate_paths, city_drive
from topobelief.benchmark.timing import Clock
from topobelief.graph.information import block_isotropic
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision import Decision
from topobelief.planning.planner import Planner

FAMILIES = ("paper", "fischer", "anchored", "chain")


def with_noise(graph: PoseGraph, sigma_position: float, sigma_rotation: float) -> PoseGraph:
    """A graph in SE(2) with the same block-isotropic noise on all edges."""
    information = block_isotropic(sigma_position, sigma_rotation)
    return PoseGraph(graph.poses, graph.edges, graph.measurements, information, ids=graph.ids)


@dataclass(frozen=True, slots=True)
class ErrorBounds:
    """What each family of bounds certifies of the first of the ranking on generated graphs, medians over seeds.

    Attributes
    ----------
    closures
        Of the generated drive.
    num_poses, num_actions, num_seeds
    sigma_position, sigma_rotation
        Metres and radians.
    error_bound
        Delta J_max by family, nats.
    ratio
        Median over seeds of a family's Delta J_max over that of the paper's.
    """

    closures: ClosureStyle
    num_poses: int
    num_actions: int
    num_seeds: int
    sigma_position: float
    sigma_rotation: float
    error_bound: dict[str, float]
    ratio: dict[str, float]


def error_bounds(
    *,
    closures: ClosureStyle,
    num_poses: int,
    num_actions: int,
    seeds: Sequence[int],
    sigma_position: float,
    sigma_rotation: float,
) -> ErrorBounds:
    """Compare the families on one generated drive a seed.

    Parameters
    ----------
    closures
        As for `city_drive`.
    num_poses, num_actions
    seeds
        At least one.
    sigma_position, sigma_rotation
        Metres and radians.
    """
    bounds = np.empty((len(seeds), len(FAMILIES)))
    for row, seed in enumerate(seeds):
        rng = np.random.default_rng(seed)
        information = block_isotropic(sigma_position, sigma_rotation)
        graph = city_drive(num_poses, information, closures=closures, rng=rng)
        actions = candidate_paths(graph, num_actions, rng=rng)
        bounds[row] = [Planner(graph, bounds=family).decide(actions).error_bound for family in FAMILIES]
    medians: list[float] = np.median(bounds, axis=0).tolist()
    shares = np.divide(bounds, bounds[:, :1], out=np.ones_like(bounds), where=bounds[:, :1] > 0)  # 0 of 0: as good
    ratios: list[float] = np.median(shares, axis=0).tolist()
    return ErrorBounds(
        closures,
        num_poses,
        num_actions,
        len(seeds),
        sigma_position,
        sigma_rotation,
        dict(zip(FAMILIES, medians, strict=True)),
        dict(zip(FAMILIES, ratios, strict=True)),
    )


@dataclass(frozen=True, slots=True)
class ProofSize:
    """Exact values that a proof of the optimum took.

    Attributes
    ----------
    name
        Of the graph.
    sigma_position, sigma_rotation
        Metres and radians.
    bounds
        Family.
    num_actions, num_survivors, num_evaluations
        Candidates; those that bounds alone leave; those whose exact value the proof took.
    seconds
        Median of the whole decision, with a new planner each time.
    """

    name: str
    sigma_position: float
    sigma_rotation: float
    bounds: str
    num_actions: int
    num_survivors: int
    num_evaluations: int
    seconds: float


def proof_size(
    name: str,
    graph: PoseGraph,
    *,
    num_actions: int,
    bounds: str,
    sigma_position: float,
    sigma_rotation: float,
    repetitions: int,
    seed: int,
    clock: Clock = time.perf_counter,
) -> ProofSize:
    """Prove the optimum on one graph in SE(2) with another noise.

    Parameters
    ----------
    name
    graph
    num_actions
    bounds
    sigma_position, sigma_rotation
        Metres and radians.
    repetitions
    seed
    clock
    """
    noisy = with_noise(graph, sigma_position, sigma_rotation)
    actions = candidate_paths(noisy, num_actions, rng=np.random.default_rng(seed))
    survivors = len(Planner(noisy, bounds=bounds).decide(actions).survivors)

    def prove() -> tuple[Decision, float]:
        start = clock()
        decision = Planner(noisy, bounds=bounds).decide(actions, proof="optimal")
        return decision, clock() - start

    proofs = [prove() for _ in range(repetitions)]
    decision = proofs[0][0]
    return ProofSize(
        name,
        sigma_position,
        sigma_rotation,
        decision.bounds,
        num_actions,
        survivors,
        decision.num_evaluations,
        statistics.median(seconds for _, seconds in proofs),
    )
