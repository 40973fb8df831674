"""Errors of the library in the words of a command line: arguments by the options that stand for them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from topobelief.errors import FileError, TopobeliefError

_EXPRESSIONS = {"ClosureModel.paper()": "--closures paper", "`information`": "--sigma-p and --sigma-theta"}
"""What stands in advice of the library, and the options that do the same."""


def name_options(error: TopobeliefError, parameters: Sequence[Any]) -> None:
    """Change the message of an error: arguments of Python get the names of the command's options.

    A file's errors stay as they are, for the names in them are those of its fields.

    Parameters
    ----------
    error
    parameters
        Of the command, as typer has them.
    """
    if not isinstance(error, FileError):
        options = {each.name: each.opts[0] for each in parameters if each.opts[0].startswith("--")}
        error.args = (as_typed(str(error), options),)


def as_typed(message: str, options: dict[str, str]) -> str:
    """A message with arguments named as options.

    A name with an underscore is taken for an argument wherever it stands; a plain word only with a value, as in
    `bounds="fischer"`, or right after "expected" at the beginning.

    Parameters
    ----------
    message
    options
        By name of the argument.

    Examples
    --------
    >>> as_typed("expected max_length of at least 3.20 m, got 1 m; raise it", {"max_length": "--max-length"})
    'expected --max-length of at least 3.20 m, got 1 m; raise it'
    >>> as_typed('expected bounds that hold, got none; use bounds="fischer"', {"bounds": "--bounds"})
    'expected --bounds that hold, got none; use --bounds fischer'
    """
    for name, option in options.items():
        word = rf"(?<![\w-]){name}(?!\w)"
        message = re.sub(rf"{word}=True", option, message)
        message = re.sub(rf'{word}="?([\w.]+)"?', rf"{option} \1", message)
        message = re.sub(word if "_" in name else rf"(?<=^expected ){name}(?!\w)", option, message)
    for expression, typed in _EXPRESSIONS.items():
        if typed.split()[0] in options.values():
            message = message.replace(expression, typed)
    return message
