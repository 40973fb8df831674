"""Ask a strategy, and measure how long it takes to choose."""

from __future__ import annotations

import time

from topobelief.planning.registry import imported
from topobelief.strategies.choice import Choice, Strategy
from topobelief.strategies.question import Question
from topobelief.strategies.registry import place_of


def choose(name: str, question: Question) -> Choice:
    """The choice of a strategy (see `registry`); the same question gets the same choice.

    Raises
    ------
    InvalidInputError
        Where there is no strategy of that name.
    TopobeliefError
        Where the bounds do not cover the noise, or a value cannot be computed.
    """
    strategy: Strategy = imported(place_of(name))
    begin = time.perf_counter()
    index, reasons = strategy(name, question)
    seconds = time.perf_counter() - begin
    return Choice(index, seconds, reasons())
