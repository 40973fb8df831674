"""How far the values of the finalists spread, because nobody knows which of their closures will be made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from topobelief.cli.console import Reporter
from topobelief.cli.plan_candidates import Proposals
from topobelief.errors import TopobeliefError
from topobelief.planning.decision import Decision
from topobelief.planning.drawn_closures import drawn_values
from topobelief.planning.planner import Planner
from topobelief.planning.units import cell, shown_unit

NUM_DRAWS = 30
FEWEST_DRAWS = 10
_MOST_CLOSURES = 5000  # expected, over all draws of a candidate; with more, draws take longer than all that came before


@dataclass(frozen=True, slots=True)
class Spread:
    """Mean and standard deviation of a candidate's exact objective over draws of its closures, in the objective's unit."""

    action: int
    mean: float
    std: float


def finalists(decision: Decision, shortest: int) -> list[int]:
    """The chosen candidate, the best of the others by what is known of them, and the shortest; each once."""
    known = np.where(np.isnan(decision.lower), np.inf, decision.lower)
    known[decision.best] = np.inf
    ranking: list[int] = decision.ranking.tolist()
    others = [index for index in ranking if index != decision.best]
    runner_up = sorted(others, key=lambda index: known[index])[:1]
    return list(dict.fromkeys([decision.best, *runner_up, shortest]))


def spreads(
    planner: Planner, proposals: Proposals, decision: Decision, shortest: int, reporter: Reporter, *, seed: int
) -> list[Spread]:
    """Of the finalists whose closures are not certain; told in one line."""
    found: list[Spread] = []
    chosen = finalists(decision, shortest)
    number = num_draws(
        max(proposals.actions[index].expected_closures + proposals.actions[index].expected_observations for index in chosen)
    )
    with reporter.stage("draws"):
        for index in chosen:
            action = proposals.actions[index]
            if action.probabilities is None:
                continue
            try:
                drawn = drawn_values(planner, action, number, rng=np.random.default_rng(seed))
            except TopobeliefError as error:
                reporter.note(f"draws of closures: {decision.name(index)} could not be evaluated; {error}")
                continue
            found.append(Spread(index, drawn.mean, drawn.std))
    if found:
        reporter.say(_told(decision, found, number))
    return found


def num_draws(expected_closures: float) -> int:
    """How many draws are taken of candidates with up to so many closures.

    Examples
    --------
    >>> num_draws(0.0), num_draws(130.0), num_draws(250.0), num_draws(900.0)
    (30, 30, 20, 10)
    """
    return int(np.clip(_MOST_CLOSURES / max(expected_closures, 1.0), FEWEST_DRAWS, NUM_DRAWS))


def _told(decision: Decision, found: Sequence[Spread], number: int) -> str:
    unit = decision.unit
    each = [f"{decision.name(one.action)} {cell(one.mean, unit)} ± {cell(one.std, unit)}" for one in found]
    return (
        f"If each closure is made or not, by its probability ({number} draws), the {decision.quantity} in "
        f"{shown_unit(unit)} is: {', '.join(each)}."
    )
