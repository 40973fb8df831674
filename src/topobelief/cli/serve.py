"""`topobelief serve`: a page of a pose graph and its map on which one clicks goals and sees the best ways, and why."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from topobelief.cli import plan_options as options
from topobelief.cli import world_options
from topobelief.cli.extras import require_extras
from topobelief.cli.reading import Component, Drop, Edge2OrderOption, Planar, RobustAsPlain, Topic, reading_options

_SERVER = "The server"
_TRIP = 30.0  # metres; of a trip without a goal unless another length is asked for

MaxDetour = Annotated[
    float,
    typer.Option(
        metavar="FACTOR", min=1.0, help="Longest way to a goal unless the page says another, in lengths of the shortest."
    ),
]
Seconds = Annotated[float, typer.Option(metavar="S", min=0.1, help="How long a question is searched at most.")]
Host = Annotated[
    str,
    typer.Option(
        help="Address to listen on. Other than this machine's own, the page needs the token that is printed.",
        rich_help_panel=_SERVER,
    ),
]
Port = Annotated[int, typer.Option(min=0, max=65535, help="Port; 0 for any free one.", rich_help_panel=_SERVER)]


def serve(
    graph_file: world_options.GraphFile,
    start: world_options.Start = None,
    map_file: world_options.MapFile = None,
    map_topic: world_options.MapTopic = None,
    along_trajectory: world_options.AlongTrajectory = False,
    width: world_options.Width = None,
    unknown: world_options.UnknownCells = "occupied",
    robot_radius: world_options.RobotRadius = 0.35,
    vertices: options.Vertices = 1000,
    seed: options.Seed = 0,
    spacing: options.Spacing = None,
    max_detour: MaxDetour = 1.3,
    seconds: Seconds = 5.0,
    optimize: world_options.Optimize = True,
    host: Host = "127.0.0.1",
    port: Port = 8177,
    drop: Drop = None,
    robust_as_plain: RobustAsPlain = False,
    edge2_order: Edge2OrderOption = "toro",
    component: Component = "all",
    planar: Planar = False,
    topic: Topic = None,
) -> None:
    """Plan on a page: click a goal, see the best ways, what they see again, and why others are worse.

    Serves the page to this machine alone, until Ctrl-C; it needs no network.
    """
    require_extras("fast")
    from topobelief.candidates.predicted_factors import usual_spacing
    from topobelief.candidates.propose import CandidateRule
    from topobelief.cli import plan_ends, plan_world
    from topobelief.cli.answers import Answers
    from topobelief.cli.console import Reporter
    from topobelief.errors import InvalidInputError
    from topobelief.page import situation
    from topobelief.page.server import PageServer
    from topobelief.wording import counted

    reporter = Reporter(as_json=False)
    reading = reading_options(
        drop, robust_as_plain=robust_as_plain, edge2_order=edge2_order, component=component, planar=planar, topic=topic
    )
    choice = plan_world.WorldChoice(map_file, along_trajectory, width, unknown, topic=map_topic)
    choice.check()
    graph, world = plan_world.read_planar(choice, graph_file, reporter, optimized=optimize, reading=reading)
    begin = plan_ends.choose_start(graph, world, reporter, start)
    rule = CandidateRule(num_vertices=vertices, robot_radius=robot_radius, seed=seed, spacing=spacing or usual_spacing(graph))
    answers = Answers(graph, world, begin, rule, max_detour, seconds)
    with reporter.stage("roadmap"):
        reporter.say(str(answers.models["learned"]), f"roadmap: {counted(len(answers.roadmap.vertices), 'vertex', 'vertices')}")
    models = [(name, f"{name}: {str(model).removeprefix('closures: ')}") for name, model in answers.models.items()]
    shown = situation.document(Path(graph_file).name, graph, world, begin, models, trip=_TRIP)
    try:
        server = PageServer(shown, answers, host=host, port=port)
    except OSError as error:
        raise InvalidInputError(
            f"expected a free port of an address of this machine, got {host}:{port} ({error.strerror}); "
            "choose another --host or --port"
        ) from None
    with server:
        reporter.say(f"Open {server.address} in a browser; Ctrl-C ends the server.")
        server.serve_forever(poll_interval=0.2)
