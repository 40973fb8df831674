"""Claims are judged by the rows, and by nothing that was published."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from topobelief.reproduction.claims import claims, graph_correlation, slope_ratio
from topobelief.reproduction.planning_sessions import NOISES, SESSIONS, ActionRow
from topobelief.reproduction.random_graphs import RandomGraphRow
from topobelief.reproduction.time_per_action import METHODS, TimeRow


def action(session: str, xi: float, seed: int, number: int) -> ActionRow:
    """Of two actions the second is better, by all signatures; the gaps of the bounds behave as claimed."""
    J = -100.0 * number
    gap, looser = 10 * xi, 1 / xi
    return ActionRow(
        **{"session": session, "xi": xi, "seed": seed, "action": number, "length": 10.0},
        **{"num_poses": 10, "num_new_poses": 9, "num_closures": number},
        **{"joint": J, "map": J, "per_pose": J / 9, "map_spanning_trees": -J},
        **dict.fromkeys(("spanning_trees", "von_neumann", "von_neumann_approx", "von_neumann_normalized"), -J),
        **{"paper_lower": J - gap, "paper_upper": J + 1, "paper_hadamard": J - gap - looser},
        **{"fischer_lower": J, "fischer_upper": J, "fischer_hadamard": J, "anchored_lower": J, "anchored_upper": J},
    )


ACTIONS = [action(s, xi, seed, n) for s in SESSIONS for xi in NOISES for seed in (0, 1) for n in (1, 2)]


def times(standard: float) -> list[TimeRow]:
    """Everything takes 1 ms, standard planning as long as it is told."""
    return [
        TimeRow(s, xi, 0, method, "", 1e-3, standard if method.startswith("standard") else 1e-3, 0.0, 9, 1)
        for s in SESSIONS
        for xi in NOISES
        for method in METHODS
    ]


def graph(n: int, density: float, shift: float) -> RandomGraphRow:
    """J = -s_ST at every size; the approximate signature is shifted from size to size."""
    s = n * (1 + density)
    return RandomGraphRow(n, density, 0, 1, -s, s, s, s + shift * n, s, 1e-2, 1e-2, 1e-3, 1e-1)


GRAPHS = [graph(n, density, shift=float(n > 10)) for n in (10, 20) for density in (0.1, 0.5, 1.0)]


def verdicts(actions: list[ActionRow] = ACTIONS, standard: float = 0.1) -> dict[tuple[str, str], bool]:
    return {(claim.claim, claim.scope): claim.holds for claim in claims(actions, times(standard), GRAPHS, [])}


def test_rows_that_behave_as_claimed_pass() -> None:
    failed = [key for key, holds in verdicts().items() if not holds]
    assert failed == []


def test_one_seed_that_loses_is_enough() -> None:
    """The second action of one seed is no longer the best, but still has the largest signature."""
    changed = [replace(a, joint=-50.0) if (a.session, a.xi, a.seed, a.action) == ("S2", 0.35, 1, 2) else a for a in ACTIONS]
    found = verdicts(changed)
    assert not found["the action of largest s_ST has the least joint entropy", "S2, ξ = 0.35"]
    assert not found["s_ST keeps the order of all actions", "S2, ξ = 0.35"]
    assert found["the action of largest s_ST has the least joint entropy", "S1, ξ = 0.35"]


def test_a_tie_is_consistent() -> None:
    tied = [replace(a, joint=-100.0 + (5e-7 if a.action == 2 else 0.0)) for a in ACTIONS]
    assert verdicts(tied)["the action of largest s_ST has the least joint entropy", "S1, ξ = 0.1"]


@pytest.mark.parametrize(("standard", "holds"), [(9e-3, False), (11e-3, True)])
def test_an_order_of_magnitude_is_ten_times(standard: float, holds: bool) -> None:
    assert verdicts(standard=standard)["s_ST is an order of magnitude faster than standard planning", "S1"] is holds


def test_bounds_far_from_the_entropy_fail() -> None:
    far = [replace(a, paper_upper=a.joint + 5.1) for a in ACTIONS]  # of a spread of 100
    assert not verdicts(far)["UB is close to J", "S1, ξ = 0.1"]


def test_gaps_that_do_not_follow_the_noise_fail() -> None:
    flat = [replace(a, paper_lower=a.joint - 3, paper_hadamard=a.joint - 4) for a in ACTIONS]
    failed = {claim for (claim, _), holds in verdicts(flat).items() if not holds}
    assert failed == {
        "LB is sensitive to ξ: it moves away from J as ξ grows",
        "LB by Hadamard tightens to LB as ξ grows",
    }


def test_shifted_signatures_jump_between_sizes_and_follow_within() -> None:
    assert slope_ratio(GRAPHS, "spanning_trees") == pytest.approx(1.0)
    assert slope_ratio(GRAPHS, "von_neumann_approx") == pytest.approx(
        np.polyfit([15.3, 50.7], [15.3, 30.7], 1)[0] ** -1, rel=0.05
    )
    for n in (10, 20):
        assert graph_correlation([g for g in GRAPHS if g.num_poses == n], "von_neumann_approx") == pytest.approx(1.0)
