"""Errors on a command line name options, not arguments of Python functions."""

import pytest

from topobelief.cli.options_as_typed import as_typed, name_options
from topobelief.errors import FileError, InvalidInputError, PlanningError

OPTIONS = {"max_length": "--max-length", "deadline": "--seconds", "bounds": "--bounds", "closures": "--closures"}
OPTIONS |= {"allow_dense_spectrum": "--allow-dense-spectrum", "enough": "--enough"}


@pytest.mark.parametrize(
    ("message", "typed"),
    [
        (
            "expected max_length of at least 3.2 m, got 1 m; raise it",
            "expected --max-length of at least 3.2 m, got 1 m; raise it",
        ),
        ("expected enough of at least 0, got -1", "expected --enough of at least 0, got -1"),
        ('use bounds="fischer", or give closures', "use --bounds fischer, or give closures"),
        ("or pass allow_dense_spectrum=True", "or pass --allow-dense-spectrum"),
        ("closures with certainty (ClosureModel.paper())", "closures with certainty (--closures paper)"),
        ("expected a deadline, got my_max_length and --max-length", "expected a deadline, got my_max_length and --max-length"),
        ("the bounds that are known hold, which is enough", "the bounds that are known hold, which is enough"),
    ],
)
def test_arguments_become_options_and_words_stay(message, typed):
    assert as_typed(message, OPTIONS) == typed


def test_fields_of_a_file_keep_their_names():
    class Parameter:
        name, opts = "max_length", ["--max-length"]

    error = FileError("scenario.yaml", "expected max_length above 0, got -1", line=3)
    name_options(error, [Parameter])
    assert str(error) == "scenario.yaml:3: expected max_length above 0, got -1"
    error = InvalidInputError("expected max_length above 0, got -1")
    name_options(error, [Parameter])
    assert str(error) == "expected --max-length above 0, got -1"
    assert not isinstance(error, PlanningError)


def test_plan_names_what_was_typed(topobelief, office):
    short = topobelief(office.plan("--max-length", 1))
    assert short.code == 2
    assert "expected --max-length of at least" in short.err
    paper = topobelief(office.plan("--candidates", 3, "--bounds", "paper", "--objective", "joint"))
    assert paper.code == 2
    assert "use --bounds fischer, or predict closures with certainty (--closures paper)" in paper.err
    assert "_" not in short.err + paper.err.replace("path_", "")
