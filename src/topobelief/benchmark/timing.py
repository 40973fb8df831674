"""Seconds of one session: what is paid once, what each action costs, and what all of them cost together.

Methods that evaluate actions one by one are timed on a few of them. The engine is timed on whole sessions, each with a new
planner, of K actions and of 2 K in turn: what the second K cost, divided by K, is what an action costs. Figures are medians.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from topobelief.benchmark.baselines import Baseline, anchor_of, baselines
from topobelief.benchmark.sessions import BenchmarkSession
from topobelief.forms.action_batch import ActionBatch
from topobelief.forms.degree_sums import DegreeSums
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.planner import Planner, Proof
from topobelief.position_errors import expected_errors

Kind = Literal["standard", "lemma", "topology", "error", "engine"]

Clock = Callable[[], float]
"""Seconds: `time.perf_counter`, or `time.process_time` (of all threads together) where other programs run."""

Progress = Callable[[str], None]
"""Called with the name of the method that is timed next."""

_MAX_SECONDS = 20.0  # for the actions of one baseline, once three are done
_MIN_ACTIONS = 3


@dataclass(frozen=True, slots=True)
class MethodTime:
    """Seconds of one method on one session.

    Attributes
    ----------
    name, kind
        "standard": standard belief space planning from scratch; "lemma": by the determinant lemma; "topology": signatures
        from scratch; "error": the expected error from scratch; "engine": this project's.
    once
        Seconds per session before the first action.
    per_action
    total
        For all actions of the session.
    num_timed
        Actions, or whole sessions of the engine, that were timed; 0 where the method fails on this graph, and seconds are inf.
    note
        What the method answered, where that says something, or why it fails.
    objective
        "joint" for entropy and signatures that stand for it, "error" for the expected error of the map.
    """

    name: str
    kind: Kind
    once: float
    per_action: float
    total: float
    num_timed: int
    note: str = ""
    objective: Literal["joint", "error"] = "joint"


@dataclass(frozen=True, slots=True)
class SessionTimes:
    """All methods on one session.

    Attributes
    ----------
    name, num_poses, num_landmarks, num_edges
        Of the prior.
    num_actions, num_new_poses, num_closures, num_observations
        K, and the means of an action.
    methods
    first_answer
        Seconds of this process's first small decision, in which compiled kernels are loaded, or compiled once a machine.
    largest_deviation
        Of log det I, and of E, between the methods that compute it, relative.
    """

    name: str
    num_poses: int
    num_edges: int
    num_actions: int
    num_new_poses: float
    num_closures: float
    methods: tuple[MethodTime, ...]
    first_answer: float
    largest_deviation: float
    num_landmarks: int = 0
    num_observations: float = 0.0

    @property
    def gtsam(self) -> MethodTime | None:
        """The faster of GTSAM's orderings."""
        return self._fastest("joint", ("standard",), "GTSAM")

    @property
    def best_from_scratch(self) -> MethodTime | None:
        """The fastest row that gives joint entropies and is none of the engine's."""
        return self._fastest("joint", ("standard", "lemma"))

    def ratios(self, method: MethodTime) -> tuple[float | None, float | None]:
        """How many times faster than GTSAM and than the best from scratch a method of the same objective is."""
        gtsam, best = self.gtsam, self.best_from_scratch
        if method.objective == "error":
            gtsam, best = self._fastest("error", ("error",), "GTSAM"), self._fastest("error", ("error",))
        return ratio(gtsam and gtsam.total, method.total), ratio(best and best.total, method.total)

    def _fastest(self, objective: str, kinds: tuple[Kind, ...], name: str = "") -> MethodTime | None:
        rows = [m for m in self.methods if m.objective == objective and m.kind in kinds and name in m.name and m.num_timed]
        return min(rows, key=lambda m: m.total, default=None)


def ratio(slow: float | None, fast: float) -> float | None:
    """How many times faster; None where there is nothing to compare with."""
    return None if slow is None or not 0 < fast < math.inf else slow / fast


