"""A worker process as the run sees it: it is started, asked, and ended when it takes too long."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from threading import Event, Timer
from typing import IO, Any, cast

from topobelief.errors import TopobeliefError
from topobelief.runs.attempt import Outcome, R, T, Work
from topobelief.runs.worker import READY

_SECONDS_TO_START = 300.0  # a slow disk, with all that a task imports
_SECONDS_TO_DIE = 10
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


class WorkerDiedError(TopobeliefError):
    """A worker process ended in the middle of a task, or before its first."""


class WorkerTooSlowError(WorkerDiedError):
    """A worker process took longer for a task than it may, and was ended."""


class WorkerProcess:
    """A process that runs `worker`.

    Parameters
    ----------
    one_thread
        Whether numerical libraries in it keep to one thread.
    """

    def __init__(self, *, one_thread: bool) -> None:
        self._complaints: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  (lives as long as the process; `close` closes it)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "topobelief.runs.worker"],  # -P: nothing of the current folder
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._complaints,
            env=os.environ | _ONE_THREAD if one_thread else None,
            start_new_session=True,  # so that Ctrl-C reaches the run alone, which ends its workers
        )
        self._questions = cast("IO[bytes]", self._process.stdin)
        self._answers = cast("IO[bytes]", self._process.stdout)

    def await_ready(self) -> None:
        """Wait until it has loaded what it needs.

        Raises
        ------
        WorkerDiedError
            Where it dies before that, or takes too long.
        """
        with self._limit(_SECONDS_TO_START, "to start"):
            if self._hear() != READY:
                raise WorkerDiedError(self._cause_of_death())

    def ask(self, work: Work[T, R], task: T, max_seconds: float | None) -> Outcome[R]:
        """Have a task worked on.

        Raises
        ------
        WorkerTooSlowError
            Where it takes longer than it may.
        WorkerDiedError
            Where the process dies over it.
        """
        with self._limit(max_seconds, "over one task"):
            try:
                pickle.dump((work, task), self._questions, protocol=pickle.HIGHEST_PROTOCOL)
                self._questions.flush()
            except OSError:
                raise WorkerDiedError(self._cause_of_death()) from None
            return self._hear()

    def _hear(self) -> Any:
        try:
            return pickle.load(self._answers)
        except (EOFError, OSError, pickle.UnpicklingError):  # the last of half an answer
            raise WorkerDiedError(self._cause_of_death()) from None

    @contextmanager
    def _limit(self, max_seconds: float | None, over: str) -> Generator[None]:
        """Kill the process where the block takes longer, and say so."""
        if max_seconds is None:
            yield
            return
        too_slow = Event()

        def end() -> None:
            too_slow.set()
            self.kill()

        timer = Timer(max_seconds, end)
        timer.daemon = True
        timer.start()
        try:
            yield
        except WorkerDiedError:
            if too_slow.is_set():
                raise WorkerTooSlowError(f"a worker took more than {max_seconds:g} s {over}") from None
            raise
        finally:
            timer.cancel()

    def _cause_of_death(self) -> str:
        """How it ended, with the line of its stderr that says most."""
        try:
            code = self._process.wait(_SECONDS_TO_DIE)
        except subprocess.TimeoutExpired:  # it closed its output, and lives
            self._process.kill()
            code = self._process.wait()
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        self._complaints.seek(0)
        said = self._complaints.read().decode(errors="replace").splitlines()
        lines = [line.strip() for line in said if line.strip()]
        words = [line for line in lines if line.startswith("Fatal Python error")] or lines[-1:]
        return ": ".join([f"a worker died ({how})", *words[:1]])

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()

    def close(self) -> None:
        """End it, and give back what it held."""
        self._process.kill()
        self._process.wait()
        for stream in (self._questions, self._answers, self._complaints):
            with suppress(OSError):  # what was not sent to a process that is gone
                stream.close()
