"""Claims about the decisions of the planning sessions: consistency of signatures, and how bounds behave with the noise."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.planning.decision_quality import decision_quality, rank_correlation
from topobelief.reproduction.claims.claim import IN_SESSIONS, SIGNATURES, Claim, claim_of_seeds
from topobelief.reproduction.planning_sessions import NOISES, SESSIONS, ActionRow, cases

TIE = 1e-6
"""Nats: a choice that loses no more than this is as good as the best, and an order broken by no more is kept."""

CLOSE = 0.05
"""Share of the spread of J within which UB is called close."""


def decision_claims(rows: Sequence[ActionRow]) -> list[Claim]:
    """Each put to every seed of roadmap and paths."""
    return [
        *_action_consistency(rows),
        *_order_consistency(rows),
        *_normalised_in_sessions(rows),
        *_bounds(rows),
    ]


def _action_consistency(rows: Sequence[ActionRow]) -> list[Claim]:
    found: list[Claim] = []
    for name, symbol in SIGNATURES.items():
        if name == "von_neumann_normalized":
            continue
        for session, xi, decisions in _by_case(rows):
            losses = [decision_quality(_column(d, "joint"), _column(d, name)).error for d in decisions]
            worst = f"lost: mean {np.mean(losses):.2g}, at most {max(losses):.2g} nats"
            found.append(
                claim_of_seeds(
                    "action consistency",
                    f"the action of largest {symbol} has the least joint entropy",
                    IN_SESSIONS,
                    f"{session}, ξ = {xi:g}",
                    [loss <= TIE for loss in losses],
                    worst,
                    "|ΔJ| ≤ 1e-6 nats in every seed",
                    "",
                )
            )
    return found


def _order_consistency(rows: Sequence[ActionRow]) -> list[Claim]:
    found: list[Claim] = []
    for session, xi, decisions in _by_case(rows):
        quality = [decision_quality(_column(d, "joint"), _column(d, "spanning_trees")) for d in decisions]
        gammas = [each.gamma for each in quality]
        correlation = statistics.median(each.spearman for each in quality)
        found.append(
            claim_of_seeds(
                "order consistency",
                "s_ST keeps the order of all actions",
                IN_SESSIONS,
                f"{session}, ξ = {xi:g}",
                [gamma <= TIE for gamma in gammas],
                f"γ: median {statistics.median(gammas):.2g} nats; rank correlation: median {correlation:.3f}",
                "γ ≤ 1e-6 nats in every seed",
                "",
            )
        )
    return found


def _normalised_in_sessions(rows: Sequence[ActionRow]) -> list[Claim]:
    found: list[Claim] = []
    for session, xi, decisions in _by_case(rows):
        plain, normalised = (
            [rank_correlation(_column(d, "joint"), -_column(d, name)) for d in decisions]
            for name in ("von_neumann_approx", "von_neumann_normalized")
        )
        medians = f"rank correlation: median {statistics.median(normalised):.3f}, without {statistics.median(plain):.3f}"
        found.append(
            claim_of_seeds(
                "normalised ŝ_VN",
                "normalising ŝ_VN by the noise ranks the actions of a session better",
                "closing remark",
                f"{session}, ξ = {xi:g}",
                [a >= b - 1e-12 for a, b in zip(normalised, plain, strict=True)],
                medians,
                "rank correlation with J not lower than without, in every seed",
                "",
            )
        )
    return found


def _bounds(rows: Sequence[ActionRow]) -> list[Claim]:
    found: list[Claim] = []
    gaps: dict[tuple[str, str], list[FloatArray]] = {}
    for session, xi, decisions in _by_case(rows):
        shares = [
            float(np.mean(_column(d, "paper_upper") - _column(d, "joint")) / np.ptp(_column(d, "joint"))) for d in decisions
        ]
        found.append(
            claim_of_seeds(
                "upper bound",
                "UB is close to J",
                IN_SESSIONS,
                f"{session}, ξ = {xi:g}",
                [share <= CLOSE for share in shares],
                f"mean UB − J: {100 * statistics.median(shares):.1f} % of the spread of J (median), "
                f"at most {100 * max(shares):.1f} %; J from {_median_of(decisions, np.min)} to "
                f"{_median_of(decisions, np.max)} nats (medians)",
                "mean UB − J ≤ 5 % of J's spread over the actions, in every seed",
                "J from −610 to −450 nats" if (session, xi) == ("S2", NOISES[0]) else "",
            )
        )
        below = [_column(d, "joint") - _column(d, "paper_lower") for d in decisions]
        looser = [_column(d, "paper_lower") - _column(d, "paper_hadamard") for d in decisions]
        gaps.setdefault((session, "below"), []).append(np.array([gap.mean() for gap in below]))
        gaps.setdefault((session, "looser"), []).append(np.array([gap.mean() for gap in looser]))
    texts = {
        "below": ("lower bound", "LB is sensitive to ξ: it moves away from J as ξ grows", "mean J − LB", "rises"),
        "looser": ("Hadamard's bound", "LB by Hadamard tightens to LB as ξ grows", "mean LB − LB_H", "falls"),
    }
    for kind, (topic, claim, quantity, way) in texts.items():
        for session in SESSIONS:
            by_noise = np.stack(gaps[session, kind])
            steps = np.diff(by_noise, axis=0)
            monotone = np.all(steps > 0 if way == "rises" else steps < 0, axis=0)
            medians = " → ".join(f"{value:.3g}" for value in np.median(by_noise, axis=1).tolist())
            found.append(
                claim_of_seeds(
                    topic,
                    claim,
                    IN_SESSIONS,
                    f"{session}, ξ = {' → '.join(f'{xi:g}' for xi in NOISES)}",
                    [bool(each) for each in monotone],
                    f"{quantity}: {medians} nats (medians)",
                    f"{quantity} {way} with ξ, in every seed",
                    "",
                )
            )
    return found


def _by_case(rows: Sequence[ActionRow]) -> list[tuple[str, float, list[list[ActionRow]]]]:
    """Session, noise, and the candidates of each seed."""
    found = cases(rows)
    return [
        (session, xi, [candidates for (name, noise, _), candidates in found.items() if (name, noise) == (session, xi)])
        for session in SESSIONS
        for xi in NOISES
    ]


def _median_of(decisions: Sequence[Sequence[ActionRow]], extreme: Callable[[FloatArray], float]) -> str:
    """Of the least, or the largest, joint entropy of each decision, in whole nats."""
    median = statistics.median(float(extreme(_column(d, "joint"))) for d in decisions)
    return f"{median:.0f}".replace("-", "\N{MINUS SIGN}")


def _column(rows: Sequence[ActionRow], name: str) -> FloatArray:
    return np.array([getattr(row, name) for row in rows], dtype=np.float64)
