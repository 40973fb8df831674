"""The stages of `topobelief plan`: read, optimise, find candidates, decide; each tells what it did."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from time import monotonic

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.propose import CandidateRule
from topobelief.cli.console import Reporter
from topobelief.cli.prior import read_prior
from topobelief.errors import InvalidInputError, TopobeliefError
from topobelief.graph.action import Action
from topobelief.graph.fit import misfit
from topobelief.graph.information import block_isotropic
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.reading import ReadingOptions
from topobelief.planning.decision import Decision
from topobelief.planning.decision_quality import rank_correlation
from topobelief.planning.planner import Planner
from topobelief.report.tables import candidate_table
from topobelief.wording import counted

EXACT_SECONDS = 5.0
"""How long exact values that the decision did not need may take, for the picture of the bounds."""

_AT_ONCE = 8  # evaluations: several at once cost hardly more than one
_LENGTH_BIAS = 0.9  # rank correlation with the number of poses above which the ranking mostly counts them
_FEWEST_TO_JUDGE = 6  # candidates


def information(sigma_p: float | None, sigma_theta: float | None, *, tangent_dim: int = 3) -> FloatArray | None:
    """Information matrix of independent noise; None where none is given.

    Raises
    ------
    InvalidInputError
        Where one of the two is missing.
    """
    if sigma_p is None and sigma_theta is None:
        return None
    if sigma_p is None or sigma_theta is None:
        raise InvalidInputError("expected both --sigma-p and --sigma-theta or neither, got one; give both")
    return block_isotropic(sigma_p, sigma_theta, tangent_dim=tangent_dim)


def read_graph(
    path: Path,
    reporter: Reporter,
    *,
    optimized: bool,
    reading: ReadingOptions,
    accepted: Callable[[PoseGraph], PoseGraph],
) -> PoseGraph:
    """The prior.

    Parameters
    ----------
    accepted
        Makes of the graph of the file the one to work with, or raises, before it is optimised.

    Raises
    ------
    FileError
        For all that `read_prior` refuses.
    """
    prior = read_prior(path, reporter, optimized=optimized, reading=reading, accepted=accepted)
    filed, graph = prior.filed, prior.graph
    landmarks = f"{counted(graph.num_landmarks, 'landmark')}, " if graph.num_landmarks else ""
    reporter.say(f"{path}: {graph.num_poses} poses, {landmarks}{graph.num_edges} edges")
    if optimized:
        reporter.say(f"χ² per degree of freedom: {chi2_per_dof(filed)} as filed, {chi2_per_dof(graph)} optimised")
    if message := misfit(graph, optimized=optimized):
        reporter.note(f"{message}{'' if optimized else ' (leave out --no-optimize)'}.")
    return graph


def chi2_per_dof(graph: PoseGraph) -> str:
    """χ² over the degrees of freedom, for a person; a tree has none."""
    return f"{graph.chi2 / graph.degrees_of_freedom:.3g}" if graph.degrees_of_freedom else "none (a tree)"


def exact_entropies(
    planner: Planner, actions: Sequence[Action], decision: Decision, reporter: Reporter, *, wanted: bool
) -> FloatArray:
    """What the decision evaluated and, if wanted and time allows, the rest in ranking order; nan where unknown; shape (K,).

    The decision stands without them, so a value that could not be computed is reported and left out.
    """
    values = decision.entropies.copy()
    missing: list[int] = decision.ranking[np.isnan(values[decision.ranking])].tolist()
    if not wanted or not missing:
        return values
    begin, failures = monotonic(), list[TopobeliefError]()
    with reporter.stage("exact values") as update:
        parts = [missing[first : first + _AT_ONCE] for first in range(0, len(missing), _AT_ONCE)]
        for done, part in enumerate(parts):
            if monotonic() - begin > EXACT_SECONDS:
                break
            try:
                values[part] = planner.entropies([actions[action] for action in part])
            except TopobeliefError as error:
                failures += [error] * len(part)
            update(done + 1, len(parts))
    if failures:
        reporter.note(f"exact values in the picture: {len(failures)} of {len(actions)} could not be computed; {failures[0]}")
    known = int(np.count_nonzero(~np.isnan(values))) + len(failures)
    if known < len(actions):
        reporter.say(f"exact values in the picture: the first {known} of the ranking, all that {EXACT_SECONDS:g} s allowed")
    return values


def say_decision(decision: Decision, answer: str, rule: CandidateRule, reporter: Reporter, *, along_trajectory: bool) -> None:
    """The answer, what is known of it, what to make of it, and the table."""
    reporter.say("", answer, decision.summary())
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
        "--objective error or map compares candidates on the poses that exist now."
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
