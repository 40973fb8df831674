"""`topobelief info`: what a pose graph holds, how well it fits its measurements, and how uncertain it is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def info(
    graph_file: Annotated[Path, typer.Argument(metavar="GRAPH", help="Pose graph, .g2o or .toro.")],
    optimize: Annotated[
        bool,
        typer.Option("--optimize/--no-optimize", help="Judge it at its maximum-likelihood poses, or at those in the file."),
    ] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Describe a pose graph: size, fit, spanning trees, signatures, entropy and its bounds."""
    from topobelief.cli.console import Reporter

    reporter = Reporter(as_json=as_json)
    with reporter.stage("start-up"):
        from topobelief.cli.graph_facts import describe

    facts = describe(graph_file, reporter, optimized=optimize)
    reporter.say(*facts.tables())
    reporter.answer(facts.document())
