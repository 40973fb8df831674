"""`topobelief info`: what a pose graph holds, how well it fits its measurements, and how uncertain it is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from topobelief.cli import plan_arguments as values
from topobelief.cli import world_options
from topobelief.cli.plan_arguments import GivenPlace
from topobelief.cli.reading import Component, Drop, Edge2OrderOption, Planar, RobustAsPlain, Topic, reading_options

_PLACES = "Goals and picture"

Goals = Annotated[
    list[GivenPlace] | None,
    typer.Option(
        "--goal",
        metavar="ID | X Y",
        parser=values.place,
        help="Say whether this place is free, and where the nearest free one is; may be repeated.",
        show_default=False,
        rich_help_panel=_PLACES,
    ),
]
MapFile = Annotated[
    Path | None,
    typer.Option(
        "--map",
        metavar="FILE",
        help="ROS map (.yaml), walls (.csv) or a bag, for goals and picture.",
        show_default="what lies along the trajectory",
        rich_help_panel=_PLACES,
    ),
]
MapTopic = Annotated[
    str | None,
    typer.Option(
        metavar="NAME", help="Of a bag, the topic that holds the map.", show_default="the only one", rich_help_panel=_PLACES
    ),
]
RobotRadius = Annotated[float, typer.Option(metavar="M", help="Metres.", callback=values.above_zero, rich_help_panel=_PLACES)]
Picture = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Draw the graph: .png, .pdf or .svg.",
        show_default=False,
        rich_help_panel=_PLACES,
    ),
]


def info(
    graph_file: world_options.GraphFile,
    optimize: Annotated[
        bool,
        typer.Option("--optimize/--no-optimize", help="Evaluate it at its maximum-likelihood poses, or at those in the file."),
    ] = True,
    goal: Goals = None,
    map_file: MapFile = None,
    map_topic: MapTopic = None,
    robot_radius: RobotRadius = 0.35,
    picture: Picture = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
    drop: Drop = None,
    robust_as_plain: RobustAsPlain = False,
    edge2_order: Edge2OrderOption = "toro",
    component: Component = "all",
    planar: Planar = False,
    topic: Topic = None,
) -> None:
    """Describe a pose graph: size, fit, spanning trees, signatures, entropy and its bounds."""
    from topobelief.cli.console import Reporter

    reporter = Reporter(as_json=as_json)
    with reporter.stage("start-up"):
        from topobelief.cli import graph_facts, graph_picture
    graph_picture.check_picture_file(picture)
    reading = reading_options(
        drop, robust_as_plain=robust_as_plain, edge2_order=edge2_order, component=component, planar=planar, topic=topic
    )
    facts = graph_facts.describe(graph_file, reporter, optimized=optimize, reading=reading)
    plan = None
    if goal or map_file is not None:
        from topobelief.cli.goal_facts import describe_goals
        from topobelief.cli.plan_ends import choose_goals
        from topobelief.cli.plan_world import WorldChoice, read_world
        from topobelief.world import World

        choice = WorldChoice(map_file, along_trajectory=map_file is None, topic=map_topic)
        world = read_world(choice, facts.graph, reporter)
        goals = choose_goals(facts.graph, goal or ())
        plan = world if isinstance(world, World) else None
        if goals:
            facts.groups["Goals"] = list(describe_goals(facts.graph, world, goals, robot_radius))
    if picture is not None:
        graph_picture.write(picture, facts.graph, graph_file.name, plan, reporter)
    reporter.say(*facts.tables())
    if picture is not None:
        reporter.say(f"Picture: {picture}")
    reporter.answer(facts.document() | {"notes": reporter.notes})
