"""The whole benchmark: sessions on generated graphs and files, memory, error bounds and proofs, as one result that grows."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, get_args

import numpy as np

from topobelief.benchmark.certificates import (
    ErrorBounds,
    ProofSize,
    error_bounds,
    proof_size,
)
from topobelief.benchmark.memory import Work, peak_gigabytes
from topobelief.benchmark.predicted import BoundsOfCandidates, bounds_of_candidates
from topobelief.benchmark.sessions import BenchmarkSession, ClosureStyle, candidate_paths, city_drive
from topobelief.benchmark.timing import Clock, SessionTimes, degree_seconds, time_session
from topobelief.errors import InvalidInputError
from topobelief.estimation import optimize
from topobelief.graph.information import block_isotropic
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.formats import read_pose_graph
from topobelief.runs.machine import describe_machine

SCHEMA = "topobelief.benchmark/3"
SIGMA_POSITION, SIGMA_ROTATIONS = 0.1, (0.01, 0.035, 0.085)  # the paper's noises, metres and radians
SMALL = "small"

Progress = Callable[[str], None]
"""Called with what is measured next."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchmarkPlan:
    """What to measure.

    Attributes
    ----------
    sizes
        Poses of generated graphs. Without any, files alone are measured.
    files
        Pose graphs to read and optimise.
    num_actions
        K, at least 2.
    repetitions
        Of each timing, at least 1.
    num_seeds, bounds_size, bounds_actions
        Generated graphs for the error bounds, their poses and candidates.
    memory_sizes
        Poses of generated graphs whose peak memory is measured, beside that of the files.
    small
        Poses and candidates of a session as the paper has them, which is measured first; None for none.
    cpu_time
        Measure the processor's time, of all threads together, in place of elapsed time: where other programs run.
    predicted_actions
        Candidates for which closures are predicted in several ways.
    seed
    """

    sizes: tuple[int, ...] = (1000, 3500, 10_000, 100_000)
    files: tuple[Path, ...] = ()
    num_actions: int = 1000
    repetitions: int = 5
    num_seeds: int = 20
    bounds_size: int = 1000
    bounds_actions: int = 200
    memory_sizes: tuple[int, ...] = (10_000, 100_000)
    small: tuple[int, int] | None = (100, 20)
    cpu_time: bool = False
    predicted_actions: int = 100
    seed: int = 0

    @property
    def clock(self) -> Clock:
        """What times are read from."""
        return time.process_time if self.cpu_time else time.perf_counter

    @staticmethod
    def quick() -> BenchmarkPlan:
        """A first look: one small graph, few repetitions."""
        return BenchmarkPlan(
            sizes=(1000,), num_actions=300, repetitions=3, num_seeds=3, memory_sizes=(1000,), predicted_actions=30
        )

    def __post_init__(self) -> None:
        for name, value, least in (
            ("num_actions", self.num_actions, 2),
            ("repetitions", self.repetitions, 1),
            ("num_seeds", self.num_seeds, 1),
            ("predicted_actions", self.predicted_actions, 1),
            ("seed", self.seed, 0),
            *(("sizes", size, 2) for size in self.sizes),
        ):
            if value < least:
                raise InvalidInputError(f"expected {name} of at least {least}, got {value}")


@dataclass(frozen=True, slots=True)
class PeakMemory:
    """Largest resident size of a process that ranks or evaluates one session, 1e9 bytes.

    Attributes
    ----------
    name, num_actions
    session, bounds, exact, error
        Of a process that only makes the session; that ranks it with Fischer bounds; that computes J of all; E of all.
    """

    name: str
    num_actions: int
    session: float
    bounds: float
    exact: float
    error: float


