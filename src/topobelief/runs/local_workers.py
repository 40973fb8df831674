"""Processes of this machine that work on tasks, each on one at a time; one that dies or hangs costs its attempt alone."""

from __future__ import annotations

import os
from collections.abc import Generator, Iterator, Sequence
from queue import SimpleQueue
from threading import Event, Lock, Thread
from typing import Generic

from topobelief.errors import InvalidInputError
from topobelief.runs.attempt import (
    MAX_ATTEMPTS,
    MAX_SECONDS,
    Finished,
    Outcome,
    R,
    T,
    Work,
    checked_seconds,
    with_second_chance,
)
from topobelief.runs.worker_process import WorkerDiedError, WorkerProcess, WorkerTooSlowError

_MAX_STARTS = 5  # in a row, after which workers count as unable to start


class LocalWorkers:
    """An executor of worker processes.

    Parameters
    ----------
    num_workers
        Default: the cores that this process may use.
    max_seconds
        After which a worker that has not finished its task is ended. None for no limit.
    one_thread
        Whether numerical libraries keep to one thread in each worker. Otherwise they do as in this process.

    Raises
    ------
    InvalidInputError
        For fewer workers than one, or a limit that is not above 0.
    """

    def __init__(
        self, num_workers: int | None = None, *, max_seconds: float | None = MAX_SECONDS, one_thread: bool = True
    ) -> None:
        if num_workers is not None and num_workers < 1:
            raise InvalidInputError(f"expected at least 1 worker, got {num_workers}")
        self.num_workers = available_cores() if num_workers is None else num_workers
        self._max_seconds, self._one_thread = checked_seconds(max_seconds), one_thread

    def run(self, work: Work[T, R], tasks: Sequence[T]) -> Generator[Finished[T, R]]:
        """Work on all tasks and give each once, as they finish; closing it early kills the workers.

        A task whose worker dies is begun up to 3 times, and up to 3 times more when nothing else is running. A task that takes
        too long is begun once more when nothing else is running.

        Raises
        ------
        WorkerDiedError
            Where workers cannot even start.
        """
        yield from with_second_chance(lambda some: self._finished(work, some), tasks)

    def _finished(self, work: Work[T, R], tasks: Sequence[T]) -> Generator[Finished[T, R]]:
        """Tasks as they finish, each begun a few times in a row where its worker dies."""
        shift = _Shift(work, tasks, self._max_seconds, one_thread=self._one_thread)
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


class _Shift(Generic[T, R]):
    """The tasks to work on, the threads that each lead one process at a time, and what came out."""

    def __init__(self, work: Work[T, R], tasks: Sequence[T], max_seconds: float | None, *, one_thread: bool) -> None:
        self._work, self._max_seconds, self._one_thread = work, max_seconds, one_thread
        self._todo: Iterator[T] = iter(tasks)
        self._lock, self._over = Lock(), Event()
        self._finished: SimpleQueue[Finished[T, R] | BaseException] = SimpleQueue()
        self._processes: set[WorkerProcess] = set()

    def next_finished(self) -> Finished[T, R]:
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
        """Lead one process after the other, a new one when one is lost, until no task is left."""
        process: WorkerProcess | None = None
        try:
            while (task := self._next_task()) is not None:
                loss, number = "", 0
                for number in range(1, MAX_ATTEMPTS + 1):
                    process = self._start() if process is None else process
                    try:
                        self._finished.put(Finished(task, process.ask(self._work, task, self._max_seconds), number))
                        break
                    except WorkerDiedError as error:
                        self._discard(process)
                        process, loss = None, f"{type(error).__name__}: {error}"
                        if isinstance(error, WorkerTooSlowError):  # which costs too much to be repeated at once
                            break
                if process is None:
                    self._finished.put(Finished(task, Outcome(None, loss, worker_lost=True), number))
        except BaseException as error:
            self._finished.put(error)
        finally:
            if process is not None:
                self._discard(process)

    def _next_task(self) -> T | None:
        with self._lock:
            return None if self._over.is_set() else next(self._todo, None)

    def _start(self) -> WorkerProcess:
        """A process that listens, which may take a few starts where something kills it at once."""
        death = ""
        for _ in range(_MAX_STARTS):
            with self._lock:  # so that nothing starts once the shift is over
                if self._over.is_set():
                    raise WorkerDiedError("expected a run in progress, got one that ended")
                process = WorkerProcess(one_thread=self._one_thread)
                self._processes.add(process)
            try:
                process.await_ready()
                return process
            except WorkerDiedError as error:
                self._discard(process)
                death = str(error)
        raise WorkerDiedError(f"expected worker processes that start, got: {death}")

    def _discard(self, process: WorkerProcess) -> None:
        with self._lock:
            self._processes.discard(process)
        process.close()