def time_session(
    session: BenchmarkSession,
    *,
    num_actions: int,
    repetitions: int,
    methods: Sequence[Baseline] | None = None,
    clock: Clock = time.perf_counter,
    progress: Progress = lambda _: None,
) -> SessionTimes:
    """Time every method that suits the size of the graph.

    Parameters
    ----------
    session
        With at least twice `num_actions` actions.
    num_actions
        K.
    repetitions
        Of the engine's sessions, and actions of each baseline (fewer where they take long).
    methods
        Baselines; default: all of them.
    clock
    progress
    """
    graph, actions = session.graph, session.actions
    progress("first answer")
    first_answer = _seconds(lambda: _warm_up(session), clock)
    rows: list[MethodTime] = []
    values: list[float] = []
    chosen = actions[: num_actions : max(1, num_actions // repetitions)][:repetitions]
    for method in baselines() if methods is None else methods:
        if not method.takes(graph):
            continue
        progress(method.name)
        try:
            row, computed = _time_baseline(method, graph, chosen, num_actions, clock)
        except (RuntimeError, np.linalg.LinAlgError) as error:  # GTSAM refuses graphs whose noise differs a lot
            reason = str(error).strip().partition("\n")[0].rstrip(" .,:")
            unknown, note = math.inf, f"fails: {reason}"
            row = MethodTime(method.name, method.kind, unknown, unknown, unknown, 0, note, _objective(method))
            computed = []
        rows.append(row)
        if method.quantity in ("log det I", "E") and computed:
            values.append(_deviation(method, graph, chosen[: len(computed)], computed))
    rows += time_engine(session, num_actions=num_actions, repetitions=repetitions, clock=clock, progress=progress)
    timed = actions[:num_actions]
    return SessionTimes(
        name=session.name,
        num_poses=graph.num_poses,
        num_landmarks=graph.num_landmarks,
        num_edges=graph.num_edges,
        num_actions=num_actions,
        num_new_poses=float(np.mean([action.num_new_poses for action in timed])),
        num_closures=float(np.mean([action.num_closures for action in timed])),
        num_observations=float(np.mean([action.num_observations for action in timed])),
        methods=tuple(rows),
        first_answer=first_answer,
        largest_deviation=max(values, default=0.0),
    )


def time_engine(
    session: BenchmarkSession,
    *,
    num_actions: int,
    repetitions: int,
    clock: Clock = time.perf_counter,
    progress: Progress = lambda _: None,
) -> list[MethodTime]:
    """Time the rows of this engine; parameters as for `time_session`."""
    graph = session.graph

    def ranking(actions: Sequence[Action]) -> str:
        Planner(graph, engine="incremental").decide(actions, proof="none")
        return ""

    def degrees(actions: Sequence[Action]) -> str:
        Planner(graph, engine="incremental", signature="von_neumann_approx").decide(actions, proof="none")
        return ""

    def bounds(family: str) -> Callable[[Sequence[Action]], str]:
        def decide(actions: Sequence[Action]) -> str:
            decision = Planner(graph, engine="incremental", bounds=family).decide(actions)
            return f"{len(decision.survivors)} of {len(actions)} may be the best"

        return decide

    def optimum(actions: Sequence[Action]) -> str:
        decision = Planner(graph, engine="incremental", bounds="auto").decide(actions, proof="optimal")
        return f"bounds {decision.bounds}, {decision.num_evaluations} exact evaluations"

    def exact(actions: Sequence[Action]) -> str:
        Planner(graph, engine="incremental").entropies(actions)
        return ""

    def of_error(proof: Proof) -> Callable[[Sequence[Action]], str]:
        def decide(actions: Sequence[Action]) -> str:
            planner = Planner(graph, engine="incremental", objective="error", signature="resistance")
            decision = planner.decide(actions, proof=proof)
            return "" if proof == "none" else f"{len(decision.survivors)} of {len(actions)} may be the best"

        return decide

    def exact_errors(actions: Sequence[Action]) -> str:
        Planner(graph, engine="incremental", objective="error", signature="resistance").entropies(actions)
        return ""

    rows: list[MethodTime] = []
    of_entropy = (
        ("signature s_ST", ranking),
        ("signature ŝ_VN", degrees),
        ("signature and Fischer bounds", bounds("fischer")),
        ("signature and anchored bounds", bounds("anchored")),
        ("signature and chain bounds", bounds("chain")),
        ("proven optimum", optimum),
        ("exact J of all", exact),
    )
    of_errors = (
        ("signature resistance", of_error("none")),
        ("resistance and bounds of E", of_error("bounded")),
        ("proven optimum of E", of_error("optimal")),
        ("exact E of all", exact_errors),
    )
    for name, decide in (*of_entropy, *of_errors):
        progress(f"engine, {name}")
        note = ""
        seconds = np.empty((2, repetitions))
        for repetition in range(repetitions):
            for row, count in enumerate((num_actions, 2 * num_actions)):
                start = clock()
                answer = decide(session.actions[:count])
                seconds[row, repetition] = clock() - start
                note = answer if row == 0 else note
        total, double = np.median(seconds, axis=1)
        per_action = max(0.0, float(double - total)) / num_actions
        once = max(0.0, float(total) - num_actions * per_action)
        objective = "error" if (name, decide) in of_errors else "joint"
        rows.append(MethodTime(name, "engine", once, per_action, float(total), repetitions, note, objective))
    return rows


def degree_seconds(session: BenchmarkSession, *, repetitions: int, clock: Clock = time.perf_counter) -> float:
    """Seconds that the von Neumann entropy by degrees takes an action, median, once its edges stand in one array."""
    batch = ActionBatch(session.graph, session.actions)
    arrays = batch.edges, batch.edge_start, batch.num_new
    sums = DegreeSums(session.graph.topology)
    sums.of_extensions(*arrays)
    return statistics.median(_seconds(lambda: sums.of_extensions(*arrays), clock) for _ in range(repetitions)) / batch.count


def _time_baseline(
    method: Baseline, graph: PoseGraph, actions: Sequence[Action], num_actions: int, clock: Clock
) -> tuple[MethodTime, list[float]]:
    start = clock()
    ready = method.prepare(graph)
    once = clock() - start
    seconds: list[float] = []
    values: list[float] = []
    for action in actions:
        if len(seconds) >= _MIN_ACTIONS and sum(seconds) > _MAX_SECONDS:
            break
        evaluate = ready(action)
        start = clock()
        values.append(evaluate())
        seconds.append(clock() - start)
    per_action = float(np.median(seconds))
    total = once + num_actions * per_action
    return MethodTime(method.name, method.kind, once, per_action, total, len(seconds), objective=_objective(method)), values


def _objective(method: Baseline) -> Literal["joint", "error"]:
    return "error" if method.quantity == "E" else "joint"


def _deviation(method: Baseline, graph: PoseGraph, actions: Sequence[Action], found: Sequence[float]) -> float:
    """Largest relative difference from the engine's log det I or E."""
    if method.quantity == "E":
        errors = Planner(graph, objective="error", signature="resistance", engine="incremental").entropies(actions)
        return float(np.max(np.abs(errors / np.array(found) - 1)))
    kappa, log_2_pi_e = graph.tangent_dim, np.log(2 * np.pi * np.e)
    entropies = Planner(graph, anchor=anchor_of(graph)).entropies(actions)
    new = np.array([action.num_new_poses for action in actions])
    num_free = kappa * (graph.num_poses + new - 1) + graph.group.position_dim * graph.num_landmarks
    ours = num_free * log_2_pi_e - 2 * entropies
    return float(np.max(np.abs(ours - np.array(found)) / np.abs(ours)))


def _warm_up(session: BenchmarkSession) -> None:
    """A decision of every kind on the session's own types of noise, by increments, and an error from scratch."""
    expected_errors(session.graph)
    errors = Planner(session.graph, objective="error", signature="resistance", engine="incremental")
    errors.decide(session.actions[:2])
    errors.entropies(session.actions[:2])
    for family in ("fischer", "anchored", "chain"):
        planner = Planner(session.graph, bounds=family, engine="incremental", anchor=anchor_of(session.graph))
        planner.decide(session.actions[:2])
        planner.entropies(session.actions[:2])
    Planner(session.graph, signature="von_neumann_approx", engine="incremental").decide(session.actions[:2], proof="none")


def _seconds(work: Callable[[], object], clock: Clock) -> float:
    start = clock()
    work()
    return clock() - start
