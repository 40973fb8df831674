"""`topobelief plan`: a pose graph, a map and a goal in; the best path out, with what another could gain."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

import typer

from topobelief.cli.reading import Component, Drop, Edge2OrderOption, Planar, RobustAsPlain, reading_options

# The planner's own choices, repeated so that help need not load it; a test holds them together.
Objective = Literal["joint", "map", "per_pose"]
Signature = Literal["spanning_trees", "von_neumann", "von_neumann_approx"]
Family = Literal["paper", "fischer", "anchored", "auto"]
Determinant = Literal["cholesky", "hadamard"]
Proof = Literal["none", "bounded", "optimal"]
Unknown = Literal["occupied", "free"]

_WORLD = "Where the robot may drive"
_CANDIDATES = "Candidate paths"
_FACTORS = "Predicted factors"
_DECISION = "Decision"
_OUTPUT = "Output"


def _above_zero(value: float | None) -> float | None:
    if value is not None and not 0 < value < math.inf:
        raise typer.BadParameter(f"expected a number above 0, got {value:g}.")
    return value


def _finite(value: tuple[float, float]) -> tuple[float, float]:
    if not all(map(math.isfinite, value)):
        raise typer.BadParameter(f"expected two finite numbers, got {value[0]:g} {value[1]:g}.")
    return value


def _detour(text: str) -> float:
    """The detour limit; infinite for "none" and 0."""
    try:
        limit = math.inf if text.lower() in ("none", "inf") else float(text)
    except ValueError:
        limit = math.nan
    if limit == 0:
        return math.inf
    if not limit >= 1:
        raise typer.BadParameter(f'expected a factor of at least 1, or "none", got {text!r}.')
    return limit


def plan(
    context: typer.Context,
    graph_file: Annotated[
        Path, typer.Argument(metavar="GRAPH", help="Pose graph in g2o or TORO format; the robot stands at its last pose.")
    ],
    goal: Annotated[tuple[float, float], typer.Option(metavar="X Y", help="Where to go, metres.", callback=_finite)],
    map_file: Annotated[
        Path | None,
        typer.Option("--map", metavar="FILE", help="ROS map (.yaml) or walls (.csv).", rich_help_panel=_WORLD),
    ] = None,
    along_trajectory: Annotated[
        bool,
        typer.Option("--along-trajectory", help="No map: free is where the robot has been.", rich_help_panel=_WORLD),
    ] = False,
    width: Annotated[
        float | None,
        typer.Option(
            help="Metres that are free to each side of the trajectory.",
            show_default="twice its typical step",
            callback=_above_zero,
            rich_help_panel=_WORLD,
        ),
    ] = None,
    unknown: Annotated[
        Unknown, typer.Option(help="What unknown cells of a ROS map are taken for.", rich_help_panel=_WORLD)
    ] = "occupied",
    robot_radius: Annotated[float, typer.Option(help="Metres.", callback=_above_zero, rich_help_panel=_WORLD)] = 0.35,
    candidates: Annotated[int, typer.Option(min=1, help="Paths to compare.", rich_help_panel=_CANDIDATES)] = 20,
    max_detour: Annotated[
        float | None,
        typer.Option(
            metavar="FACTOR",
            parser=_detour,
            help='Longest path, in lengths of the shortest; "none" or 0 for no limit.',
            show_default="1.3",
            rich_help_panel=_CANDIDATES,
        ),
    ] = None,
    vertices: Annotated[int, typer.Option(min=2, help="Least size of the roadmap.", rich_help_panel=_CANDIDATES)] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="The same seed, the same paths.", rich_help_panel=_CANDIDATES)] = 0,
    spacing: Annotated[
        float, typer.Option(help="Metres between new poses.", callback=_above_zero, rich_help_panel=_FACTORS)
    ] = 1.0,
    closure_radius: Annotated[
        float,
        typer.Option(help="A loop closes within this distance, metres.", callback=_above_zero, rich_help_panel=_FACTORS),
    ] = 2.0,
    closure_angle: Annotated[
        float | None,
        typer.Option(
            help="… and within this difference of headings, radians.",
            show_default="any",
            callback=_above_zero,
            rich_help_panel=_FACTORS,
        ),
    ] = None,
    min_index_gap: Annotated[
        int | None,
        typer.Option(min=2, help="… with a pose at least so many back.", show_default="5", rich_help_panel=_FACTORS),
    ] = None,
    line_of_sight: Annotated[
        bool | None,
        typer.Option(
            "--line-of-sight/--no-line-of-sight", help="… that is in sight.", show_default="yes", rich_help_panel=_FACTORS
        ),
    ] = None,
    paper: Annotated[
        bool,
        typer.Option(
            "--paper",
            help="The rules of the paper where not said otherwise: headings within 1 rad, index gap 2, "
            "no line of sight, no detour limit.",
            rich_help_panel=_FACTORS,
        ),
    ] = False,
    sigma_p: Annotated[
        float | None,
        typer.Option(
            help="Noise of predicted positions, metres.",
            show_default="the graph's",
            callback=_above_zero,
            rich_help_panel=_FACTORS,
        ),
    ] = None,
    sigma_theta: Annotated[
        float | None,
        typer.Option(
            help="Noise of predicted headings, radians.",
            show_default="the graph's",
            callback=_above_zero,
            rich_help_panel=_FACTORS,
        ),
    ] = None,
    objective: Annotated[
        Objective,
        typer.Option(
            help="Entropy to minimise: of all poses (the paper's), of those that exist now, or per pose.",
            rich_help_panel=_DECISION,
        ),
    ] = "joint",
    signature: Annotated[Signature, typer.Option(help="What ranks the paths.", rich_help_panel=_DECISION)] = "spanning_trees",
    bounds: Annotated[
        Family,
        typer.Option(
            help="Family of bounds; the paper's needs equal noise, the anchored one numba; auto takes what proves for less.",
            rich_help_panel=_DECISION,
        ),
    ] = "fischer",
    determinant: Annotated[
        Determinant, typer.Option(help="In the lower bound: exact, or by its diagonal.", rich_help_panel=_DECISION)
    ] = "cholesky",
    normalized: Annotated[
        bool,
        typer.Option("--normalized", help="Add the noise to von_neumann_approx.", rich_help_panel=_DECISION),
    ] = False,
    allow_dense_spectrum: Annotated[
        bool,
        typer.Option(
            "--allow-dense-spectrum", help="Let von_neumann take its time on large graphs.", rich_help_panel=_DECISION
        ),
    ] = False,
    margin: Annotated[
        float | None,
        typer.Option(help="Entropy that is good enough, nats: no other path is bounded.", rich_help_panel=_DECISION),
    ] = None,
    proof: Annotated[
        Proof,
        typer.Option(
            help="Ranking alone, with bounds, or exact evaluations until the best is proven.", rich_help_panel=_DECISION
        ),
    ] = "bounded",
    max_evaluations: Annotated[
        int | None, typer.Option(min=0, help="Stop the proof after so many.", rich_help_panel=_DECISION)
    ] = None,
    deadline: Annotated[
        float | None,
        typer.Option(help="Seconds for the decision.", callback=_above_zero, rich_help_panel=_DECISION),
    ] = None,
    optimize: Annotated[
        bool,
        typer.Option("--optimize/--no-optimize", help="Find the maximum-likelihood poses first.", rich_help_panel=_DECISION),
    ] = True,
    exact: Annotated[
        bool,
        typer.Option(
            "--exact/--no-exact",
            help="Evaluate every path for the picture of the bounds, as far as a few seconds go.",
            rich_help_panel=_OUTPUT,
        ),
    ] = True,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="For paths.png, bounds.png and decision.json.",
            show_default="out; with --json, none",
            rich_help_panel=_OUTPUT,
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the decision as JSON and nothing else.", rich_help_panel=_OUTPUT)
    ] = False,
    drop: Drop = None,
    robust_as_plain: RobustAsPlain = False,
    edge2_order: Edge2OrderOption = "toro",
    component: Component = "all",
    planar: Planar = False,
) -> None:
    """Choose the best path to a goal on a pose-graph map.

    Ranks diverse paths by a topological signature of the graph that each leaves, and bounds what that can cost.
    """
    if (map_file is None) == (not along_trajectory):
        raise typer.BadParameter("expected one of --map FILE and --along-trajectory.", param_hint="the world")
    from topobelief.cli.console import Reporter

    reporter = Reporter(as_json=as_json)
    with reporter.stage("start-up"):
        from topobelief.cli import plan_files, plan_stages
        from topobelief.planning.planner import Planner

    folder = plan_files.checked_folder(out if out is not None or as_json else Path("out"))
    rule = plan_stages.CandidateRule(
        num_paths=candidates,
        max_detour=max_detour if max_detour is not None else math.inf if paper else 1.3,
        num_vertices=vertices,
        robot_radius=robot_radius,
        seed=seed,
        spacing=spacing,
        closure_radius=closure_radius,
        closure_angle=closure_angle if closure_angle is not None else 1.0 if paper else math.pi,
        min_index_gap=min_index_gap if min_index_gap is not None else 2 if paper else 5,
        line_of_sight=line_of_sight if line_of_sight is not None else not paper,
        information=plan_stages.information(sigma_p, sigma_theta),
    )
    reading = reading_options(
        drop, robust_as_plain=robust_as_plain, edge2_order=edge2_order, component=component, planar=planar
    )
    graph = plan_stages.read_graph(graph_file, reporter, optimized=optimize, reading=reading)
    world = plan_stages.read_world(map_file, graph, reporter, width=width, unknown=unknown)
    planner = Planner(
        graph,
        objective=objective,
        signature=signature,
        bounds=bounds,
        determinant=determinant,
        normalized=normalized,
        allow_dense_spectrum=allow_dense_spectrum,
    )
    found = plan_stages.find_candidates(graph, world, goal, rule, reporter)
    with reporter.stage("decision") as update:
        decision = planner.decide(
            found.actions,
            margin=margin,
            proof=proof,
            max_evaluations=max_evaluations,
            deadline=deadline,
            on_progress=lambda _, done, total: update(done, total),
        )
    plan_stages.say_decision(decision, reporter)
    entropies = plan_stages.exact_entropies(planner, found.actions, decision, reporter, wanted=exact and folder is not None)
    result = plan_files.PlanResult(graph, world, found, decision, entropies, goal=goal, rule=rule, options=context.params)
    if folder is not None:
        plan_files.write(folder, result, reporter)
    reporter.answer(plan_files.document(result))
