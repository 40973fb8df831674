"""Processes of this machine that play tasks, each one at a time; one that dies takes nothing with it but its attempt."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Generator, Iterator, Sequence
from contextlib import suppress
from queue import SimpleQueue
from threading import Event, Lock, Thread
from typing import IO, Any, cast

from topobelief.errors import InvalidInputError, TopobeliefError
from topobelief.study.attempt import MAX_ATTEMPTS, Finished, Outcome, Play, with_second_chance
from topobelief.study.tasks import Task
from topobelief.study.worker import READY

_MAX_STARTS = 5  # in a row, after which workers count as unable to start
_SECONDS_TO_DIE = 10
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


class WorkerDiedError(TopobeliefError):
    """A worker process ended in the middle of a task, or before its first."""


class LocalWorkers:
    """Worker processes with one thread each.

    Parameters
    ----------
    num_workers
        Default: the cores that this process may use.

    Raises
    ------
    InvalidInputError
        For fewer than one.
    """

    def __init__(self, num_workers: int | None = None) -> None:
        if num_workers is not None and num_workers < 1:
            raise InvalidInputError(f"expected at least 1 worker, got {num_workers}")
        self.num_workers = available_cores() if num_workers is None else num_workers

    def run(self, play: Play, tasks: Sequence[Task]) -> Generator[Finished]:
        """Play all tasks and give each once, as they finish; closing it early kills the workers.

        A task whose worker dies is begun again, up to 3 times, and as often once more when nothing else is running.

        Raises
        ------
        WorkerDiedError
            Where workers cannot even start.
        """
        yield from with_second_chance(lambda some: self._played(play, some), tasks)

    def _played(self, play: Play, tasks: Sequence[Task]) -> Generator[Finished]:
        """Tasks as they finish, each begun a few times in a row where its worker dies."""
        shift = _Shift(play, tasks)
        threads = [Thread(target=shift.work, daemon=True) for _ in range(min(self.num_workers, len(tasks)))]
        for thread in threads:
            thread.start()
        try:
            for _ in tasks:
                yield shift.next_finished()
        finally:
            shift.end()
            for thread in threads:
                thread.join()


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class _Shift:
    """The tasks to play, the threads that each lead one process at a time, and what came out."""

    def __init__(self, play: Play, tasks: Sequence[Task]) -> None:
        self._play = play
        self._todo: Iterator[Task] = iter(tasks)
        self._lock, self._over = Lock(), Event()
        self._finished: SimpleQueue[Finished | BaseException] = SimpleQueue()
        self._processes: set[_WorkerProcess] = set()

    def next_finished(self) -> Finished:
        """Wait for the next; what broke a thread is raised here."""
        finished = self._finished.get()
        if isinstance(finished, BaseException):
            raise finished
        return finished

    def end(self) -> None:
        """Kill whatever still works."""
        with self._lock:
            self._over.set()
            for process in self._processes:
                process.kill()

    def work(self) -> None:
        """Play tasks with one process after the other, a new one when one dies, until no task is left."""
        process: _WorkerProcess | None = None
        try:
            while (task := self._next_task()) is not None:
                death = ""
                for number in range(1, MAX_ATTEMPTS + 1):
                    process = self._start() if process is None else process
                    try:
                        self._finished.put(Finished(task, process.ask(self._play, task), number))
                        break
                    except WorkerDiedError as error:
                        self._discard(process)
                        process, death = None, str(error)
                else:
                    failed = Outcome(None, f"WorkerDiedError: {death}", worker_died=True)
                    self._finished.put(Finished(task, failed, MAX_ATTEMPTS))
        except BaseException as error:
            self._finished.put(error)
        finally:
            if process is not None:
                self._discard(process)

    def _next_task(self) -> Task | None:
        with self._lock:
            return None if self._over.is_set() else next(self._todo, None)

    def _start(self) -> _WorkerProcess:
        """A process that listens, which may take a few starts where something kills it at once."""
        death = ""
        for _ in range(_MAX_STARTS):
            with self._lock:  # so that nothing starts once the shift is over
                if self._over.is_set():
                    raise WorkerDiedError("expected a study in progress, got one that ended")
                process = _WorkerProcess()
                self._processes.add(process)
            try:
                process.await_ready()
                return process
            except WorkerDiedError as error:
                self._discard(process)
                death = str(error)
        raise WorkerDiedError(f"expected worker processes that start, got: {death}")

    def _discard(self, process: _WorkerProcess) -> None:
        with self._lock:
            self._processes.discard(process)
        process.close()


class _WorkerProcess:
    """A process that runs `worker`."""

    def __init__(self) -> None:
        self._complaints: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115  (closed with the process)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "topobelief.study.worker"],  # -P: nothing of the current folder
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._complaints,
            env={**os.environ, **_ONE_THREAD},
            start_new_session=True,  # so that Ctrl-C reaches the study alone, which ends it in good order
        )
        self._questions = cast("IO[bytes]", self._process.stdin)
        self._answers = cast("IO[bytes]", self._process.stdout)

    def await_ready(self) -> None:
        """Wait until it has loaded what it needs.

        Raises
        ------
        WorkerDiedError
            Where it dies before that.
        """
        if self._hear() != READY:
            raise WorkerDiedError(self._cause_of_death())

    def ask(self, play: Play, task: Task) -> Outcome:
        """Have a task played.

        Raises
        ------
        WorkerDiedError
            Where the process dies over it.
        """
        try:
            pickle.dump((play, task), self._questions, protocol=pickle.HIGHEST_PROTOCOL)
            self._questions.flush()
        except OSError:
            raise WorkerDiedError(self._cause_of_death()) from None
        return self._hear()

    def _hear(self) -> Any:
        try:
            return pickle.load(self._answers)
        except (EOFError, OSError, pickle.UnpicklingError):  # the last of half an answer
            raise WorkerDiedError(self._cause_of_death()) from None

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
