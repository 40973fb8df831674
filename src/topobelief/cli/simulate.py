"""`topobelief simulate`: a robot, a laser, walls, and decisions that show in the map; `simulate-compare` compares them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from topobelief.cli.choices import completed, one_of
from topobelief.cli.run_options import DEFAULT_TIMEOUT, RetryFailed, Timeout
from topobelief.planning.registry import OBJECTIVES, default_signature, unit_of

if TYPE_CHECKING:
    from topobelief.simulation.exploration import TripOptions

_SCENARIO_HELP = "office, lab, corridors, or a .yaml of your own."
ObjectiveName = Annotated[
    str | None,
    typer.Option(
        callback=one_of(OBJECTIVES),
        autocompletion=completed(OBJECTIVES),
        help="What to minimise: error, the expected error of the map; or an entropy: joint, of all poses (the paper's); "
        "map, of existing poses; per_pose.",
        show_default="the scenario's: error",
    ),
]
ClosuresName = Annotated[
    Literal["learned", "paper"] | None,
    typer.Option(
        help="Loop closures to predict: learned, as the robot's own front end makes them; or by the rule of the paper.",
        show_default="the scenario's: learned",
    ),
]
AsPaper = Annotated[
    bool,
    typer.Option("--as-paper", help="Decide as in the paper, unless other options are given: joint, spanning_trees, paper."),
]
MaxDetour = Annotated[
    float | None,
    typer.Option(
        metavar="FACTOR",
        help="Longest path, as a multiple of the shortest; 0 for no limit.",
        show_default="the scenario's",
        min=0,
    ),
]
_NOISE_HELP = 'physical; or injected: the ratio ξ = σ_θ/σ_p at σ_p = 0.1 m, such as 0.35, or "σ_p,σ_θ" in m and rad.'


def simulate(
    scenario: Annotated[str, typer.Argument(metavar="SCENARIO", help=_SCENARIO_HELP)],
    strategy: Annotated[
        str | None,
        typer.Option(
            help="A signature: resistance, spanning_trees, von_neumann_approx or von_neumann; optimum (proven), standard (all "
            "exact), roadmap (the best way of the whole roadmap), shortest, random, or path-k: path-0 is the shortest path.",
            show_default="resistance for error, else spanning_trees",
        ),
    ] = None,
    objective: ObjectiveName = None,
    closures: ClosuresName = None,
    as_paper: AsPaper = False,
    seed: Annotated[int, typer.Option(min=0, help="Random seed; the same seed gives the same run.")] = 0,
    noise: Annotated[str, typer.Option(help=_NOISE_HELP)] = "physical",
    unknown: Annotated[bool, typer.Option("--unknown", help="Start with an empty map instead of the floor plan.")] = False,
    max_detour: MaxDetour = None,
    explore: Annotated[
        bool, typer.Option("--explore", help="After the goals: trips that improve the map most, until none gains enough.")
    ] = False,
    max_length: Annotated[
        float | None,
        typer.Option(metavar="M", help="With --explore: longest trip, metres.", show_default=False),
    ] = None,
    return_to_start: Annotated[bool, typer.Option("--return", help="With --explore: each trip ends where it begins.")] = False,
    enough: Annotated[
        float | None,
        typer.Option(
            metavar="GAIN",
            help="With --explore: end when it is proven that no trip gains more, in the unit of the objective (metres, nats).",
            show_default="0",
        ),
    ] = None,
    trips: Annotated[
        int | None,
        typer.Option(min=0, metavar="N", help="With --explore: end after so many trips.", show_default="10"),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue the run in --out from its last key pose.")] = False,
    displaced: Annotated[
        float, typer.Option(help="With --resume: how far ahead of its estimate the robot stands, metres.")
    ] = 0.0,
    pictures: Annotated[bool, typer.Option("--pictures/--no-pictures", help="Draw the run and its decisions.")] = True,
    recording: Annotated[bool, typer.Option("--recording", help="Write run.mcap, which Foxglove opens (extra view).")] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Folder for all results.", show_default="out/ and the scenario's name")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print run.json and nothing else.")] = False,
) -> None:
    """Drive a robot through a scenario: at each goal it plans on its graph and map, decides, and drives.

    With --explore it then drives trips that improve the map, until it is certain that none gains enough.

    Ctrl-C leaves a complete result of what was driven, from which --resume continues.
    """
    from topobelief.cli.console import Reporter
    from topobelief.cli.extras import require_extras

    require_extras("sim")
    reporter = Reporter(as_json=as_json)
    with reporter.stage("start-up"):
        from topobelief.cli import simulation_files
        from topobelief.cli.interruption import stop_on_interrupt
        from topobelief.cli.plan_files import checked_folder
        from topobelief.errors import InvalidInputError
        from topobelief.report.simulation_tables import exploration_line, leg_line, metrics_table, trips_table
        from topobelief.simulation.episode import Episode
        from topobelief.simulation.noise import parse_noise
        from topobelief.simulation.record import INTERRUPTED, RunOptions
        from topobelief.simulation.results import read_history, run_document
        from topobelief.simulation.scenario_file import as_in_paper, scenario_of, with_closures, with_detour
        from topobelief.strategies.registry import checked_strategy

        if displaced and not resume:
            raise InvalidInputError("expected --displaced together with --resume, got it alone")
        place = scenario_of(scenario)
        place = with_closures(with_detour(as_in_paper(place) if as_paper else place, max_detour), closures)
        if place.caution:
            reporter.warn(place.caution)
        objective = objective or place.objective
        options = RunOptions(
            strategy=checked_strategy(place.strategy or default_signature(objective) if strategy is None else strategy),
            objective=objective,
            seed=seed,
            noise=parse_noise(noise),
            unknown=unknown,
            trips=_trips(explore, max_length, return_to_start, enough, trips),
        )
        folder = out or Path("out") / place.name
        checked_folder(folder)
        if recording:
            require_extras("view")
        history = read_history(folder, scenario=place.name, options=options) if resume else None
    with reporter.stage("driving") as update, stop_on_interrupt() as should_stop:
        files = simulation_files.RunFiles(folder, keep=resume)
        episode = Episode(place, options, history=history, displaced=(displaced, 0.0, 0.0))
        record = episode.run(
            should_stop=should_stop,
            on_progress=lambda what, done, total: update(round(done), round(total)),
            on_leg=files.write,
        )
        files.write(record)
    for leg in record.legs:
        reporter.say(leg_line(leg))
    reporter.say(metrics_table(record))
    if record.exploration is not None:
        reporter.say(trips_table(record), exploration_line(record))
    if pictures or recording:
        with reporter.stage("pictures"):
            files.draw(record, pictures=pictures, recording=recording)
    reporter.say(f"{folder}: {', '.join(files.names)}", f"Took {reporter.time_taken()}")
    reporter.answer(run_document(record))
    if record.outcome == INTERRUPTED:
        raise typer.Exit(130)


def _trips(
    explore: bool, max_length: float | None, return_to_start: bool, enough: float | None, trips: int | None
) -> TripOptions | None:
    """Which trips to drive; None for none.

    Raises
    ------
    InvalidInputError
        For options of trips without --explore, --explore without a length, and numbers out of range.
    """
    from topobelief.errors import InvalidInputError
    from topobelief.simulation.exploration import TripOptions

    if not explore:
        given = {"--max-length": max_length, "--return": return_to_start or None, "--enough": enough, "--trips": trips}
        for option, value in given.items():
            if value is not None:
                raise InvalidInputError(f"expected {option} together with --explore, got it alone")
        return None
    if max_length is None:
        raise InvalidInputError("expected --max-length M with --explore, the longest trip in metres, got none")
    return TripOptions(
        max_length=max_length,
        return_to_start=return_to_start,
        enough=0.0 if enough is None else enough,
        max_trips=10 if trips is None else trips,
    )


def simulate_compare(
    scenario: Annotated[str, typer.Argument(metavar="SCENARIO", help=_SCENARIO_HELP)],
    strategies: Annotated[
        str | None,
        typer.Option(
            help="Comma-separated; the others are compared with the first. As in simulate; with an objective of its own, as "
            "in spanning_trees:joint; or hindsight, which drives all candidates and takes the best.",
            show_default="shortest and the default of simulate",
        ),
    ] = None,
    objective: ObjectiveName = None,
    closures: ClosuresName = None,
    seeds: Annotated[int, typer.Option(min=1, help="Number of seeds, starting at 0.")] = 20,
    noise: Annotated[str, typer.Option(help="Injected noise, as in simulate; redrawn for each graph.")] = "0.35",
    redraws: Annotated[int, typer.Option(min=1, help="Noise draws for each recorded graph.")] = 50,
    max_detour: MaxDetour = None,
    workers: Annotated[int, typer.Option(min=1, help="Number of processes.")] = 1,
    timeout: Timeout = DEFAULT_TIMEOUT,
    retry_failed: RetryFailed = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder for runs and table; an earlier comparison continues."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the table as JSON and nothing else.")] = False,
) -> None:
    """Compare the expected map error of strategies on a scenario's last session, over many draws of the noise.

    All earlier sessions of a seed are driven once, so that the strategies decide on the same graph.

    Each seed is kept when it is done. Killed at any moment, the same command continues and repeats nothing.
    """
    from topobelief.cli.console import Reporter
    from topobelief.cli.extras import require_extras

    require_extras("sim")
    reporter = Reporter(as_json=as_json)
    with reporter.stage("start-up"):
        from topobelief.cli import comparison_files
        from topobelief.cli.plan_files import checked_folder
        from topobelief.report.simulation_tables import comparison_table
        from topobelief.runs.local_workers import LocalWorkers
        from topobelief.simulation.comparison import compared_strategy
        from topobelief.simulation.noise import parse_noise
        from topobelief.simulation.record import RunOptions
        from topobelief.simulation.scenario_file import scenario_of
        from topobelief.simulation.strategy_comparison import ComparisonTask, compare

        place = scenario_of(scenario)
        objective = objective or place.objective
        if strategies is None:
            strategies = f"shortest,{place.strategy or default_signature(objective)}"
        names = tuple(dict.fromkeys(compared_strategy(name.strip()) for name in strategies.split(",")))
        task = ComparisonTask(
            scenario=scenario,
            max_detour=max_detour,
            strategies=names,
            options=RunOptions(objective=objective, noise=parse_noise(noise)),
            num_redraws=redraws,
            closures=closures,
        )
        folder = out or Path("out") / f"compare-{Path(scenario).stem}"
        checked_folder(folder)
        if place.caution:
            reporter.warn(place.caution)
    executor = LocalWorkers(workers, max_seconds=timeout or None)
    with reporter.run("driving", "seeds") as progress:
        found = compare(task, seeds, folder, executor, retry_failed=retry_failed, on_progress=progress.update)
    reporter.say(comparison_table(found.summaries, baseline=names[0], unit=unit_of(objective)))
    if found.failed:
        seed, error = next(iter(found.failed.items()))
        reporter.say(f"{len(found.failed)} of {seeds} seeds failed and are left out; seed {seed}: {error}")
    with reporter.stage("pictures"):
        comparison_files.write(folder, found)
    reporter.say(f"{folder}: comparison.csv, comparison.json, comparison.png", f"Took {reporter.time_taken()}")
    reporter.answer(comparison_files.document(found))
