"""Strategies compared over seeds, in processes of their own, seed by seed, and what is there is not driven again."""

from __future__ import annotations

import csv
import io
import signal
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, astuple, dataclass, fields, replace
from multiprocessing import get_context
from pathlib import Path

from topobelief.errors import FileError, InvalidInputError
from topobelief.io.files import StrPath, read_text, write_text
from topobelief.simulation.comparison import ComparedRun, compared_records, compared_run
from topobelief.simulation.record import RunOptions
from topobelief.simulation.scenario_file import scenario_of, with_detour

_READERS: dict[str, Callable[[str], object]] = {"int": int, "str": str, "float": float}  # by annotation


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonTask:
    """What is compared.

    Attributes
    ----------
    scenario
        A name, or the path of a YAML file.
    max_detour
        See `scenario_file.with_detour`.
    strategies
        The first is the baseline.
    options
        Of all runs; the strategy and the seed are replaced, and the noise, which must be injected, is redrawn.
    num_redraws
    """

    scenario: str
    max_detour: float | None
    strategies: tuple[str, ...]
    options: RunOptions
    num_redraws: int

    def described(self) -> dict[str, object]:
        """For JSON, and to tell whether two tasks are the same."""
        plain = asdict(self)
        return {**plain, "strategies": list(self.strategies)}


def play(task: ComparisonTask, seed: int) -> list[ComparedRun]:
    """All strategies on one seed.

    Raises
    ------
    InvalidInputError
        For physical noise.
    """
    noise = task.options.noise
    if noise is None:
        raise InvalidInputError("expected injected noise to redraw, got physical noise, of which there is one draw a run")
    scenario = with_detour(scenario_of(task.scenario), task.max_detour)
    records = compared_records(scenario, replace(task.options, seed=seed), task.strategies)
    return [compared_run(record, noise, num_redraws=task.num_redraws) for record in records]


def played(task: ComparisonTask, seeds: list[int], *, num_workers: int) -> Iterator[list[ComparedRun]]:
    """Seed by seed, as they are done."""
    if num_workers == 1:
        yield from (play(task, seed) for seed in seeds)
        return
    with _pool(num_workers) as pool:
        for future in as_completed([pool.submit(play, task, seed) for seed in seeds]):
            yield future.result()


@contextmanager
def _pool(num_workers: int) -> Generator[ProcessPoolExecutor]:
    """Processes that leave Ctrl-C to this one; where the block fails, tasks that have not begun are dropped."""
    pool = ProcessPoolExecutor(
        num_workers,
        mp_context=get_context("spawn"),
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_IGN),
    )
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def write_runs(path: StrPath, runs: list[ComparedRun]) -> None:
    """Runs as CSV, a line each, whole or not at all."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([field.name for field in fields(ComparedRun)])
    writer.writerows(astuple(run) for run in sorted(runs, key=lambda run: run.seed))
    write_text(path, text.getvalue())


def read_runs(path: StrPath) -> list[ComparedRun]:
    """What `write_runs` wrote.

    Raises
    ------
    FileError
        Names the file and the line.
    """
    rows = csv.DictReader(io.StringIO(read_text(path)))
    readers = {field.name: _READERS[str(field.type)] for field in fields(ComparedRun)}
    runs: list[ComparedRun] = []
    for row in rows:
        try:
            runs.append(ComparedRun(**{name: read(row[name]) for name, read in readers.items()}))  # pyright: ignore[reportArgumentType]
        except (KeyError, TypeError, ValueError) as error:
            raise FileError(Path(path), f"expected a compared run, got a bad value: {error}", line=rows.line_num) from None
    return runs
