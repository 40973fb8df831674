"""A process that works on tasks: they come pickled on standard input, outcomes go back on standard output.

Run as `python -m topobelief.runs.worker`; it ends when its input does, so it does not outlive the run.
"""

from __future__ import annotations

import faulthandler
import os
import pickle
import sys
from typing import IO

from topobelief.runs.attempt import attempt

READY = "ready"
"""What a worker says first."""


def serve() -> None:
    """Answer until the input ends."""
    faulthandler.enable()  # a crash leaves its name on stderr
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    try:
        _send(answers, READY)
        while True:
            work, task = pickle.load(sys.stdin.buffer)
            _send(answers, attempt(work, task))
    except (EOFError, BrokenPipeError):  # the run is over, or gone
        pass


def _send(answers: IO[bytes], message: object) -> None:
    pickle.dump(message, answers, protocol=pickle.HIGHEST_PROTOCOL)
    answers.flush()


if __name__ == "__main__":
    serve()
