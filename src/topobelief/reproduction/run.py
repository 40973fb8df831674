"""Every table and figure of the paper (arXiv 1903.00927) and those beyond it, measured part by part into a folder.

An experiment is a list of parts, a part a list of rows, and each part lands whole in a CSV file of its own: what was killed
continues where it stopped, with the same numbers. Once all parts of an experiment are there, its table is written beside them.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

from topobelief.benchmark.run import describe_machine
from topobelief.errors import FileError, InvalidInputError
from topobelief.io.files import read_text, write_text
from topobelief.io.row_files import read_rows, write_rows
from topobelief.reproduction.anytime import AnytimeRow, anytime_rows
from topobelief.reproduction.bounds_quality import BoundsRow, bounds_rows
from topobelief.reproduction.claims import Claim, claims
from topobelief.reproduction.path_length import LengthRow, length_rows
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

SCHEMA = "topobelief.reproduction/1"

R = TypeVar("R")
Progress = Callable[[str, int, int], None]
"""Called with the experiment, how many of its parts are there, and out of how many."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReproductionPlan:
    """What to measure.

    Attributes
    ----------
    seed
        The first one; all others follow from it.
    num_seeds
        Of roadmap and paths, behind the table of claims.
    num_bounds_seeds
        Of them, for what bounds are worth.
    num_timed_seeds, repetitions
        Of the times per action.
    sizes, degree_increases, num_random_graphs
        Random graphs: poses, increases of the average degree, and graphs for each pair.
    largest_spectrum
        Poses above which the exact von Neumann entropy is left out.
    num_length_paths
        Candidates in the figure of path lengths.
    files, num_real_actions
        Real pose graphs, and candidates on each.
    quick
        Whether the numbers were chosen for a first look.
    """

    seed: int = 0
    num_seeds: int = 30
    num_bounds_seeds: int = 30
    num_timed_seeds: int = 3
    repetitions: int = 7
    sizes: tuple[int, ...] = (100, 300, 1000, 3000, 10_000)
    degree_increases: tuple[float, ...] = (0.1, 0.5, 0.75, 1.0, 2.0)
    num_random_graphs: int = 10
    largest_spectrum: int = 2000
    num_length_paths: int = 60
    files: tuple[Path, ...] = ()
    num_real_actions: int = 50
    quick: bool = False

    @staticmethod
    def for_a_first_look(*, seed: int = 0, files: tuple[Path, ...] = ()) -> ReproductionPlan:
        """Few seeds and small graphs: under two minutes."""
        return ReproductionPlan(
            seed=seed,
            num_seeds=5,
            num_bounds_seeds=2,
            num_timed_seeds=1,
            repetitions=3,
            sizes=(100, 200, 400, 800, 1600),
            num_random_graphs=3,
            largest_spectrum=800,
            num_length_paths=40,
            files=files,
            num_real_actions=20,
            quick=True,
        )

    def __post_init__(self) -> None:
        for name, value, least in (
            ("seed", self.seed, 0),
            ("num_seeds", self.num_seeds, 1),
            ("num_bounds_seeds", self.num_bounds_seeds, 1),
            ("num_timed_seeds", self.num_timed_seeds, 1),
            ("repetitions", self.repetitions, 1),
            ("num_random_graphs", self.num_random_graphs, 2),
            ("num_length_paths", self.num_length_paths, 2),
            ("num_real_actions", self.num_real_actions, 2),
            *(("sizes", size, 10) for size in self.sizes),
        ):
            if value < least:
                raise InvalidInputError(f"expected {name} of at least {least}, got {value}")
        stems = [path.stem for path in self.files]
        if len(set(stems)) < len(stems):
            raise InvalidInputError(f"expected pose graphs of different names, got {', '.join(sorted(stems))}")

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON; files by their names."""
        return {**asdict(self), "files": [path.name for path in self.files]}


@dataclass(frozen=True, slots=True)
class Experiment(Generic[R]):
    """A table, and the parts that it is measured in: names of files, and what gives their rows."""

    name: str
    title: str
    kind: type[R]
    parts: dict[str, Callable[[], list[R]]]


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
    actions, bounds, times, random_graphs, lengths, real_actions, real_bounds
        Rows of the experiments.
    anytime, claims
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
    anytime: list[AnytimeRow] = field(init=False)
    claims: list[Claim] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "anytime", anytime_rows(self.actions, self.real_actions))
        object.__setattr__(self, "claims", claims(self.actions, self.times, self.random_graphs))


def experiments(plan: ReproductionPlan) -> tuple[Experiment[Any], ...]:
    """All of them, in the order in which they run: what is timed comes first, while the machine is cool."""
    seeds = range(plan.seed, plan.seed + plan.num_seeds)
    timed, bounded = seeds[: plan.num_timed_seeds], seeds[: plan.num_bounds_seeds]
    cases: list[tuple[int, SessionName, float]] = [(seed, name, xi) for seed in seeds for name in SESSIONS for xi in NOISES]
    random = [(n, dd, i) for n in plan.sizes for dd in plan.degree_increases for i in range(plan.num_random_graphs)]
    return (
        Experiment(
            "time_per_action",
            "time per action",
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
            "random pose graphs",
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
            "planning sessions",
            ActionRow,
            {
                _part(seed, name, xi): lambda seed=seed, name=name, xi=xi: action_rows(office_session(name, seed, xi))
                for seed, name, xi in cases
            },
        ),
        Experiment(
            "bounds_quality",
            "what bounds are worth",
            BoundsRow,
            {
                _part(seed, name, xi): lambda seed=seed, name=name, xi=xi: _session_bounds(seed, name, xi)
                for seed, name, xi in cases
                if seed in bounded
            },
        ),
        Experiment(
            "path_length",
            "path length",
            LengthRow,
            {f"seed{plan.seed}": lambda: length_rows(plan.seed, NOISES[1], plan.num_length_paths)},
        ),
        Experiment(
            "real_graphs",
            "real pose graphs",
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
            "bounds on real pose graphs",
            BoundsRow,
            {path.stem: lambda path=path: real_bounds_rows(path, plan.num_real_actions, plan.seed) for path in plan.files},
        ),
    )


def reproduce(plan: ReproductionPlan, folder: Path, *, progress: Progress = lambda name, done, total: None) -> Reproduction:
    """Measure all that is not in the folder yet.

    Parameters
    ----------
    plan
    folder
        Where parts and tables are kept; made where there is none.
    progress

    Raises
    ------
    InvalidInputError
        Where the folder holds a run with another plan or of another version, or a package is missing.
    FileError
        Where it cannot be written to, or a pose graph cannot be read.
    """
    for path in plan.files:
        if not path.is_file():
            raise FileError(path, "expected a pose graph to read, got no such file")
    machine, seconds = _open(folder, plan)
    tables: dict[str, list[Any]] = {}
    for experiment in experiments(plan):
        rows: list[Any] = []
        for part, done in _parts(experiment, folder / "parts" / experiment.name, progress):
            rows += part
            if done:
                seconds += done
                _note(folder, plan, machine, seconds)
        write_rows(folder / "tables" / f"{experiment.name}.csv", experiment.kind, rows)
        tables[experiment.name] = rows
    found = Reproduction(
        plan=plan,
        machine=machine,
        seconds=seconds,
        actions=tables["planning_sessions"],
        bounds=tables["bounds_quality"],
        times=tables["time_per_action"],
        random_graphs=tables["random_graphs"],
        lengths=tables["path_length"],
        real_actions=tables["real_graphs"],
        real_bounds=tables["real_bounds"],
    )
    write_rows(folder / "tables" / "anytime.csv", AnytimeRow, found.anytime)
    write_rows(folder / "tables" / "claims.csv", Claim, found.claims)
    return found


def _part(seed: int, name: str, xi: float) -> str:
    return f"seed{seed}-{name}-xi{xi:g}"


def _session_bounds(seed: int, name: SessionName, xi: float) -> list[BoundsRow]:
    session = office_session(name, seed, xi)
    return bounds_rows(name, xi, seed, session.graph, session.actions, OBJECTIVES)


def _parts(experiment: Experiment[R], folder: Path, progress: Progress) -> Iterator[tuple[Sequence[R], float]]:
    """Rows of each part, and the seconds that it took now; 0 where it was there."""
    for number, (name, measure) in enumerate(experiment.parts.items()):
        progress(experiment.title, number, len(experiment.parts))
        path = folder / f"{name}.csv"
        if path.exists():
            yield read_rows(path, experiment.kind), 0.0
            continue
        begin = time.perf_counter()
        rows = measure()
        write_rows(path, experiment.kind, rows)
        yield rows, time.perf_counter() - begin
    progress(experiment.title, len(experiment.parts), len(experiment.parts))


def _open(folder: Path, plan: ReproductionPlan) -> tuple[dict[str, str], float]:
    """The machine and the seconds spent by a run that is continued, or those of a new one."""
    machine, path = describe_machine(), folder / "run.json"
    if not path.exists():
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(folder, f"expected a folder to write to, got: {error.strerror}") from None
        _note(folder, plan, machine, 0.0)
        return machine, 0.0
    try:
        known = cast("dict[str, Any]", json.loads(read_text(path)))
        same = known["schema"] == SCHEMA and known["plan"] == json.loads(json.dumps(plan.to_dict()))
        if same and known["machine"]["topobelief"] == machine["topobelief"]:
            return known["machine"], float(known["seconds"])
    except (ValueError, KeyError, TypeError):
        raise FileError(path, "expected the settings of a run, got something else; choose another --out") from None
    raise InvalidInputError(
        f"expected {os.fspath(folder)} to hold a run with the same settings, got others; choose another --out"
    )


def _note(folder: Path, plan: ReproductionPlan, machine: dict[str, str], seconds: float) -> None:
    document = {"schema": SCHEMA, "plan": plan.to_dict(), "machine": machine, "seconds": round(seconds, 1)}
    write_text(folder / "run.json", json.dumps(document, indent=2) + "\n")
