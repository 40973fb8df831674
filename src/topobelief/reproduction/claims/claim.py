"""One line of the table of claims, and what it takes for a claim about decisions to hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

SIGNATURES = {
    "spanning_trees": "s_ST",
    "von_neumann": "s_VN",
    "von_neumann_approx": "ŝ_VN",
    "von_neumann_normalized": "normalised ŝ_VN",
}
"""What the signatures are called in text."""

IN_SESSIONS, IN_SYNTHETIC = "planning sessions S1 and S2", "synthetic pose graphs"
"""Where the paper says it."""

BEYOND = "beyond the paper"


@dataclass(frozen=True, slots=True)
class Claim:
    """One line of the table.

    Attributes
    ----------
    topic
        Claims of one topic stand together.
    claim
        In our words.
    where
        In the paper.
    scope
        Of this line: session, noise.
    measured
        What was found.
    threshold
        What makes it hold.
    cases, holding
        Seeds (or sizes) it was put to, and those in which it held.
    holds
    published
        The paper's own number where it prints one, for the reader.
    """

    topic: str
    claim: str
    where: str
    scope: str
    measured: str
    threshold: str
    cases: int
    holding: int
    holds: bool
    published: str


def claim_of_seeds(
    topic: str, claim: str, where: str, scope: str, verdicts: Sequence[bool], measured: str, threshold: str, published: str
) -> Claim:
    """A claim that holds where every seed has it so; parameters as the attributes of `Claim`."""
    holding = sum(map(bool, verdicts))
    return Claim(topic, claim, where, scope, measured, threshold, len(verdicts), holding, holding == len(verdicts), published)
