"""Reading a command line: --start takes one number or two, and nothing is dropped."""

from __future__ import annotations

import pytest

from topobelief.cli.command import _pairs_joined


@pytest.mark.parametrize(
    ("given", "joined"),
    [
        (["graph.g2o", "--start", "3"], ["graph.g2o", "--start", "3"]),
        (["--start", "3", "graph.g2o"], ["--start", "3", "graph.g2o"]),
        (["--start", "3", "--goal", "1", "2"], ["--start", "3", "--goal", "1", "2"]),
        (["--start", "-3.5", "-4"], ["--start", "-3.5 -4"]),
        (["--start=3", "4e0", "5"], ["--start=3 4e0", "5"]),
        (["--goal", "1", "2", "--start"], ["--goal", "1", "2", "--start"]),
        (["--start", "x", "4"], ["--start", "x", "4"]),
        ([], []),
    ],
)
def test_two_numbers_after_the_option_are_one_value(given: list[str], joined: list[str]) -> None:
    assert _pairs_joined(given, "--start") == joined
