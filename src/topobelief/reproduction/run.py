"""Every table and figure of the paper (arXiv 1903.00927) and those beyond it, measured part by part into a folder.

An experiment is a list of parts, a part a list of rows, and the parts of all experiments are the tasks of one run: what was
interrupted continues where it stopped, with the same numbers. Once all parts are there, a table is written for each experiment.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from hashlib import blake2b
from pathlib import Path
from typing import Any, Generic, TypeVar

from topobelief.errors import FileError
from topobelief.io.row_files import json_rows, rows_of_json, write_rows
from topobelief.reproduction.anytime import AnytimeRow, anytime_rows
from topobelief.reproduction.beyond_candidates import BeyondRow, BeyondSummary, beyond_rows, beyond_summaries
from topobelief.reproduction.bounds_quality import BoundsRow, bounds_rows
from topobelief.reproduction.claims import Claim, claims
from topobelief.reproduction.entropy_or_error import ChoiceRow, ChoiceSummary, choice_rows, summaries
from topobelief.reproduction.path_length import LengthRow, length_rows
from topobelief.reproduction.plan import ReproductionPlan
from topobelief.reproduction.planning_sessions import (
    NOISES,
    OBJECTIVES,
    SESSIONS,
    ActionRow,
    SessionName,
    action_rows,
    office_session,
)
from topobelief.reproduction.random_graphs import RandomGraphRow, random_graph_row
from topobelief.reproduction.real_graphs import RealActionRow, real_action_rows, real_bounds_rows
from topobelief.reproduction.time_per_action import TimeRow, time_rows
from topobelief.runs.attempt import Executor
from topobelief.runs.journal import Journal
from topobelief.runs.lock import alone
from topobelief.runs.machine import describe_machine
from topobelief.runs.run import OnProgress, UnfinishedRunError, run_tasks

R = TypeVar("R")


@dataclass(frozen=True, slots=True)
class Experiment(Generic[R]):
    """A table, and the parts that it is measured in, by name, each with what gives its rows."""

    name: str
    kind: type[R]
    parts: dict[str, Callable[[], list[R]]]


@dataclass(frozen=True, slots=True)
class Part:
    """A part of an experiment, as a task."""

    plan: ReproductionPlan
    experiment: str
    name: str

    @property
    def id(self) -> str:
        """Of this plan's parts, it alone."""
        return f"{self.experiment}/{self.name}"


def measure(part: Part) -> list[Any]:
    """The rows of a part."""
    (experiment,) = (each for each in experiments(part.plan) if each.name == part.experiment)
    return experiment.parts[part.name]()


@dataclass(frozen=True, eq=False, slots=True)
class Reproduction:
    """All that was measured.

    Attributes
    ----------
    plan
    machine
        Processor, cores, system, versions.
    seconds
        Spent on measuring, over all runs.
    actions, bounds, times, random_graphs, lengths, real_actions, real_bounds, choices, beyond
        Rows of the experiments.
    anytime, choice_summaries, beyond_summaries, claims
        What follows from them.
    """

    plan: ReproductionPlan
    machine: dict[str, str]
    seconds: float
    actions: list[ActionRow]
    bounds: list[BoundsRow]
    times: list[TimeRow]
    random_graphs: list[RandomGraphRow]
    lengths: list[LengthRow]
    real_actions: list[RealActionRow]
    real_bounds: list[BoundsRow]
    choices: list[ChoiceRow]
    beyond: list[BeyondRow]
    anytime: list[AnytimeRow] = field(init=False)
    choice_summaries: list[ChoiceSummary] = field(init=False)
    beyond_summaries: list[BeyondSummary] = field(init=False)
    claims: list[Claim] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "anytime", anytime_rows(self.actions, self.real_actions))
        object.__setattr__(self, "choice_summaries", summaries(self.choices))
        object.__setattr__(self, "beyond_summaries", beyond_summaries(self.beyond))
        object.__setattr__(self, "claims", claims(self.actions, self.times, self.random_graphs, self.choices))