@dataclass(frozen=True, slots=True)
class BenchmarkResult:
    """What has been measured so far.

    Attributes
    ----------
    plan
    machine
        Processor, cores, system, versions.
    sessions
    degree_seconds
        By session: seconds an action of the von Neumann entropy by degrees, beyond reading its edges.
    memory
    error_bounds
    proofs
    candidates
    """

    plan: BenchmarkPlan
    machine: dict[str, str]
    sessions: tuple[SessionTimes, ...] = ()
    degree_seconds: dict[str, float] | None = None
    memory: tuple[PeakMemory, ...] = ()
    error_bounds: tuple[ErrorBounds, ...] = ()
    proofs: tuple[ProofSize, ...] = ()
    candidates: tuple[BoundsOfCandidates, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON, seconds and 1e9 bytes, with the ratios that tables show."""
        document = asdict(self)
        document["plan"]["files"] = [path.name for path in self.plan.files]
        for session, values in zip(self.sessions, document["sessions"], strict=True):
            for method, row in zip(session.methods, values["methods"], strict=True):
                for name in ("once", "per_action", "total"):
                    row[name] = getattr(method, name) if method.num_timed else None
                row["times_faster_than_gtsam"], row["times_faster_than_best_from_scratch"] = session.ratios(method)
        return {"schema": SCHEMA, **document}


def run_benchmark(plan: BenchmarkPlan, *, progress: Progress = lambda _: None) -> Iterator[BenchmarkResult]:
    """Measure part after part; each result holds all that came before.

    Parameters
    ----------
    plan
    progress
    """
    result = BenchmarkResult(plan, describe_machine(), degree_seconds={})
    yield result
    graphs: dict[str, PoseGraph] = {}
    for name, graph in _graphs(plan, progress):
        session = _session(name, graph, plan)
        num_actions = len(session.actions) // 2

        def tell(method: str, name: str = name) -> None:
            progress(f"{name}: {method}")

        repetitions, clock = plan.repetitions, plan.clock
        times = time_session(session, num_actions=num_actions, repetitions=repetitions, clock=clock, progress=tell)
        seconds = {**(result.degree_seconds or {}), name: degree_seconds(session, repetitions=repetitions, clock=clock)}
        result = replace(result, sessions=(*result.sessions, times), degree_seconds=seconds)
        if name in {path.stem for path in plan.files}:
            graphs[name] = graph
        yield result
    for source in (*(plan.memory_sizes if plan.sizes else ()), *plan.files):
        name = source.stem if isinstance(source, Path) else f"generated, {source}"
        progress(f"memory: {name}")
        works = [peak_gigabytes(source, plan.num_actions, work, seed=plan.seed) for work in get_args(Work)]
        result = replace(result, memory=(*result.memory, PeakMemory(name, plan.num_actions, *works)))
        yield result
    for closures in get_args(ClosureStyle) if plan.sizes else ():
        progress(f"error bounds, closures {closures}")
        found = error_bounds(
            closures=closures,
            num_poses=plan.bounds_size,
            num_actions=plan.bounds_actions,
            seeds=range(plan.seed, plan.seed + plan.num_seeds),
            sigma_position=SIGMA_POSITION,
            sigma_rotation=SIGMA_ROTATIONS[1],
        )
        result = replace(result, error_bounds=(*result.error_bounds, found))
        yield result
    for name, graph in graphs.items():
        if graph.tangent_dim == 6 or graph.num_landmarks:  # the paper's noises are those of poses in the plane
            continue
        result = replace(result, proofs=(*result.proofs, *_proofs(name, graph, plan, progress)))
        yield result
    for name, graph in graphs.items():
        progress(f"{name}: closures as plan predicts them")
        found = bounds_of_candidates(
            name,
            graph,
            num_actions=plan.predicted_actions,
            repetitions=plan.repetitions,
            seed=plan.seed,
            clock=plan.clock,
        )
        result = replace(result, candidates=(*result.candidates, *found))
        yield result


def _proofs(name: str, graph: PoseGraph, plan: BenchmarkPlan, progress: Progress) -> Iterator[ProofSize]:
    """At each of the paper's noises, by the family that the planner chooses and by those anchored in the prior."""
    families = ("auto", "chain", "anchored")
    for sigma, bounds in product(SIGMA_ROTATIONS, families):
        progress(f"{name}: proof at sigma_theta = {sigma}, bounds {bounds}")
        yield proof_size(
            name,
            graph,
            num_actions=plan.num_actions,
            bounds=bounds,
            sigma_position=SIGMA_POSITION,
            sigma_rotation=sigma,
            repetitions=plan.repetitions,
            seed=plan.seed,
            clock=plan.clock,
        )


def _graphs(plan: BenchmarkPlan, progress: Progress) -> Iterator[tuple[str, PoseGraph]]:
    if plan.sizes and plan.small:
        information = block_isotropic(SIGMA_POSITION, SIGMA_ROTATIONS[1])
        yield SMALL, city_drive(plan.small[0], information, rng=np.random.default_rng(plan.seed))
    for path in plan.files:
        progress(f"{path.stem}: reading and optimising")
        yield path.stem, optimize(read_pose_graph(path))
    for size in plan.sizes:
        progress(f"generating {size} poses")
        information = block_isotropic(SIGMA_POSITION, SIGMA_ROTATIONS[1])
        yield f"generated, {size}", city_drive(size, information, rng=np.random.default_rng(plan.seed))


def _session(name: str, graph: PoseGraph, plan: BenchmarkPlan) -> BenchmarkSession:
    rng = np.random.default_rng(plan.seed)
    if name == SMALL and plan.small:
        actions = candidate_paths(graph, 2 * plan.small[1], num_new_poses=10, num_closures=6, rng=rng)
    else:
        actions = candidate_paths(graph, 2 * plan.num_actions, rng=rng)
    return BenchmarkSession(name, graph, actions)
