"""`topobelief ros`: a ROS 2 node that answers goals and explores."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from topobelief.cli import plan_options as options
from topobelief.cli import world_options
from topobelief.cli.extras import require_extras

NoiseP = Annotated[
    float,
    typer.Option(
        "--sigma-p",
        metavar="M",
        min=1e-6,
        help="Standard deviation of position of measurements that a drawn graph does not state.",
    ),
]
NoiseTheta = Annotated[float, typer.Option("--sigma-theta", metavar="RAD", min=1e-6, max=1.8, help="The same of heading.")]
GraphOption = Annotated[
    Path | None,
    typer.Option("--graph", metavar="FILE", help="A pose graph to begin with, in place of topics `graph` and `trajectory`."),
]
MaxDetour = Annotated[float, typer.Option(metavar="FACTOR", min=1.0, help="Longest way to a goal, in lengths of the shortest.")]
Seconds = Annotated[
    float, typer.Option(metavar="S", min=0.1, help="How long a question is searched; the first answer comes sooner.")
]


def ros(
    context: typer.Context,
    graph_file: GraphOption = None,
    map_file: world_options.MapFile = None,
    unknown: world_options.UnknownCells = "occupied",
    robot_radius: world_options.RobotRadius = 0.35,
    vertices: options.Vertices = 1000,
    seed: options.Seed = 0,
    spacing: options.Spacing = None,
    max_detour: MaxDetour = 1.3,
    seconds: Seconds = 2.0,
    sigma_p: NoiseP = 0.05,
    sigma_theta: NoiseTheta = 0.02,
) -> None:
    """Run a ROS 2 node: a map, a pose graph and a goal in; the way to drive, the others and why out.

    Needs the rclpy of a ROS 2 that is sourced. Arguments of ROS go after --ros-args, as in
    --ros-args -r map:=/map -r graph:=/slam_toolbox/graph_visualization -p drive:=true.
    """
    require_extras("fast")
    from topobelief.candidates.propose import CandidateRule
    from topobelief.cli import plan_world
    from topobelief.cli.answers import Answers
    from topobelief.cli.console import Reporter
    from topobelief.io.reading import ReadingOptions
    from topobelief.page.desk import Answerer
    from topobelief.ros import node
    from topobelief.ros.belief import Belief, Situation

    node.load_ros("rclpy")
    reporter = Reporter(as_json=False, shows_progress=False)
    graph = world = None
    if (graph_file is None) != (map_file is None):
        raise typer.BadParameter("expected --graph and --map, or neither, got one of them.", param_hint="--graph")
    if graph_file is not None:
        choice = plan_world.WorldChoice(map_file, along_trajectory=False, unknown=unknown)
        choice.check()
        graph, world = plan_world.read_planar(choice, graph_file, reporter, optimized=True, reading=ReadingOptions())
    rule = CandidateRule(num_vertices=vertices, robot_radius=robot_radius, seed=seed, spacing=spacing or 1.0)

    def answers(situation: Situation, earlier: Answerer | None) -> Answerer:
        new = Answers(situation.graph, situation.world, situation.start, rule, max_detour, seconds)
        return new.continuing(earlier if isinstance(earlier, Answers) else None)

    node.run(Belief((sigma_p, sigma_theta), graph=graph, world=world), answers, context.args)
