"""`topobelief benchmark --search`: the search over a roadmap beside other ways to choose a walk."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from topobelief.benchmark.search_comparison import ComparedPeers

SCHEMA = "topobelief.benchmark-search/1"
FOLDER = Path("out") / "benchmark-search"
_DEFAULT_SOURCES = ("grid-8", "grid-16")
_DEFAULT_SEEDS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchOptions:
    """What the command line says; None where it says nothing."""

    sources: list[Path] | None
    seeds: int | None
    first_seed: int
    objectives: list[str] | None
    max_detour: float | None
    paths: str | None
    seconds: str | None
    vertices: int | None
    goal: tuple[float, float] | None
    quick: bool
    cpu_time: bool
    retry_failed: bool
    out: Path | None
    as_json: bool


def benchmark_search(options: SearchOptions) -> None:
    """Compare, and print and write what was found."""
    from topobelief.cli.console import Reporter
    from topobelief.cli.extras import require_extras
    from topobelief.cli.plan_files import checked_folder, write_together

    require_extras("fast")
    folder = options.out or FOLDER
    reporter, _ = Reporter(as_json=options.as_json), checked_folder(folder)
    with reporter.stage("start-up"):
        from topobelief.benchmark.search_comparison import SearchComparison, run_comparison
        from topobelief.report.peer_tables import peer_tables
        from topobelief.runs.local_workers import LocalWorkers

        base = (
            SearchComparison(num_paths=(20,), deadlines=(0.1, 1.0), num_vertices=300) if options.quick else SearchComparison()
        )
        comparison = SearchComparison(
            objectives=tuple(dict.fromkeys(options.objectives)) if options.objectives else base.objectives,
            num_paths=base.num_paths if options.paths is None else _whole_numbers(options.paths),
            deadlines=base.deadlines if options.seconds is None else _numbers(options.seconds),
            max_detour=options.max_detour or base.max_detour,
            num_vertices=options.vertices or base.num_vertices,
            goal=options.goal,
            cpu_time=options.cpu_time,
        )
        sources = [str(source) for source in options.sources or _DEFAULT_SOURCES]
        seeds = range(options.first_seed, options.first_seed + (options.seeds or (1 if options.quick else _DEFAULT_SEEDS)))
    with reporter.run("measuring", "places") as progress:
        found = run_comparison(
            comparison,
            sources,
            seeds,
            folder,
            LocalWorkers(1, max_seconds=None),
            retry_failed=options.retry_failed,
            on_progress=progress.update,
        )
    reporter.say(*peer_tables(found))
    for name, error in found.failed.items():
        reporter.say(f"{name} failed and is left out: {error}")
    text = json.dumps(document(found), indent=2, allow_nan=False) + "\n"
    write_together(folder, {"search.json": lambda path: path.write_text(text, encoding="utf-8")})
    reporter.say(f"All numbers: {folder / 'search.json'}")
    reporter.answer(document(found))


def document(found: ComparedPeers) -> dict[str, object]:
    """For JSON; None stands for what is not a number, and for bounds that there are none of."""
    from topobelief.io.json_values import without_nan

    return {
        "schema": SCHEMA,
        "machine": found.machine,
        "comparison": asdict(found.comparison),
        "summaries": [without_nan(asdict(row)) for row in found.summaries],
        "rows": [without_nan(asdict(row)) for row in found.rows],
        "failed": found.failed,
    }


def _whole_numbers(text: str) -> tuple[int, ...]:
    from topobelief.errors import InvalidInputError

    try:
        return tuple(int(part) for part in text.split(",") if part.strip())
    except ValueError:
        raise InvalidInputError(f'expected --paths as whole numbers by commas, such as 20,200, got "{text}"') from None


def _numbers(text: str) -> tuple[float, ...]:
    from topobelief.errors import InvalidInputError

    try:
        return tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError:
        raise InvalidInputError(f'expected --seconds as numbers by commas, such as 0.1,1, got "{text}"') from None