def experiments(plan: ReproductionPlan) -> tuple[Experiment[Any], ...]:
    """All of them, in the order in which they run: what is timed comes first, while the machine is cool."""
    seeds = range(plan.seed, plan.seed + plan.num_seeds)
    timed, bounded = seeds[: plan.num_timed_seeds], seeds[: plan.num_bounds_seeds]
    cases: list[tuple[int, SessionName, float]] = [(seed, name, xi) for seed in seeds for name in SESSIONS for xi in NOISES]
    decided: list[tuple[str | Path, int]] = [
        *((place, plan.seed + i) for i in range(plan.num_error_seeds) for place in plan.error_maps),
        *((path, plan.seed + i) for i in range(plan.num_real_error_seeds) for path in plan.files),
    ]
    random = [(n, dd, i) for n in plan.sizes for dd in plan.degree_increases for i in range(plan.num_random_graphs)]
    return (
        Experiment(
            "time_per_action",
            TimeRow,
            {
                _part(seed, name, xi): lambda seed=seed, name=name, xi=xi: time_rows(
                    office_session(name, seed, xi), repetitions=plan.repetitions
                )
                for seed, name, xi in cases
                if seed in timed
            },
        ),
        Experiment(
            "random_graphs",
            RandomGraphRow,
            {
                f"n{n}-dd{dd:g}-{i}": lambda n=n, dd=dd, i=i: [
                    random_graph_row(n, dd, i, plan.seed, largest_spectrum=plan.largest_spectrum)
                ]
                for n, dd, i in random
            },
        ),
        Experiment(
            "planning_sessions",
            ActionRow,
            {
                _part(seed, name, xi): lambda seed=seed, name=name, xi=xi: action_rows(office_session(name, seed, xi))
                for seed, name, xi in cases
            },
        ),
        Experiment(
            "bounds_quality",
            BoundsRow,
            {
                _part(seed, name, xi): lambda seed=seed, name=name, xi=xi: _session_bounds(seed, name, xi)
                for seed, name, xi in cases
                if seed in bounded
            },
        ),
        Experiment(
            "path_length",
            LengthRow,
            {f"seed{plan.seed}": lambda: length_rows(plan.seed, NOISES[1], plan.num_length_paths)},
        ),
        Experiment(
            "real_graphs",
            RealActionRow,
            {
                path.stem: lambda path=path: real_action_rows(
                    path, plan.num_real_actions, plan.seed, largest_spectrum=plan.largest_spectrum
                )
                for path in plan.files
            },
        ),
        Experiment(
            "real_bounds",
            BoundsRow,
            {path.stem: lambda path=path: real_bounds_rows(path, plan.num_real_actions, plan.seed) for path in plan.files},
        ),
        Experiment(
            "entropy_or_error",
            ChoiceRow,
            {
                f"{place.stem if isinstance(place, Path) else place}-seed{seed}": lambda place=place, seed=seed: choice_rows(
                    place, seed, plan.num_error_paths, largest=plan.largest_spectrum
                )
                for place, seed in decided
            },
        ),
        Experiment(
            "beyond_candidates",
            BeyondRow,
            {
                f"seed{seed}-xi{xi:g}": lambda seed=seed, xi=xi: beyond_rows(
                    seed, xi, plan.beyond_detours, plan.num_beyond_paths, plan.num_beyond_evaluations
                )
                for seed in range(plan.seed, plan.seed + plan.num_beyond_seeds)
                for xi in plan.beyond_noises
            },
        ),
    )


def reproduce(
    plan: ReproductionPlan, folder: Path, executor: Executor, *, on_progress: OnProgress = lambda _: None
) -> Reproduction:
    """Measure all that is not in the folder yet.

    Parameters
    ----------
    plan
    folder
        Where the journal and the tables are kept; made where there is none.
    executor
        What measures is timed, so that it should do one part at a time.
    on_progress
        Called at the start and after each part.

    Raises
    ------
    FileError
        Where the folder holds a run with another plan or of another version, or cannot be written to, or a pose graph cannot
        be read.
    UnfinishedRunError
        Where parts failed; called again, it tries them again.
    """
    for path in plan.files:
        if not path.is_file():
            raise FileError(path, "expected a pose graph to read, got no such file")
    machine, all_experiments = describe_machine(), experiments(plan)
    tasks = [Part(plan, experiment.name, name) for experiment in all_experiments for name in experiment.parts]
    with alone(folder):
        journal: Journal[Part, list[Any]] = Journal(
            folder / "journal.jsonl", _settings(plan, machine["topobelief"]), json_rows, about=machine
        )
        outcome = run_tasks(tasks, measure, journal, executor, retry_failed=True, on_progress=on_progress)
        if outcome.num_failed:
            raise UnfinishedRunError(
                f"expected all {outcome.num_tasks} parts to be measured, got {outcome.num_failed} that failed, the first with "
                f"{outcome.first_error}; run the same command to try them again"
            )
        tables: dict[str, list[Any]] = {}
        for experiment in all_experiments:
            ids = (Part(plan, experiment.name, name).id for name in experiment.parts)
            tables[experiment.name] = [row for task in ids for row in rows_of_json(experiment.kind, journal.result(task))]
            write_rows(folder / "tables" / f"{experiment.name}.csv", experiment.kind, tables[experiment.name])
        found = Reproduction(
            plan=plan,
            machine=journal.about,
            seconds=journal.seconds,
            actions=tables["planning_sessions"],
            bounds=tables["bounds_quality"],
            times=tables["time_per_action"],
            random_graphs=tables["random_graphs"],
            lengths=tables["path_length"],
            real_actions=tables["real_graphs"],
            real_bounds=tables["real_bounds"],
            choices=tables["entropy_or_error"],
            beyond=tables["beyond_candidates"],
        )
        write_rows(folder / "tables" / "anytime.csv", AnytimeRow, found.anytime)
        write_rows(folder / "tables" / "entropy_or_error_summary.csv", ChoiceSummary, found.choice_summaries)
        write_rows(folder / "tables" / "beyond_candidates_summary.csv", BeyondSummary, found.beyond_summaries)
        write_rows(folder / "tables" / "claims.csv", Claim, found.claims)
    return found


def _settings(plan: ReproductionPlan, version: str) -> dict[str, object]:
    """What the numbers depend on: the plan, what is in its files, and the version."""
    digests = {path.name: blake2b(path.read_bytes(), digest_size=16).hexdigest() for path in plan.files}
    return {**plan.to_dict(), "files": digests, "topobelief": version}


def _part(seed: int, name: str, xi: float) -> str:
    return f"seed{seed}-{name}-xi{xi:g}"


def _session_bounds(seed: int, name: SessionName, xi: float) -> list[BoundsRow]:
    session = office_session(name, seed, xi)
    return bounds_rows(name, xi, seed, session.graph, session.actions, OBJECTIVES)
