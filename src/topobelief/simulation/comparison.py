"""Strategies compared on expectations: each recorded graph gets the injected noise again and again.

One draw of noise says little about a choice, since errors of a pose graph spread by a factor of two. So the runs of a seed
share all sessions but the last, each strategy drives that one, and of each graph that comes out the error is the mean over many
redraws of N(0, diag(sigma_p², sigma_p², sigma_theta²)) on its registered factors. The k-th draw is the same for the factors
that graphs share.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import InvalidInputError
from topobelief.estimation import optimize
from topobelief.graph.pose_graph import PoseGraph
from topobelief.simulation.episode import Episode
from topobelief.simulation.metrics import trajectory_error
from topobelief.simulation.noise import InjectedNoise
from topobelief.simulation.record import Record, RunOptions
from topobelief.simulation.scenario import Scenario

SHARED_STRATEGY = "shortest"
"""How the sessions are driven that all compared runs share."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedRun:
    """One strategy's last session on one seed.

    Attributes
    ----------
    seed, strategy
    outcome
        "arrived", or why not; errors are those of what was driven.
    planned, shortest
        Length of the chosen path, the first where the robot chose again, and of the shortest candidate, metres.
    num_poses, num_shared
        Poses in all, and those that stood before the session.
    num_closures
        That the front end made in the session.
    entropy
        The objective of the chosen path, nats.
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
    planned: float
    shortest: float
    num_poses: int
    num_shared: int
    num_closures: int
    entropy: float
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
    planned, num_closures, entropy, error_shared, error_all, error_before
        Medians over the seeds.
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
    entropy: float
    error_shared: float
    error_all: float
    error_before: float
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


def compared_records(scenario: Scenario, options: RunOptions, strategies: Sequence[str]) -> Iterator[Record]:
    """One run per strategy, all of which share all sessions but the last.

    Parameters
    ----------
    scenario
    options
        All but the strategy.
    strategies
    """
    last = len(scenario.goals)
    history = None
    if last > 1 or scenario.approach:
        shared = Episode(scenario, replace(options, strategy=SHARED_STRATEGY)).run(last_goal=last - 1)
        history = shared.history
        if shared.num_goals_reached < last - 1:
            yield shared
            return
    for strategy in strategies:
        yield Episode(scenario, replace(options, strategy=strategy), history=history).run()


def compared_run(record: Record, noise: InjectedNoise, *, num_redraws: int) -> ComparedRun:
    """What a record comes to under redrawn noise."""
    legs = [leg for leg in record.legs if leg.goal == len(record.scenario.goals)]
    options = record.options
    num_poses = len(record.truth)
    num_shared = legs[0].first_pose + 1 if legs else num_poses
    seed = options.seed
    errors = redrawn_errors(
        record.registered, record.truth, noise, num_redraws=num_redraws, seed=seed, num_poses=(num_shared, num_poses)
    )
    before = redrawn_errors(
        restricted(record.registered, num_shared),
        record.truth[:num_shared],
        noise,
        num_redraws=num_redraws,
        seed=seed,
        num_poses=(num_shared,),
    )
    deliberation = next(
        (each for each in record.deliberations if record.legs[each.leg].goal == len(record.scenario.goals)), None
    )
    return ComparedRun(
        seed=seed,
        strategy=options.strategy,
        outcome=record.outcome,
        planned=legs[0].planned if legs else float("nan"),
        shortest=float(deliberation.lengths.min()) if deliberation else float("nan"),
        num_poses=num_poses,
        num_shared=num_shared,
        num_closures=sum(leg.num_closures for leg in legs),
        entropy=legs[0].predicted_entropy if legs else float("nan"),
        error_shared=float(errors[:, 0].mean()),
        error_all=float(errors[:, 1].mean()),
        spread_shared=float(errors[:, 0].std()),
        error_before=float(before.mean()),
    )


def summarised(runs: Sequence[ComparedRun], *, baseline: str = SHARED_STRATEGY) -> list[StrategySummary]:
    """One line per strategy, in the order in which they first appear; gains are nan without the baseline."""
    reference = {run.seed: run for run in runs if run.strategy == baseline}
    found: list[StrategySummary] = []
    for strategy in dict.fromkeys(run.strategy for run in runs):
        mine = [run for run in runs if run.strategy == strategy]
        pairs: FloatArray = np.array(
            [(run.error_shared, reference[run.seed].error_shared) for run in mine if run.seed in reference]
        )
        gain = better = same = float("nan")
        if len(pairs):
            gain = 1 - _median(pairs[:, 0].tolist()) / _median(pairs[:, 1].tolist())
            same = float(np.mean(np.equal(pairs[:, 0], pairs[:, 1])))
            better = float(np.mean(np.less(pairs[:, 0], pairs[:, 1])))
        medians = {
            name: _median([float(getattr(run, name)) for run in mine])
            for name in ("planned", "num_closures", "entropy", "error_shared", "error_all", "error_before")
        }
        found.append(
            StrategySummary(
                strategy=strategy,
                num_runs=len(mine),
                num_arrived=sum(run.outcome == "arrived" for run in mine),
                gain=gain,
                share_better=better,
                share_same=same,
                **medians,
            )
        )
    return found


def _median(values: Sequence[float]) -> float:
    return float(np.median(np.array(values)))
