"""Strategies compared on a scenario over many seeds, as a run: a seed is a task, and its result one run for each strategy."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from hashlib import blake2b
from importlib.metadata import version
from pathlib import Path

from topobelief.errors import InvalidInputError
from topobelief.io.row_files import json_rows, rows_of_json
from topobelief.runs.attempt import Executor
from topobelief.runs.journal import Journal
from topobelief.runs.lock import alone
from topobelief.runs.run import OnProgress, UnfinishedRunError, run_tasks
from topobelief.simulation.comparison import ComparedRun, StrategySummary, compared_runs, summarised
from topobelief.simulation.noise import InjectedNoise
from topobelief.simulation.record import RunOptions
from topobelief.simulation.scenario import Scenario
from topobelief.simulation.scenario_file import Closures, scenario_of, with_closures, with_detour


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonTask:
    """What is compared.

    Attributes
    ----------
    scenario
        A name, or the path of a YAML file.
    max_detour, closures
        See `scenario_file.with_detour` and `with_closures`.
    strategies
        As `comparison.compared_strategy` takes them; the first is the baseline.
    options
        Of all runs; the strategy and the seed are replaced, and the noise, which must be injected, is redrawn.
    num_redraws
    """

    scenario: str
    max_detour: float | None
    strategies: tuple[str, ...]
    options: RunOptions
    num_redraws: int
    closures: Closures | None = None

    def __post_init__(self) -> None:
        _ = self.noise

    @property
    def noise(self) -> InjectedNoise:
        """What is redrawn.

        Raises
        ------
        InvalidInputError
            For physical noise.
        """
        if self.options.noise is None:
            raise InvalidInputError("expected injected noise to redraw, got physical noise, of which there is one draw a run")
        return self.options.noise

    @property
    def place(self) -> Scenario:
        """The scenario with what the comparison changes in it."""
        return with_closures(with_detour(scenario_of(self.scenario), self.max_detour), self.closures)

    def described(self) -> dict[str, object]:
        """For JSON, and to tell whether two tasks are the same."""
        plain = asdict(self)
        return {**plain, "strategies": list(self.strategies)}


@dataclass(frozen=True, slots=True)
class SeedTask:
    """One seed of a comparison."""

    comparison: ComparisonTask
    seed: int

    @property
    def id(self) -> str:
        """Of this comparison's seeds, it alone."""
        return f"seed {self.seed}"


@dataclass(frozen=True, slots=True)
class Comparison:
    """What a comparison found.

    Attributes
    ----------
    task
    runs
        By seed, then in the order of the strategies, then those of the candidates that only hindsight asked for.
    failed
        Why seeds failed, by seed; they have no runs.
    num_seeds_now
        Driven by this call; the others were in the folder.
    """

    task: ComparisonTask
    runs: tuple[ComparedRun, ...]
    failed: dict[int, str]
    num_seeds_now: int

    @property
    def summaries(self) -> list[StrategySummary]:
        """One line for each strategy that was asked for."""
        asked = [run for run in self.runs if run.strategy in self.task.strategies]
        return summarised(asked, baseline=self.task.strategies[0])


def play(task: SeedTask) -> list[ComparedRun]:
    """All strategies on one seed."""
    comparison = task.comparison
    options = replace(comparison.options, seed=task.seed)
    return compared_runs(comparison.place, options, comparison.strategies, comparison.noise, num_redraws=comparison.num_redraws)


def compare(
    task: ComparisonTask,
    num_seeds: int,
    folder: Path,
    executor: Executor,
    *,
    retry_failed: bool = False,
    on_progress: OnProgress = lambda _: None,
) -> Comparison:
    """Drive all seeds that the folder does not have yet.

    Parameters
    ----------
    task
    num_seeds
        Seeds are 0, 1, ... A later call may ask for more.
    folder
        Where the journal is kept; made where there is none.
    executor
    retry_failed
        Whether seeds that failed earlier are driven again.
    on_progress
        Called at the start and after each seed.

    Raises
    ------
    FileError
        Where the folder holds another comparison, another process is using it, or it cannot be written to.
    UnfinishedRunError
        Where every seed failed.
    """
    settings = {**task.described(), "content": _digest(task.place), "topobelief": version("topobelief")}
    tasks = [SeedTask(task, seed) for seed in range(num_seeds)]
    with alone(folder):
        journal: Journal[SeedTask, list[ComparedRun]] = Journal(folder / "journal.jsonl", settings, json_rows)
        outcome = run_tasks(tasks, play, journal, executor, retry_failed=retry_failed, on_progress=on_progress)
    errors = {each.seed: journal.error(each.id) for each in tasks}
    failed = {seed: error for seed, error in errors.items() if error is not None}
    if len(failed) == num_seeds:
        raise UnfinishedRunError(f"expected seeds that can be driven, got {num_seeds} that failed, the first with {failed[0]}")
    runs = [run for each in tasks if each.seed not in failed for run in rows_of_json(ComparedRun, journal.result(each.id))]
    return Comparison(task, tuple(runs), failed, outcome.num_done_now)


def _digest(scenario: Scenario) -> str:
    """Of all that a scenario's name or file stands for."""
    rest = [getattr(scenario, field.name) for field in fields(Scenario) if field.name != "world"]
    return blake2b(f"{scenario.world.digest} {rest}".encode(), digest_size=16).hexdigest()
