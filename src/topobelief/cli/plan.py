"""`topobelief plan`: a pose graph, a map and a goal in; the best path out, with what another could gain."""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from topobelief.cli.choices import completed, one_of
from topobelief.cli.reading import Component, Drop, Edge2OrderOption, Planar, RobustAsPlain, reading_options
from topobelief.errors import NotOptimizedWarning, degrees_hint
from topobelief.planning.registry import AUTO, BOUNDS, OBJECTIVES, SIGNATURES

# The planner's own choices, repeated so that help need not load it; a test holds them together.
Determinant = Literal["cholesky", "hadamard"]
Proof = Literal["none", "bounded", "optimal"]
Unknown = Literal["occupied", "free"]
Closures = Literal["learned", "paper", "by-hand"]

_WORLD = "Where the robot may drive"
_CANDIDATES = "Candidate paths"
_FACTORS = "Predicted factors"
_RULES = "Rules of predicted loop closures"
_DECISION = "Decision"
_PROOF = "Bounds and proof"
_OUTPUT = "Output"

_UNIFORM_STD = math.pi / math.sqrt(3)  # radians, of a heading of which nothing is known


@dataclass(frozen=True, slots=True)
class GivenStart:
    """Where the robot stands, as given: the id of a pose (12, or a symbol such as x3), or a place."""

    pose_id: str | None = None
    place: tuple[float, float] | None = None

    def __str__(self) -> str:
        return str(self.pose_id) if self.place is None else f"{self.place[0]:g} {self.place[1]:g}"


def _start(text: str) -> GivenStart:
    words = text.split()
    try:
        if len(words) == 1:
            if not re.fullmatch(r"-?\d+|[A-Za-z]{1,2}\d+", words[0]):
                raise ValueError
            return GivenStart(pose_id=words[0])
        x, y = map(float, words)
        if math.isfinite(x) and math.isfinite(y):
            return GivenStart(place=(x, y))
    except ValueError:
        pass
    raise typer.BadParameter(f"expected the id of a pose or X Y in metres, got {text!r}.")


def _above_zero(value: float | None) -> float | None:
    if value is not None and not 0 < value < math.inf:
        raise typer.BadParameter(f"expected a number above 0, got {value:g}.")
    return value


def _angle(value: float | None) -> float | None:
    return _radians(value, math.pi)


def _heading_noise(value: float | None) -> float | None:
    return _radians(value, _UNIFORM_STD)


