"""The price of a metre that keeps longest paths within a length."""

from __future__ import annotations

_ROUNDING = 1e-9  # relative
_SAME_PLACE = 1e-9  # metres


def next_toll(lines: list[tuple[float, float]], toll: float, max_length: float) -> float | None:
    """The price of a metre to try next: where the best too long path and the best one within the length tie.

    Parameters
    ----------
    lines
        Of the longest path at each toll so far: its worth without toll, and its length in metres.
    toll
        The latest.
    max_length
        Metres.

    Returns
    -------
    float or None
        None where another toll would hardly lower the longest path's worth less toll, plus the toll of `max_length`.
    """
    worth, length = lines[-1]
    limit = max_length + slack(max_length)
    if length <= limit and toll == 0.0:
        return None
    over = [line for line in lines if line[1] > limit]
    within = [line for line in lines if line[1] <= limit]
    if not over:
        return 0.0 if len(lines) == 1 else None
    longest = max(over, key=lambda line: line[0] - toll * line[1])
    if not within:
        excess = longest[1] - max_length
        return 2 * toll if toll else 0.1 * max(abs(worth), 1e-300) / max(max_length, excess)
    shortest = max(within, key=lambda line: line[0] - toll * line[1])
    following = (longest[0] - shortest[0]) / (longest[1] - shortest[1])
    return following if following > 0 and abs(following - toll) > 1e-3 * toll else None


def slack(max_length: float) -> float:
    """By how much lengths are over a limit because of rounding alone, metres."""
    return _SAME_PLACE + _ROUNDING * max_length
