"""`topobelief info`: what a pose graph holds, how well it fits its measurements, and how uncertain it is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from topobelief.cli.reading import Component, Drop, Edge2OrderOption, Planar, RobustAsPlain, reading_options


def info(
    graph_file: Annotated[Path, typer.Argument(metavar="GRAPH", help="Pose graph in g2o or TORO format.")],
    optimize: Annotated[
        bool,
        typer.Option("--optimize/--no-optimize", help="Evaluate it at its maximum-likelihood poses, or at those in the file."),
    ] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
    drop: Drop = None,
    robust_as_plain: RobustAsPlain = False,
    edge2_order: Edge2OrderOption = "toro",
    component: Component = "all",
    planar: Planar = False,
) -> None:
    """Describe a pose graph: size, fit, spanning trees, signatures, entropy and its bounds."""
    from topobelief.cli.console import Reporter

    reporter = Reporter(as_json=as_json)
    with reporter.stage("start-up"):
        from topobelief.cli.graph_facts import describe
    reading = reading_options(
        drop, robust_as_plain=robust_as_plain, edge2_order=edge2_order, component=component, planar=planar
    )
    facts = describe(graph_file, reporter, optimized=optimize, reading=reading)
    reporter.say(*facts.tables())
    reporter.answer(facts.document() | {"notes": reporter.notes})
