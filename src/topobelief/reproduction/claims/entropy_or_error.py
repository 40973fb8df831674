"""Claims beyond the paper: which signature finds, and ranks, the paths that leave the least expected error of the map."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence

from topobelief.reproduction.claims.claim import BEYOND, Claim, claim_of_seeds
from topobelief.reproduction.entropy_or_error import ChoiceRow

NEGLIGIBLE = 0.01
"""Share of the least expected error that a choice may lose."""

_SYMBOLS = {"resistance": "s_R", "map_spanning_trees": "s_map"}


def choice_claims(rows: Sequence[ChoiceRow]) -> list[Claim]:
    """For each place, put to every decision: each seed, noise, detour and kind of closures."""
    places = list(dict.fromkeys(row.place for row in rows))
    losses = [_loss(place, name, [row for row in rows if row.place == place]) for name in _SYMBOLS for place in places]
    return [*losses, *(_ranks(place, [row for row in rows if row.place == place]) for place in places)]


def _loss(place: str, name: str, rows: Sequence[ChoiceRow]) -> Claim:
    shares = [row.share_lost for row in rows if row.chooser == name]
    centimetres = [100 * row.error_lost for row in rows if row.chooser == name]
    return claim_of_seeds(
        "entropy or error",
        f"the action of largest {_SYMBOLS[name]} leaves the least expected error of the map",
        BEYOND,
        place,
        [share <= NEGLIGIBLE for share in shares],
        f"lost: mean {100 * statistics.mean(shares):.2f} %, at most {100 * max(shares):.1f} %; "
        f"{statistics.mean(centimetres):.2f} and {max(centimetres):.1f} cm",
        f"at most {100 * NEGLIGIBLE:g} % more than the best action, in every decision",
        "",
    )


def _ranks(place: str, rows: Sequence[ChoiceRow]) -> Claim:
    both = zip(*([row.error_correlation for row in rows if row.chooser == name] for name in _SYMBOLS), strict=True)
    pairs = [  # where E differs at all; a signature that is the same for all actions ranks none
        tuple(0.0 if math.isnan(each) else each for each in pair) for pair in both if not all(map(math.isnan, pair))
    ]
    medians = [statistics.median(values) for values in zip(*pairs, strict=True)] or [math.nan, math.nan]
    return claim_of_seeds(
        "entropy or error",
        "s_R ranks the actions by expected error at least as well as s_map",
        BEYOND,
        place,
        [first >= second - 1e-12 for first, second in pairs],
        f"rank correlation with E: median {medians[0]:.3f}, of s_map {medians[1]:.3f}",
        "rank correlation not lower, in every decision",
        "",
    )
