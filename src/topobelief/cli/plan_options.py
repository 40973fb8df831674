"""The options of `topobelief plan`: what each is called, what it takes, and what help says about it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from topobelief.cli import plan_arguments as values
from topobelief.cli.choices import completed, one_of
from topobelief.planning.registry import AUTO, BOUNDS, OBJECTIVES, SIGNATURES

# The planner's own choices, repeated so that help need not load it; a test holds them together.
Determinant = Literal["cholesky", "hadamard"]
Proof = Literal["none", "bounded", "optimal"]
Closures = Literal["learned", "paper", "by-hand"]
Attitude = Literal["upright", "along"]

_SEARCH = "Search of the roadmap"
_CANDIDATES = "A list of candidates"
_FACTORS = "Predicted measurements"
_DECISION = "Decision"
_PROOF = "Bounds and proof"
_OUTPUT = "Output"

PathFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--path",
        metavar="FILE",
        help="A candidate of your own: .csv (x,y or x,y,yaw; x,y,z in 3D), .tum, or nav_msgs/Path in .yaml or .json. May be "
        "repeated, with or without a goal.",
        show_default=False,
        rich_help_panel=_CANDIDATES,
    ),
]
NumCandidates = Annotated[
    int | None,
    typer.Option(
        min=1,
        metavar="N",
        help="Compare so many diverse paths to each goal in place of searching the roadmap.",
        show_default="20 with --as-paper and --path",
        rich_help_panel=_CANDIDATES,
    ),
]
MaxLength = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        help="Longest way, metres, in place of --max-detour. Without a goal: of a trip to improve the map.",
        show_default=False,
        callback=values.above_zero,
        rich_help_panel=_SEARCH,
    ),
]
Return = Annotated[
    bool,
    typer.Option("--return", metavar="", help="The trip ends where it begins.", rich_help_panel=_SEARCH),
]
Enough = Annotated[
    float | None,
    typer.Option(
        metavar="GAIN",
        help="Without a goal: say whether any trip gains more than this, in the unit of the objective (metres of map error "
        "for error, else nats).",
        show_default=False,
        callback=values.at_least_zero,
        rich_help_panel=_SEARCH,
    ),
]
MaxDetour = Annotated[
    float | None,
    typer.Option(
        metavar="FACTOR",
        parser=values.detour,
        help='Longest path, as a multiple of the shortest; "none" or 0 for no limit, of candidates only.',
        show_default="1.3",
        rich_help_panel=_SEARCH,
    ),
]
Vertices = Annotated[int, typer.Option(min=2, metavar="N", help="Minimum number of roadmap vertices.", rich_help_panel=_SEARCH)]
Seed = Annotated[
    int,
    typer.Option(min=0, metavar="N", help="Random seed; the same seed gives the same roadmap.", rich_help_panel=_SEARCH),
]

Spacing = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        help="Metres between new poses.",
        show_default="1; in 3D the graph's median step",
        callback=values.above_zero,
        rich_help_panel=_FACTORS,
    ),
]
ClosuresName = Annotated[
    Closures | None,
    typer.Option(
        "--closures",
        metavar="NAME",
        help="Which loops close: learned from the graph; the rule of the paper; or by-hand, as the next three say.",
        show_default="learned",
        rich_help_panel=_FACTORS,
    ),
]
ClosureRadius = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        help="By hand: loops close with all poses within this distance, metres.",
        show_default="2",
        callback=values.above_zero,
        rich_help_panel=_FACTORS,
    ),
]
ClosureAngle = Annotated[
    float | None,
    typer.Option(
        metavar="RAD",
        help="… and within this difference of headings, radians.",
        show_default="any",
        callback=values.angle,
        rich_help_panel=_FACTORS,
    ),
]
MinIndexGap = Annotated[
    int | None,
    typer.Option(
        min=2,
        metavar="N",
        help="… and with a pose at least this many poses earlier.",
        show_default="5",
        rich_help_panel=_FACTORS,
    ),
]
ObservationRange = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        help="Known landmarks are observed within this distance, metres.",
        show_default="learned",
        callback=values.above_zero,
        rich_help_panel=_FACTORS,
    ),
]
FieldOfView = Annotated[
    float | None,
    typer.Option(
        metavar="RAD",
        help="… within this whole angle about the direction ahead, radians.",
        show_default="learned",
        callback=values.field_of_view,
        rich_help_panel=_FACTORS,
    ),
]
ObservationCap = Annotated[
    int | None,
    typer.Option(min=1, metavar="N", help="… at most so many a pose.", show_default="learned", rich_help_panel=_FACTORS),
]
ObservationChance = Annotated[
    float | None,
    typer.Option(
        metavar="P",
        help="… each with this probability.",
        show_default="learned",
        callback=values.probability,
        rich_help_panel=_FACTORS,
    ),
]
LineOfSight = Annotated[
    bool | None,
    typer.Option(
        "--line-of-sight/--no-line-of-sight",
        metavar="",
        help="Close loops only with poses, and observe only landmarks, in line of sight.",
        show_default="yes",
        rich_help_panel=_FACTORS,
    ),
]
AttitudeName = Annotated[
    Attitude | None,
    typer.Option(
        "--attitude",
        metavar="NAME",
        help="Of new poses in 3D, which head along the path: upright, or along it with its slope and roll.",
        show_default="upright if all poses are",
        rich_help_panel=_FACTORS,
    ),
]
SigmaP = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        help="Noise of predicted positions, metres.",
        show_default="the graph's",
        callback=values.above_zero,
        rich_help_panel=_FACTORS,
    ),
]
SigmaTheta = Annotated[
    float | None,
    typer.Option(
        metavar="RAD",
        help="Noise of predicted headings, radians.",
        show_default="the graph's",
        callback=values.heading_noise,
        rich_help_panel=_FACTORS,
    ),
]

Objective = Annotated[
    str | None,
    typer.Option(
        callback=one_of(OBJECTIVES),
        autocompletion=completed(OBJECTIVES),
        metavar="NAME",
        help="What to minimise: error, the expected error of the map in metres; or an entropy in nats: map, of existing "
        "poses; joint, of all poses (the paper's); or per_pose.",
        show_default="error",
        rich_help_panel=_DECISION,
    ),
]
Signature = Annotated[
    str | None,
    typer.Option(
        callback=one_of(SIGNATURES),
        autocompletion=completed(SIGNATURES),
        metavar="NAME",
        help="Signature that ranks paths: resistance, spanning_trees, von_neumann or von_neumann_approx.",
        show_default="resistance for error, else spanning_trees",
        rich_help_panel=_DECISION,
    ),
]
CostPerMetre = Annotated[
    float,
    typer.Option(
        metavar="C",
        help="What a driven metre costs, in the unit of the objective: metres of map error for error, else nats.",
        callback=values.at_least_zero,
        rich_help_panel=_DECISION,
    ),
]
AsPaper = Annotated[
    bool,
    typer.Option(
        "--as-paper",
        "--paper",
        metavar="",
        help="All choices of the paper unless other options are given: joint entropy, spanning trees, bounds without exact "
        "values, its rule of closures, no line of sight, no detour limit.",
        rich_help_panel=_DECISION,
    ),
]
Normalized = Annotated[
    bool,
    typer.Option("--normalized", metavar="", help="Add a noise term to von_neumann_approx.", rich_help_panel=_DECISION),
]
AllowDenseSpectrum = Annotated[
    bool,
    typer.Option(
        "--allow-dense-spectrum",
        metavar="",
        help="Allow von_neumann on large graphs, which is slow.",
        rich_help_panel=_DECISION,
    ),
]
Margin = Annotated[
    float | None,
    typer.Option(
        metavar="VALUE",
        help="Accept a path whose objective is at most this, without bounding the others.",
        rich_help_panel=_DECISION,
    ),
]
Deadline = Annotated[
    float | None,
    typer.Option(
        "--seconds",
        "--deadline",
        metavar="S",
        help="How long to search the roadmap; among candidates, time limit for the decision. Ctrl-C ends a search, too.",
        show_default="2; none with --max-evaluations or candidates",
        callback=values.above_zero,
        rich_help_panel=_SEARCH,
    ),
]

BoundsName = Annotated[
    str | None,
    typer.Option(
        "--bounds",
        callback=one_of((*BOUNDS, AUTO)),
        autocompletion=completed((*BOUNDS, AUTO)),
        metavar="NAME",
        help="Family of bounds: fischer; fischer_step, tighter; paper, for equal noise; anchored and chain, tightest; "
        "auto, what proves for less.",
        show_default="auto",
        rich_help_panel=_PROOF,
    ),
]
DeterminantName = Annotated[
    Determinant,
    typer.Option(
        "--determinant",
        metavar="NAME",
        help="Determinant in the lower bound: cholesky (exact) or hadamard (from diagonal).",
        rich_help_panel=_PROOF,
    ),
]
ProofName = Annotated[
    Proof | None,
    typer.Option(
        "--proof",
        metavar="NAME",
        help="none: ranking only; bounded; or optimal: exact evaluations until proven.",
        show_default="optimal; with --margin, bounded",
        rich_help_panel=_PROOF,
    ),
]
MaxEvaluations = Annotated[
    int | None,
    typer.Option(min=0, metavar="N", help="Maximum number of exact evaluations.", rich_help_panel=_PROOF),
]

Exact = Annotated[
    bool,
    typer.Option(
        "--exact/--no-exact",
        metavar="",
        help="Evaluate every path for the bounds picture, for a few seconds at most.",
        rich_help_panel=_OUTPUT,
    ),
]
Why = Annotated[
    list[str] | None,
    typer.Option(
        metavar="PATH",
        help="Explain this path, by its number or label; may be repeated.",
        show_default=False,
        rich_help_panel=_OUTPUT,
    ),
]
Out = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER",
        help="Folder for paths.png and decision.json; of a list of candidates, bounds.png too.",
        show_default="out; with --json, none",
        rich_help_panel=_OUTPUT,
    ),
]
WritePath = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Write the chosen path, with a heading at every pose: .csv, .tum, or nav_msgs/Path in .yaml or .json.",
        show_default=False,
        rich_help_panel=_OUTPUT,
    ),
]
AsJson = Annotated[
    bool,
    typer.Option("--json", metavar="", help="Print the decision as JSON and nothing else.", rich_help_panel=_OUTPUT),
]
