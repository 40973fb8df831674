"""Reading a command line: --start takes one number, two or three, and nothing is dropped."""

from __future__ import annotations

import pytest

from topobelief.cli.command import _numbers_joined


@pytest.mark.parametrize(
    ("given", "joined"),
    [
        (["graph.g2o", "--start", "3"], ["graph.g2o", "--start", "3"]),
        (["--start", "3", "graph.g2o"], ["--start", "3", "graph.g2o"]),
        (["--start", "3", "--goal", "1", "2"], ["--start", "3", "--goal", "1", "2"]),
        (["--start", "-3.5", "-4"], ["--start", "-3.5 -4"]),
        (["--start=3", "4e0", "5", "6"], ["--start=3 4e0 5", "6"]),
        (["--goal", "1", "2", "--start"], ["--goal", "1", "2", "--start"]),
        (["--start", "x", "4"], ["--start", "x", "4"]),
        ([], []),
    ],
)
def test_numbers_after_the_option_are_one_value(given: list[str], joined: list[str]) -> None:
    assert _numbers_joined(given, "--start") == joined
