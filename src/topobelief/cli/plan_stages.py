"""The stages of `topobelief plan`: read, optimise, find candidates, decide; each tells what it did."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from time import monotonic

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.homotopy import count_classes
from topobelief.candidates.propose import CandidateRule, Candidates, find_routes, predict_candidates
from topobelief.candidates.start import Start, find_start
from topobelief.cli.console import Reporter
from topobelief.cli.prior import read_prior
from topobelief.errors import FileError, InvalidInputError, PlanningError, TopobeliefError
from topobelief.graph.action import Action
from topobelief.graph.fit import misfit
from topobelief.graph.information import block_isotropic
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io import floor_plan
from topobelief.io.reading import ReadingOptions
from topobelief.io.ros_map import Unknown
from topobelief.planning.decision import Decision
from topobelief.planning.decision_quality import rank_correlation
from topobelief.planning.planner import Planner
from topobelief.report.tables import candidate_table
from topobelief.symbols import find_node, node_name
from topobelief.wording import counted
from topobelief.world import World
from topobelief.world.trajectory import default_width

EXACT_SECONDS = 5.0
"""How long exact values that the decision did not need may take, for the picture of the bounds."""

_LENGTH_BIAS = 0.9  # rank correlation with the number of poses above which the ranking mostly counts them
_FEWEST_TO_JUDGE = 6  # candidates
_DOUBTFUL_SHARE = 0.1  # of the poses outside free space, above which map and graph may not belong together


def information(sigma_p: float | None, sigma_theta: float | None) -> FloatArray | None:
    """Information matrix in SE(2) of independent noise; None where none is given.

    Raises
    ------
    InvalidInputError
        Where one of the two is missing.
    """
    if sigma_p is None and sigma_theta is None:
        return None
    if sigma_p is None or sigma_theta is None:
        raise InvalidInputError("expected both --sigma-p and --sigma-theta or neither, got one; give both")
    return block_isotropic(sigma_p, sigma_theta)


def read_graph(path: Path, reporter: Reporter, *, optimized: bool, reading: ReadingOptions) -> PoseGraph:
    """The prior, in the plane.

    Raises
    ------
    FileError
        For a graph in SE(3), besides all that `read_prior` refuses.
    """
    prior = read_prior(path, reporter, optimized=optimized, reading=reading)
    filed, graph = prior.filed, prior.graph
    if graph.group.position_dim != 2:
        advice = "if it is planar but for its format, pass --planar"
        raise FileError(path, f"expected a graph in SE(2) to plan in the plane, got one in {graph.group.name}; {advice}")
    reporter.say(f"{path}: {graph.num_poses} poses, {graph.num_edges} edges")
    if optimized:
        reporter.say(f"χ² per degree of freedom: {chi2_per_dof(filed)} as filed, {chi2_per_dof(graph)} optimised")
    if message := misfit(graph):
        reporter.note(f"{message}{'' if optimized else ' (leave out --no-optimize)'}.")
    return graph


def chi2_per_dof(graph: PoseGraph) -> str:
    """χ² over the degrees of freedom, for a person; a tree has none."""
    return f"{graph.chi2 / graph.degrees_of_freedom:.3g}" if graph.degrees_of_freedom else "none (a tree)"


def read_world(map_file: Path | None, graph: PoseGraph, reporter: Reporter, *, width: float | None, unknown: Unknown) -> World:
    """The floor plan, or what lies along the trajectory where there is none."""
    with reporter.stage("world"):
        if map_file is not None:
            world, source = floor_plan.read_world(map_file, unknown=unknown), str(map_file)
        else:
            width = default_width(graph) if width is None else width
            world, source = World.from_trajectory(graph, width), f"within {width:.2f} m of the trajectory"
    x_min, y_min, x_max, y_max = world.bounds
    reporter.say(f"world: {source}, {x_max - x_min:.1f} × {y_max - y_min:.1f} m")
    if message := poses_outside(graph, world):
        reporter.note(message)
    return world


def poses_outside(graph: PoseGraph, world: World) -> str | None:
    """How many poses are not in free space, and what that may mean; None where all are."""
    outside, total = int(np.count_nonzero(~world.contains(graph.positions))), graph.num_poses
    if not outside:
        return None
    question = ": another map or another frame?" if outside > _DOUBTFUL_SHARE * total else ""
    return f"{outside} of {total} poses {'is' if outside == 1 else 'are'} not in free space{question}"


def choose_start(
    graph: PoseGraph,
    world: World,
    reporter: Reporter,
    *,
    pose_id: str | None = None,
    place: tuple[float, float] | None = None,
) -> Start:
    """The pose with an id, a place, or the last pose; told, and whether the robot may be elsewhere.

    Raises
    ------
    InvalidInputError
        Where the graph has no pose of that id.
    PlanningError
        Where no pose is in sight of the place.
    """
    last = graph.num_poses - 1
    ids: list[int] = graph.ids.tolist()
    if place is not None:
        start = find_start(graph, place, world=world)
        nearest = f"{start.distance(graph):.2f} m from pose {node_name(ids[start.pose])}, the nearest in sight"
        reporter.say(f"from {_shown(start.place)}, {nearest}")
        return start
    if pose_id is not None:
        index = find_node(ids, pose_id)
        if index is None:
            known = f"from {node_name(min(ids))} to {node_name(max(ids))}"
            raise InvalidInputError(f"expected --start as the id of a pose of the file ({known}) or as X Y, got {pose_id}")
        start = find_start(graph, index)
        reporter.say(f"from pose {pose_id} at {_shown(start.place)}")
        return start
    start = find_start(graph, last)
    reporter.say(f"from pose {node_name(ids[last])}, the last of the file, at {_shown(start.place)}")
    end = graph.odometry_end
    if end is not None and end != last:
        reporter.note(
            f"the odometry from the first pose on ends at pose {node_name(ids[end])}, not at pose {node_name(ids[last])}; "
            f"if the robot stands there, pass --start {node_name(ids[end])}"
        )
    return start


def find_candidates(
    graph: PoseGraph, world: World, begin: Start, goal: Sequence[float], rule: CandidateRule, reporter: Reporter
) -> Candidates:
    """Diverse paths from the start to the goal, and the factors that each would add.

    Raises
    ------
    PlanningError
        Where there is no path; says also when poses are not in free space, which may be the cause.
    """
    try:
        with reporter.stage("paths"):
            routes = find_routes(world, begin, goal, rule)
    except PlanningError as error:
        if outside := poses_outside(graph, world):
            raise PlanningError(f"{error}; {outside}") from None
        raise
    paths, lengths = routes.paths, routes.lengths
    classes = count_classes(routes.roadmap, paths)
    at_least = "" if classes.is_exact else "at least "
    num_classes = at_least + counted(classes.number, "homotopy class", "homotopy classes")
    fewer = f" of {rule.num_paths} asked for" if len(paths) < rule.num_paths else ""
    reporter.say(
        f"{counted(len(paths), 'path')}{fewer} from {_shown(begin.place)} to {_shown(goal)}: "
        f"{num_classes}, {lengths.min():.1f} to {lengths.max():.1f} m"
    )
    with reporter.stage("factors"):
        return predict_candidates(graph, world, routes, rule, start=begin)


def exact_entropies(
    planner: Planner, actions: Sequence[Action], decision: Decision, reporter: Reporter, *, wanted: bool
) -> FloatArray:
    """What the decision evaluated and, if wanted and time allows, the rest in ranking order; nan where unknown; shape (K,).

    The decision stands without them, so a value that could not be computed is reported and left out.
    """
    values = decision.entropies.copy()
    if not wanted:
        return values
    begin, failures = monotonic(), list[TopobeliefError]()
    with reporter.stage("exact values") as update:
        ranking: list[int] = decision.ranking.tolist()
        for done, action in enumerate(ranking):
            if monotonic() - begin > EXACT_SECONDS:
                break
            if math.isnan(values[action]):
                try:
                    values[action] = planner.entropies([actions[action]])[0]
                except TopobeliefError as error:
                    failures.append(error)
            update(done + 1, len(actions))
    if failures:
        reporter.note(f"exact values in the picture: {len(failures)} of {len(actions)} could not be computed; {failures[0]}")
    known = int(np.count_nonzero(~np.isnan(values))) + len(failures)
    if known < len(actions):
        reporter.say(f"exact values in the picture: the first {known} of the ranking, all that {EXACT_SECONDS:g} s allowed")
    return values


def say_decision(decision: Decision, rule: CandidateRule, reporter: Reporter, *, along_trajectory: bool) -> None:
    """The answer, what to make of it, and the table."""
    reporter.say("", decision.summary())
    for hint in (length_bias_hint(decision), more_candidates_hint(decision, rule, along_trajectory=along_trajectory)):
        if hint:
            reporter.note(hint)
    reporter.say(candidate_table(decision))


def length_bias_hint(decision: Decision) -> str | None:
    """One line where a ranking by joint entropy mostly follows the number of poses."""
    if decision.objective != "joint" or decision.num_actions < _FEWEST_TO_JUDGE:
        return None
    ranking: list[int] = decision.ranking.tolist()
    poses = [decision.candidates[action].num_new_poses for action in ranking]
    correlation = rank_correlation(-np.arange(decision.num_actions), poses)
    if not correlation > _LENGTH_BIAS:  # nan where all have as many
        return None
    return (
        f"This ranking mostly counts poses (rank correlation {correlation:.2f}): joint entropy falls with every pose added; "
        "--objective map compares candidates on the poses that exist now."
    )


def more_candidates_hint(decision: Decision, rule: CandidateRule, *, along_trajectory: bool) -> str | None:
    """What would bring more candidates, where there is only one."""
    if decision.num_actions > 1:
        return None
    if rule.num_paths == 1:
        return "To get more candidates, raise --candidates (1 now)."
    detour = f"raise --max-detour ({rule.max_detour:g} now), " if rule.max_detour is not None else ""
    width = ", raise --width" if along_trajectory else ""
    return (
        f"To get more candidates, {detour}lower --robot-radius ({rule.robot_radius:g} m now){width} "
        f"or raise --vertices ({rule.num_vertices} now)."
    )


def _shown(place: Sequence[float] | FloatArray) -> str:
    return f"({place[0]:.2f}, {place[1]:.2f})"
