"""Strategies compared on expectations: each recorded graph gets the injected noise again and again.

One draw of noise says little about a choice, since errors of a pose graph spread by a factor of two. So the runs of a seed
share all sessions but the last, each strategy drives that one, and of each graph that comes out the error is the mean over many
redraws of N(0, diag(sigma_p², sigma_p², sigma_theta²)) on its registered factors. The k-th draw is the same for the factors
that graphs share. Strategies that choose the same path share its drive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import InvalidInputError, require_choice
from topobelief.estimation import optimize
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.registry import OBJECTIVES
from topobelief.simulation.episode import Episode
from topobelief.simulation.metrics import trajectory_error
from topobelief.simulation.noise import InjectedNoise
from topobelief.simulation.record import ARRIVED, History, Leg, Record, RunOptions
from topobelief.simulation.scenario import Scenario
from topobelief.strategies.choose import choose
from topobelief.strategies.question import Question
from topobelief.strategies.registry import checked_strategy, proposes

SHARED_STRATEGY = "shortest"
"""How the sessions are driven that all compared runs share."""
HINDSIGHT = "hindsight"
"""In a comparison, in place of a strategy: all candidates are driven, and the one that left the least error is taken."""


def compared_strategy(name: str) -> str:
    """The name of what can be compared, as it is.

    It is a strategy, a strategy with an objective of its own ("spanning_trees:joint"), or `HINDSIGHT`.

    Raises
    ------
    InvalidInputError
        For anything else.
    """
    if name != HINDSIGHT:
        strategy, colon, objective = name.partition(":")
        checked_strategy(strategy)
        if colon:
            require_choice("objective", objective, OBJECTIVES)
    return name


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedRun:
    """One strategy's last session on one seed.

    Attributes
    ----------
    seed, strategy
        The latter as in `compared_strategy`, or "path-k" for a candidate that was driven for the sake of `HINDSIGHT`.
    outcome
        "arrived", or why not; errors are those of what was driven.
    chosen, num_candidates
        The former counts from 0, shortest first; both 0 where there were none.
    planned, shortest
        Length of the chosen path, the first where the robot chose again, and of the shortest candidate, metres.
    num_poses, num_shared
        Poses in all, and those that stood before the session.
    num_closures
        That the front end made in the session.
    predicted
        The objective of the comparison for the chosen path, in its unit, whatever the strategy looked at.
    error_shared, error_all
        Mean trajectory error over the redraws on the poses that the runs share, and on all, metres.
    spread_shared
        Standard deviation of the former over the redraws.
    error_before
        The same as `error_shared` before the session was driven.
    """

    seed: int
    strategy: str
    outcome: str
    chosen: int
    num_candidates: int
    planned: float
    shortest: float
    num_poses: int
    num_shared: int
    num_closures: int
    predicted: float
    error_shared: float
    error_all: float
    spread_shared: float
    error_before: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StrategySummary:
    """A strategy over all seeds, beside a baseline on the same seeds.

    Attributes
    ----------
    strategy
    num_runs, num_arrived
    planned, num_closures, predicted, error_shared, error_all, error_before
        Medians over the seeds.
    saved
        By how much error_shared is less than the baseline's on the same seed, metres, median.
    gain
        1 - median error_shared / that of the baseline.
    share_better
        Of the seeds, those in which error_shared is less than the baseline's.
    share_same
        Of the seeds, those in which both are equal, as where both chose the same path.
    """

    strategy: str
    num_runs: int
    num_arrived: int
    planned: float
    num_closures: float
    predicted: float
    error_shared: float
    error_all: float
    error_before: float
    saved: float
    gain: float
    share_better: float
    share_same: float


def redrawn_errors(
    registered: PoseGraph, truth: FloatArray, noise: InjectedNoise, *, num_redraws: int, seed: int, num_poses: Sequence[int]
) -> FloatArray:
    """Trajectory errors of the maximum-likelihood estimates under redrawn noise, metres.

    Parameters
    ----------
    registered : PoseGraph
        Its measurements are disturbed, its information replaced.
    truth : shape (n, 3)
    noise
    num_redraws, seed
        Draw k of a seed begins the same for graphs that begin with the same edges.
    num_poses
        Errors are taken on the first so many poses, once for each number.

    Returns
    -------
    shape (num_redraws, len(num_poses))
    """
    if num_redraws < 1:
        raise InvalidInputError(f"expected at least 1 redraw, got {num_redraws}")
    errors = np.empty((num_redraws, len(num_poses)))
    for draw in range(num_redraws):
        measurements = noise.disturbed(registered.measurements, rng=np.random.default_rng([seed, draw]))
        estimate = optimize(PoseGraph(registered.poses, registered.edges, measurements, noise.information)).poses
        errors[draw] = [trajectory_error(estimate, truth, num_poses=count) for count in num_poses]
    return errors


def restricted(graph: PoseGraph, num_poses: int) -> PoseGraph:
    """The first poses and the edges among them."""
    among = (graph.edges < num_poses).all(axis=1)
    return PoseGraph(graph.poses[:num_poses], graph.edges[among], graph.measurements[among], graph.information[among])


def compared_runs(
    scenario: Scenario, options: RunOptions, strategies: Sequence[str], noise: InjectedNoise, *, num_redraws: int
) -> list[ComparedRun]:
    """One run per strategy, all of which share all sessions but the last; after them one per candidate, for `HINDSIGHT`.

    Where a shared session does not reach its goal there is one run, of what was driven.

    Parameters
    ----------
    scenario
    options
        All but the strategy.
    strategies
        As `compared_strategy` takes them.
    noise, num_redraws
        As for `redrawn_errors`.
    """
    last = len(scenario.goals)
    history = None
    if last > 1 or scenario.approach:
        shared = Episode(scenario, replace(options, strategy=SHARED_STRATEGY)).run(last_goal=last - 1)
        history = shared.history
        if shared.num_goals_reached < last - 1:
            return [_Seed(scenario, options, history, noise, num_redraws).run_of(shared, SHARED_STRATEGY)]
    seed = _Seed(scenario, options, history, noise, num_redraws)
    found = {name: seed.run(name) for name in strategies if name != HINDSIGHT}
    if HINDSIGHT not in strategies:
        return list(found.values())
    first = seed.run(SHARED_STRATEGY)
    every = {f"path-{index}": seed.run(f"path-{index}") for index in range(max(1, first.num_candidates))}
    arrived = [run for run in every.values() if run.outcome == ARRIVED] or [first]
    found[HINDSIGHT] = replace(min(arrived, key=lambda run: run.error_shared), strategy=HINDSIGHT)
    return [*(found[name] for name in strategies), *(run for name, run in every.items() if name not in found)]


class _Seed:
    """The last session of a seed, which strategies decide on alike.

    Parameters
    ----------
    scenario, options, noise, num_redraws
        As for `compared_runs`.
    history
        The sessions before; None where the scenario has one goal.
    """

    def __init__(
        self, scenario: Scenario, options: RunOptions, history: History | None, noise: InjectedNoise, num_redraws: int
    ) -> None:
        self._scenario, self._options, self._history = scenario, options, history
        self._noise, self._num_redraws = noise, num_redraws
        self._question: Question | None = None
        self._error_before: float | None = None
        self._driven: dict[int, ComparedRun] = {}  # by candidate, where the robot decided once

    def run(self, name: str) -> ComparedRun:
        """What a strategy comes to."""
        strategy, _, own = name.partition(":")
        options = replace(self._options, strategy=strategy, objective=own or self._options.objective)
        if self._question is not None and not proposes(strategy):
            index = choose(strategy, replace(self._question, objective=options.objective)).index
            if index in self._driven:
                return replace(self._driven[index], strategy=name)
        return self.run_of(Episode(self._scenario, options, history=self._history).run(), name)

    def run_of(self, record: Record, name: str) -> ComparedRun:
        """What a record comes to under redrawn noise."""
        goal = len(self._scenario.goals)
        legs = [leg for leg in record.legs if leg.goal == goal]
        deliberation = next((each for each in record.deliberations if record.legs[each.leg].goal == goal), None)
        question = None if deliberation is None else replace(deliberation.question, objective=self._options.objective)
        is_shared = deliberation is not None and deliberation.choice.proposal is None
        if self._question is None and is_shared:
            self._question = question
        chosen = legs[0].chosen if question is not None else 0
        num_poses = len(record.truth)
        num_shared = legs[0].first_pose + 1 if legs else num_poses
        errors = self._errors(record.registered, record.truth, num_shared, num_poses)
        if self._error_before is None:
            before = self._errors(restricted(record.registered, num_shared), record.truth[:num_shared], num_shared)
            self._error_before = float(before.mean())
        run = ComparedRun(
            seed=self._options.seed,
            strategy=name,
            outcome=record.outcome,
            chosen=chosen,
            num_candidates=0 if question is None else len(question.actions),
            planned=legs[0].planned if legs else float("nan"),
            shortest=float(question.lengths.min()) if question is not None else float("nan"),
            num_poses=num_poses,
            num_shared=num_shared,
            num_closures=sum(leg.num_closures for leg in legs),
            predicted=float("nan") if question is None else float(question.planner().entropies([question.actions[chosen]])[0]),
            error_shared=float(errors[:, 0].mean()),
            error_all=float(errors[:, -1].mean()),
            spread_shared=float(errors[:, 0].std()),
            error_before=self._error_before,
        )
        if is_shared and _in_one_go(legs):
            self._driven[chosen] = run
        return run

    def _errors(self, graph: PoseGraph, truth: FloatArray, *num_poses: int) -> FloatArray:
        seed = self._options.seed
        return redrawn_errors(graph, truth, self._noise, num_redraws=self._num_redraws, seed=seed, num_poses=num_poses)


def _in_one_go(legs: Sequence[Leg]) -> bool:
    """Whether the robot decided once; where it decided again, another strategy may choose otherwise."""
    return len(legs) == 1


def summarised(runs: Sequence[ComparedRun], *, baseline: str = SHARED_STRATEGY) -> list[StrategySummary]:
    """One line per strategy, in the order in which they first appear; gains are nan without the baseline."""
    reference = {run.seed: run for run in runs if run.strategy == baseline}
    found: list[StrategySummary] = []
    for strategy in dict.fromkeys(run.strategy for run in runs):
        mine = [run for run in runs if run.strategy == strategy]
        pairs: FloatArray = np.array(
            [(run.error_shared, reference[run.seed].error_shared) for run in mine if run.seed in reference]
        )
        saved = gain = better = same = float("nan")
        if len(pairs):
            saved = _median((pairs[:, 1] - pairs[:, 0]).tolist())
            gain = 1 - _median(pairs[:, 0].tolist()) / _median(pairs[:, 1].tolist())
            same = float(np.mean(np.equal(pairs[:, 0], pairs[:, 1])))
            better = float(np.mean(np.less(pairs[:, 0], pairs[:, 1])))
        medians = {
            name: _median([float(getattr(run, name)) for run in mine])
            for name in ("planned", "num_closures", "predicted", "error_shared", "error_all", "error_before")
        }
        found.append(
            StrategySummary(
                strategy=strategy,
                num_runs=len(mine),
                num_arrived=sum(run.outcome == "arrived" for run in mine),
                saved=saved,
                gain=gain,
                share_better=better,
                share_same=same,
                **medians,
            )
        )
    return found


def _median(values: Sequence[float]) -> float:
    return float(np.median(np.array(values)))
