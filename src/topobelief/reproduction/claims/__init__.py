"""What Kitanov and Indelman (arXiv 1903.00927) claim, what was measured, by which threshold, and whether it holds.

A claim about decisions is put to every seed of roadmap and paths and holds where it holds in all of them; the share in which
it does stands beside it. What the paper published is shown to the reader and takes no part in the verdict.
"""

from __future__ import annotations

from collections.abc import Sequence

from topobelief.reproduction.claims.claim import SIGNATURES, Claim
from topobelief.reproduction.claims.decisions import decision_claims
from topobelief.reproduction.claims.entropy_or_error import choice_claims
from topobelief.reproduction.claims.speed import random_graph_speed_claims, session_speed_claims
from topobelief.reproduction.claims.trend import graph_correlation, slope_ratio, trend_claims
from topobelief.reproduction.entropy_or_error import ChoiceRow
from topobelief.reproduction.planning_sessions import ActionRow
from topobelief.reproduction.random_graphs import RandomGraphRow
from topobelief.reproduction.time_per_action import TimeRow

__all__ = ["SIGNATURES", "Claim", "claims", "graph_correlation", "slope_ratio"]


def claims(
    actions: Sequence[ActionRow],
    times: Sequence[TimeRow],
    random_graphs: Sequence[RandomGraphRow],
    choices: Sequence[ChoiceRow],
) -> list[Claim]:
    """The whole table; the last lines are of what goes beyond the paper."""
    return [
        *decision_claims(actions),
        *session_speed_claims(times),
        *trend_claims(random_graphs),
        *random_graph_speed_claims(random_graphs),
        *choice_claims(choices),
    ]