def _radians(value: float | None, largest: float) -> float | None:
    value = _above_zero(value)
    if value is not None and value > largest:
        raise typer.BadParameter(f"expected at most {largest:.6g}, got {value:g}{degrees_hint(value)}.")
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
    graph_file: Annotated[Path, typer.Argument(metavar="GRAPH", help="Pose graph in g2o or TORO format.")],
    goal: Annotated[tuple[float, float], typer.Option(metavar="X Y", help="The goal, metres.", callback=_finite)],
    start: Annotated[
        GivenStart | None,
        typer.Option(
            metavar="ID | X Y",
            parser=_start,
            help="Where the robot starts: id of a pose, or X Y in metres.",
            show_default="the last pose",
        ),
    ] = None,
    map_file: Annotated[
        Path | None,
        typer.Option("--map", metavar="FILE", help="ROS map (.yaml) or walls (.csv).", rich_help_panel=_WORLD),
    ] = None,
    along_trajectory: Annotated[
        bool,
        typer.Option(
            "--along-trajectory",
            metavar="",
            help="Use no map: where the robot has been counts as free.",
            rich_help_panel=_WORLD,
        ),
    ] = False,
    width: Annotated[
        float | None,
        typer.Option(
            metavar="M",
            help="Free width on each side of the trajectory, metres.",
            show_default="twice its typical step",
            callback=_above_zero,
            rich_help_panel=_WORLD,
        ),
    ] = None,
    unknown: Annotated[
        Unknown,
        typer.Option(metavar="WHAT", help="Treat unknown cells of a ROS map as occupied or free.", rich_help_panel=_WORLD),
    ] = "occupied",
    robot_radius: Annotated[
        float, typer.Option(metavar="M", help="Metres.", callback=_above_zero, rich_help_panel=_WORLD)
    ] = 0.35,
    candidates: Annotated[
        int, typer.Option(min=1, metavar="N", help="Number of paths to compare.", rich_help_panel=_CANDIDATES)
    ] = 20,
    max_detour: Annotated[
        float | None,
        typer.Option(
            metavar="FACTOR",
            parser=_detour,
            help='Longest path, as a multiple of the shortest; "none" or 0 for no limit.',
            show_default="1.3",
            rich_help_panel=_CANDIDATES,
        ),
    ] = None,
    vertices: Annotated[
        int, typer.Option(min=2, metavar="N", help="Minimum number of roadmap vertices.", rich_help_panel=_CANDIDATES)
    ] = 1000,
    seed: Annotated[
        int,
        typer.Option(min=0, metavar="N", help="Random seed; the same seed gives the same paths.", rich_help_panel=_CANDIDATES),
    ] = 0,
    spacing: Annotated[
        float, typer.Option(metavar="M", help="Metres between new poses.", callback=_above_zero, rich_help_panel=_FACTORS)
    ] = 1.0,
    closures: Annotated[
        Closures | None,
        typer.Option(
            metavar="NAME",
            help="Which loops close: learned from the graph, the rule of the paper, or by-hand, as the next three say.",
            show_default="learned",
            rich_help_panel=_FACTORS,
        ),
    ] = None,
    closure_radius: Annotated[
        float | None,
        typer.Option(
            metavar="M",
            help="By hand: loops close with all poses within this distance, metres.",
            show_default="2",
            callback=_above_zero,
            rich_help_panel=_FACTORS,
        ),
    ] = None,
    closure_angle: Annotated[
        float | None,
        typer.Option(
            metavar="RAD",
            help="… and within this difference of headings, radians.",
            show_default="any",
            callback=_angle,
            rich_help_panel=_FACTORS,
        ),
    ] = None,
    min_index_gap: Annotated[
        int | None,
        typer.Option(
            min=2,
            metavar="N",
            help="… and with a pose at least this many poses earlier.",
            show_default="5",
            rich_help_panel=_FACTORS,
        ),
    ] = None,
    sigma_p: Annotated[
        float | None,
        typer.Option(
            metavar="M",
            help="Noise of predicted positions, metres.",
            show_default="the graph's",
            callback=_above_zero,
            rich_help_panel=_FACTORS,
        ),
    ] = None,
    sigma_theta: Annotated[
        float | None,
        typer.Option(
            metavar="RAD",
            help="Noise of predicted headings, radians.",
            show_default="the graph's",
            callback=_heading_noise,
            rich_help_panel=_FACTORS,
        ),
    ] = None,
    line_of_sight: Annotated[
        bool | None,
        typer.Option(
            "--line-of-sight/--no-line-of-sight",
            metavar="",
            help="Close loops only with poses in line of sight.",
            show_default="yes",
            rich_help_panel=_RULES,
        ),
    ] = None,
    paper: Annotated[
        bool,
        typer.Option(
            "--paper",
            metavar="",
            help="Use the rules of the paper unless other options are given: headings within 1 rad, index gap 2, "
            "no line of sight, no detour limit.",
            rich_help_panel=_RULES,
        ),
    ] = False,
    objective: Annotated[
        str,
        typer.Option(
            callback=one_of(OBJECTIVES),
            autocompletion=completed(OBJECTIVES),
            metavar="NAME",
            help="Entropy to minimise: joint, of all poses (the paper's); map, of existing poses; or per_pose.",
            rich_help_panel=_DECISION,
        ),
    ] = "joint",
    signature: Annotated[
        str,
        typer.Option(
            callback=one_of(SIGNATURES),
            autocompletion=completed(SIGNATURES),
            metavar="NAME",
            help="Signature that ranks paths: spanning_trees, von_neumann or von_neumann_approx.",
            rich_help_panel=_DECISION,
        ),
    ] = "spanning_trees",
    normalized: Annotated[
        bool,
        typer.Option("--normalized", metavar="", help="Add a noise term to von_neumann_approx.", rich_help_panel=_DECISION),
    ] = False,
    allow_dense_spectrum: Annotated[
        bool,
        typer.Option(
            "--allow-dense-spectrum",
            metavar="",
            help="Allow von_neumann on large graphs, which is slow.",
            rich_help_panel=_DECISION,
        ),
    ] = False,
    margin: Annotated[
        float | None,
        typer.Option(
            metavar="NATS",
            help="Accept a path with at most this entropy, without bounding the others.",
            rich_help_panel=_DECISION,
        ),
    ] = None,
    deadline: Annotated[
        float | None,
        typer.Option(
            metavar="S", help="Time limit for the decision, seconds.", callback=_above_zero, rich_help_panel=_DECISION
        ),
    ] = None,
    bounds: Annotated[
        str,
        typer.Option(
            callback=one_of((*BOUNDS, AUTO)),
            autocompletion=completed((*BOUNDS, AUTO)),
            metavar="NAME",
            help="Family of bounds: fischer; fischer_step, tighter; paper, for equal noise; anchored and chain, tightest; "
            "auto, what proves for less.",
            rich_help_panel=_PROOF,
        ),
    ] = "fischer",
    determinant: Annotated[
        Determinant,
        typer.Option(
            metavar="NAME",
            help="Determinant in the lower bound: cholesky (exact) or hadamard (from diagonal).",
            rich_help_panel=_PROOF,
        ),
    ] = "cholesky",
    proof: Annotated[
        Proof,
        typer.Option(
            metavar="NAME",
            help="none: ranking only; bounded; or optimal: exact evaluations until proven.",
            rich_help_panel=_PROOF,
        ),
    ] = "bounded",
    max_evaluations: Annotated[
        int | None,
        typer.Option(min=0, metavar="N", help="Maximum number of exact evaluations.", rich_help_panel=_PROOF),
    ] = None,
    optimize: Annotated[
        bool,
        typer.Option(
            "--optimize/--no-optimize",
            metavar="",
            help="Compute the maximum-likelihood poses first.",
        ),
    ] = True,
    exact: Annotated[
        bool,
        typer.Option(
            "--exact/--no-exact",
            metavar="",
            help="Evaluate every path for the bounds picture, for a few seconds at most.",
            rich_help_panel=_OUTPUT,
        ),
    ] = True,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Folder for paths.png, bounds.png and decision.json.",
            show_default="out; with --json, none",
            rich_help_panel=_OUTPUT,
        ),
    ] = None,
    as_json: Annotated[
        bool,
        typer.Option("--json", metavar="", help="Print the decision as JSON and nothing else.", rich_help_panel=_OUTPUT),
    ] = False,
    drop: Drop = None,
    robust_as_plain: RobustAsPlain = False,
    edge2_order: Edge2OrderOption = "toro",
    component: Component = "all",
    planar: Planar = False,
) -> None:
    """Choose the best path to a goal on a pose-graph map.

    Ranks diverse paths by a topological signature of the resulting graph, and bounds the loss of that choice.
    """
    if (map_file is None) == (not along_trajectory):
        raise typer.BadParameter("expected one of --map FILE and --along-trajectory.", param_hint="the world")
    from topobelief.cli.console import Reporter

    reporter = Reporter(as_json=as_json)
    with reporter.stage("start-up"):
        from topobelief.candidates.predicted_factors import KEY_POSE_TURN
        from topobelief.candidates.propose import CandidateRule
        from topobelief.cli import plan_files, plan_stages
        from topobelief.cli.closure_options import stated_closures, with_closures
        from topobelief.planning.planner import Planner

    folder = plan_files.checked_folder(out if out is not None or as_json else Path("out"))
    limit = max_detour if max_detour is not None else math.inf if paper else 1.3
    rule = CandidateRule(
        num_paths=candidates,
        max_detour=limit if math.isfinite(limit) else None,
        num_vertices=vertices,
        robot_radius=robot_radius,
        seed=seed,
        spacing=spacing,
        turn=None if paper else KEY_POSE_TURN,
        closures=stated_closures(
            closures,
            paper=paper,
            closure_radius=closure_radius,
            closure_angle=closure_angle,
            min_index_gap=min_index_gap,
        ),
        line_of_sight=line_of_sight if line_of_sight is not None else not paper,
        information=plan_stages.information(sigma_p, sigma_theta),
    )
    reading = reading_options(
        drop, robust_as_plain=robust_as_plain, edge2_order=edge2_order, component=component, planar=planar
    )
    graph = plan_stages.read_graph(graph_file, reporter, optimized=optimize, reading=reading)
    world = plan_stages.read_world(map_file, graph, reporter, width=width, unknown=unknown)
    rule = with_closures(rule, graph, world, reporter)
    begin = plan_stages.choose_start(
        graph, world, reporter, pose_id=start.pose_id if start else None, place=start.place if start else None
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotOptimizedWarning)  # `read_graph` has told
        planner = Planner(
            graph,
            objective=objective,
            signature=signature,
            bounds=bounds,
            determinant=determinant,
            normalized=normalized,
            allow_dense_spectrum=allow_dense_spectrum,
        )
    found = plan_stages.find_candidates(graph, world, begin, goal, rule, reporter)
    with reporter.stage("decision") as update:
        decision = planner.decide(
            found.actions,
            margin=margin,
            proof=proof,
            max_evaluations=max_evaluations,
            deadline=deadline,
            on_progress=lambda _, done, total: update(done, total),
        )
    plan_stages.say_decision(decision, rule, reporter, along_trajectory=along_trajectory)
    entropies = plan_stages.exact_entropies(planner, found.actions, decision, reporter, wanted=exact and folder is not None)
    result = plan_files.PlanResult(
        graph=graph,
        world=world,
        start=begin,
        candidates=found,
        decision=decision,
        entropies=entropies,
        goal=goal,
        rule=rule,
        options=context.params,
        notes=reporter.notes,
    )
    if folder is not None:
        plan_files.write(folder, result, reporter)
    reporter.answer(plan_files.document(result))
