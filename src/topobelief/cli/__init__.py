"""The command line: `topobelief plan` and `topobelief info`.

One thin file a command. What is heavy is imported where a command runs, so that help comes at once. Exit codes: 0 success; 2
bad input, with one line on stderr; 130 interrupted; a traceback means a bug.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from io import TextIOWrapper


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit.

    Parameters
    ----------
    arguments
        Without the program's name. Default: those of the process.
    """
    from topobelief.cli.app import run

    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without Greek letters gets question marks, not a traceback
    sys.exit(run(arguments))
