"""Progress takes one line, and leaves none behind."""

from __future__ import annotations

import io

import numpy as np

import topobelief as tb


def screen(written: str) -> str:
    """What a terminal shows of one line that was written over."""
    line: list[str] = []
    column = 0
    for character in written:
        if character == "\r":
            column = 0
        else:
            line[column : column + 1] = character
            column += 1
    return "".join(line).rstrip()


def test_a_stage_is_shown_and_cleared_when_it_is_over():
    stream = io.StringIO()
    update = tb.progress(stream)
    update("bounds", 3, 20)
    assert screen(stream.getvalue()) == "bounds 3/20"
    update("bounds", 20, 20)
    assert screen(stream.getvalue()) == ""


def test_updates_that_follow_at_once_are_left_out():
    stream = io.StringIO()
    update = tb.progress(stream)
    for done in range(1, 1000):
        update("signatures", done, 1000)
    assert stream.getvalue().count("\r") < 500
    update("signatures", 1000, 1000)
    assert screen(stream.getvalue()) == ""


def test_a_decision_takes_it():
    stream = io.StringIO()
    omega = np.diag([100.0, 100.0, 400.0])
    graph = tb.PoseGraph([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [(0, 1), (1, 2)], None, omega)
    actions = [tb.Action([[3, 0, 0]], [(2, 3)], omega), tb.Action([[1, 1, 0]], [(2, 3), (3, 0)], omega)]
    tb.Planner(graph).decide(actions, proof="optimal", on_progress=tb.progress(stream))
    assert stream.getvalue()
    assert screen(stream.getvalue()) == ""
