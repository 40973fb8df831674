"""Decisions to draw: made by hand, so that every number in a picture is known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from topobelief.planning.decision import Candidate, Decision

MakeDecision = Callable[..., Decision]


@pytest.fixture
def make_decision() -> MakeDecision:
    """K actions; the ranking runs from the last to the first, and the upper half of it survives."""

    def make(count: int, *, label: str = "path", cost: float = 0.0, **changes: Any) -> Decision:
        entropies = -100.0 - 10 * np.arange(count)
        fields: dict[str, Any] = {
            "best": count - 1,
            "ranking": np.arange(count)[::-1],
            "signatures": -entropies - 2,
            "lower": entropies - 3 + cost,
            "upper": entropies + 2 + cost,
            "entropies": np.full(count, np.nan),
            "survivors": np.arange(count)[::-1][: (count + 1) // 2],
            "error_bound": 7.5,
            "margin_met": None,
            "num_evaluations": 0,
            "proven_optimal": False,
            "candidates": tuple(Candidate(f"{label} {i}", 5 + i, 20 + i, 5.5 + i, cost) for i in range(count)),
            "objective": "joint",
            "signature": "spanning_trees",
            "bounds": "fischer",
            "determinant": "cholesky",
        }
        return Decision(**{**fields, **changes})

    return make
