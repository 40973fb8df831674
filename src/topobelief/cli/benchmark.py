"""`topobelief benchmark`: how long decisions take, beside standard belief space planning; or the search beside its peers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from topobelief.cli.run_options import RetryFailed


def benchmark(
    graph_files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[GRAPH]...",
            help="Pose graphs to measure besides generated ones, .g2o or .toro. With --search: where to compare, grid-8 and "
            "grid-16 if not given; also data sets by name, maps, and grid-N.",
        ),
    ] = None,
    sizes: Annotated[
        str | None,
        typer.Option(
            help="Poses of the generated graphs, comma-separated; 1000,3500,10000,100000 if not given, none if empty."
        ),
    ] = None,
    candidates: Annotated[int | None, typer.Option(help="Candidates for each graph; 1000 if not given.", min=2)] = None,
    repeat: Annotated[int | None, typer.Option(help="Repetitions of each timing; 5 if not given.", min=1)] = None,
    seed: Annotated[int, typer.Option(help="Seed of generated graphs and candidates; with --search, the first.", min=0)] = 0,
    quick: Annotated[
        bool, typer.Option("--quick", help="A small graph and few candidates, for a first look: about a minute.")
    ] = False,
    cpu_time: Annotated[
        bool, typer.Option("--cpu-time", help="Measure the processor's time, all threads together, where other programs run.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for benchmark.json, and for a picture if there are two sizes or more; with --search for search.json, "
            "out/benchmark-search if not given."
        ),
    ] = None,
    search: Annotated[
        bool,
        typer.Option(
            "--search", help="Compare the search over a roadmap with other ways to choose a walk, in place of all else."
        ),
    ] = False,
    seeds: Annotated[int | None, typer.Option(help="With --search: number of seeds; 3 if not given.", min=1)] = None,
    objective: Annotated[
        list[str] | None,
        typer.Option(help="With --search: what to minimise; repeat it for several. Error and map if not given."),
    ] = None,
    max_detour: Annotated[
        float | None, typer.Option(help="With --search: longest walk in lengths of the shortest; 1.3 if not given.")
    ] = None,
    paths: Annotated[
        str | None, typer.Option(help="With --search: numbers of diverse paths, comma-separated; 20,200,1000 if not given.")
    ] = None,
    seconds: Annotated[
        str | None, typer.Option(help="With --search: deadlines of the search, comma-separated; 0.1,1,10 if not given.")
    ] = None,
    vertices: Annotated[
        int | None, typer.Option(help="With --search: vertices of a roadmap, about; 1000 if not given.", min=2)
    ] = None,
    goal: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="X Y", help="With --search and one GRAPH: the goal, in place of a pose some 30 m away."),
    ] = None,
    retry_failed: RetryFailed = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Compare the speed of this engine with GTSAM, sparse factorisation from scratch and the determinant lemma.

    Prints ratios for all candidates first, set-up included, then memory, error bounds, proofs and kinds of candidates.

    With --search: value, bound, evaluations and seconds of the search and its peers at each place, for each seed. Each place is
    kept when it is done; killed at any moment, the same command continues.

    Other programs running on the machine distort the times, less so with --cpu-time. Needs the extras fast and gtsam.
    """
    _refuse_others(
        search,
        {"--sizes": sizes, "--candidates": candidates, "--repeat": repeat},
        {
            "--seeds": seeds,
            "--objective": objective,
            "--max-detour": max_detour,
            "--paths": paths,
            "--seconds": seconds,
            "--vertices": vertices,
            "--goal": goal,
            "--retry-failed": retry_failed or None,
        },
    )
    if search:
        from topobelief.cli.benchmark_search import SearchOptions, benchmark_search

        benchmark_search(
            SearchOptions(
                sources=graph_files,
                seeds=seeds,
                first_seed=seed,
                objectives=objective,
                max_detour=max_detour,
                paths=paths,
                seconds=seconds,
                vertices=vertices,
                goal=goal,
                quick=quick,
                cpu_time=cpu_time,
                retry_failed=retry_failed,
                out=out,
                as_json=as_json,
            )
        )
        return
    from topobelief.cli.console import Reporter
    from topobelief.cli.extras import require_extras

    require_extras("fast", "gtsam")
    from topobelief.cli.plan_files import checked_folder

    reporter, folder = Reporter(as_json=as_json), checked_folder(out)
    with reporter.stage("start-up"):
        from topobelief.benchmark.run import BenchmarkPlan, BenchmarkResult, run_benchmark
        from topobelief.errors import FileError
        from topobelief.io.files import atomic_file
        from topobelief.report.benchmark_figure import draw_benchmark
        from topobelief.report.benchmark_tables import benchmark_tables
        from topobelief.report.canvas import save_figure

    for path in graph_files or ():
        if not path.is_file():
            raise FileError(path, "expected a pose graph to read, got no such file")
    base = BenchmarkPlan.quick() if quick else BenchmarkPlan()
    plan = replace(
        base,
        sizes=base.sizes if sizes is None else parse_sizes(sizes),
        memory_sizes=base.memory_sizes if sizes is None else parse_sizes(sizes),
        files=tuple(graph_files or ()),
        num_actions=candidates or base.num_actions,
        repetitions=repeat or base.repetitions,
        seed=seed,
        cpu_time=cpu_time,
    )
    result: BenchmarkResult | None = None
    with reporter.activity("measuring") as tell:
        for result in run_benchmark(plan, progress=tell):
            if folder is not None:  # after every part, so that an interrupted run leaves what it has
                folder.mkdir(parents=True, exist_ok=True)
                with atomic_file(folder / "benchmark.json") as path:
                    path.write_text(json.dumps(result.to_dict(), indent=2), encoding="utf-8")
    if result is not None:
        reporter.say(*benchmark_tables(result))
        reporter.answer(result.to_dict())
    if folder is not None and result is not None:
        reporter.say(f"All numbers: {folder / 'benchmark.json'}")
        figure = draw_benchmark(result)
        if figure is not None:
            with atomic_file(folder / "benchmark.png") as path:
                save_figure(figure, path)
            reporter.say(f"Time against size: {folder / 'benchmark.png'}")


def _refuse_others(search: bool, of_times: Mapping[str, object], of_search: Mapping[str, object]) -> None:
    """Options of the other benchmark are a mistake; none is left out in silence."""
    from topobelief.errors import InvalidInputError

    given = [name for name, value in (of_times if search else of_search).items() if value is not None]
    if given:
        raise InvalidInputError(
            f"expected --search or {given[0]}, got both; leave one of them out"
            if search
            else f"expected --search together with {given[0]}, got {given[0]} alone"
        )


def parse_sizes(text: str) -> tuple[int, ...]:
    """Numbers of poses, by commas.

    Raises
    ------
    InvalidInputError
        Where one is not a whole number.
    """
    from topobelief.errors import InvalidInputError

    try:
        return tuple(int(part) for part in text.split(",") if part.strip())
    except ValueError:
        raise InvalidInputError(f'expected --sizes as whole numbers by commas, such as 1000,10000, got "{text}"') from None
