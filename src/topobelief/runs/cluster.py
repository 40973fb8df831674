"""A dask.distributed cluster that works on tasks: its scheduler hands them out, and workers may come, go and die."""

from __future__ import annotations

import logging
import os
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from threading import Timer
from typing import Any
from uuid import uuid4

from topobelief.errors import InvalidInputError, TopobeliefError
from topobelief.optional import load
from topobelief.runs.attempt import MAX_SECONDS, Finished, Outcome, R, T, Work, attempt, checked_seconds, with_second_chance

_PATIENCE = 15  # seconds to wait for the scheduler, and for its first worker
_DEATH = (
    "WorkerDiedError: several workers of the cluster died over it or took too long, the last ones when nothing else was running"
)
_MAX_WITH_SCHEDULER = 500  # tasks, each with its world; more than most clusters work on at a time


class ClusterLostError(TopobeliefError):
    """The scheduler went away, and with it the tasks that it had."""


class Cluster:
    """An executor of the workers of a scheduler.

    Parameters
    ----------
    address
        Such as "tcp://10.0.0.1:8786".
    max_seconds
        After which a worker that has not finished its task ends itself, to be replaced by its nanny. None for no limit.

    Raises
    ------
    InvalidInputError
        If distributed is not installed, or for a limit that is not above 0.
    """

    def __init__(self, address: str, *, max_seconds: float | None = MAX_SECONDS) -> None:
        self.address = address
        self._max_seconds = checked_seconds(max_seconds)
        self._distributed = load("distributed", "cluster")

    def run(self, work: Work[T, R], tasks: Sequence[T]) -> Generator[Finished[T, R]]:
        """Work on all tasks and give each once, as they finish; closing it early withdraws the rest.

        The scheduler gives a task whose worker died to another one, a few times; should it then give up, the task has a
        second chance when nothing else is running.

        Raises
        ------
        InvalidInputError
            Where there is no scheduler at the address, no worker, or one without this version of topobelief.
        ClusterLostError
            Where the scheduler goes away.
        """
        if not tasks:
            return
        with self._client() as client:
            yield from with_second_chance(lambda some: self._finished(client, work, some), tasks)

    @contextmanager
    def _client(self) -> Generator[Any]:
        """A connection to a scheduler whose workers are fit for the work."""
        with _quiet_logs():
            try:
                client = self._distributed.Client(self.address, timeout=_PATIENCE, set_as_default=False)
            except (OSError, ValueError):  # of which the timeout is one
                raise InvalidInputError(
                    f"expected a dask scheduler at {self.address}, got no answer; start one with `dask scheduler`"
                ) from None
            try:
                _check_workers(client, self.address)
                yield client
            finally:
                client.close(timeout=_PATIENCE)

    def _finished(self, client: Any, work: Work[T, R], tasks: Sequence[T]) -> Generator[Finished[T, R]]:
        """Tasks as they finish; the scheduler itself begins one again whose worker died, a few times."""
        run, todo = uuid4().hex[:8], iter(tasks)  # another run with the same tasks shares no result
        pending: dict[str, tuple[T, Any]] = {}
        completed = self._distributed.as_completed(loop=client.loop)

        def hand_out() -> None:
            while len(pending) < _MAX_WITH_SCHEDULER:
                task = next(todo, None)
                if task is None:
                    return
                key = f"topobelief-{run}-{task.id}"
                future = client.submit(_attempt_in_time, work, task, self._max_seconds, key=key, pure=False)
                pending[future.key] = task, future
                completed.add(future)

        try:
            hand_out()
            for future in completed:
                task, _ = pending.pop(future.key)
                yield Finished(task, self._outcome(future), attempts=1)
                hand_out()
        finally:
            if pending and client.status == "running":
                client.cancel([future for _, future in pending.values()])

    def _outcome(self, future: Any) -> Outcome[Any]:
        """What came out of a task; what it raised itself is in there already."""
        try:
            return future.result()
        except self._distributed.scheduler.KilledWorker:
            return Outcome(None, _DEATH, worker_lost=True)
        except (self._distributed.CancelledError, OSError):  # OSError: the connection broke
            raise ClusterLostError(
                f"expected the dask scheduler at {self.address} to stay, got disconnected; run the same command to continue"
            ) from None
        except Exception as error:  # such as a task that a worker cannot unpack
            return Outcome(None, f"{type(error).__name__}: {' '.join(str(error).split())}")


def _attempt_in_time(work: Work[T, R], task: T, max_seconds: float | None) -> Outcome[R]:
    """On a worker: an attempt that ends the worker's process where it takes too long, since nothing else stops a thread."""
    if max_seconds is None:
        return attempt(work, task)
    timer = Timer(max_seconds, os._exit, [1])
    timer.daemon = True
    timer.start()
    try:
        return attempt(work, task)
    finally:
        timer.cancel()


@contextmanager
def _quiet_logs() -> Generator[None]:
    """What the client would log, it raises too."""
    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client", "tornado.application")]
    levels = [logger.level for logger in loggers]
    try:
        for logger in loggers:
            logger.setLevel(logging.CRITICAL)
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def _check_workers(client: Any, address: str) -> None:
    """Refuse a cluster without workers, or with some that would fail every task."""
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError:
        raise InvalidInputError(
            f"expected a worker at the scheduler {address}, got none in {_PATIENCE} s; start some with `dask worker {address}`"
        ) from None
    expected = _own_version()
    for worker, found in client.run(version, "topobelief", on_error="return").items():
        if found != expected:
            raise InvalidInputError(
                f"expected topobelief {expected} on all workers, got {_shown(found)} on {worker}; install it there"
            )


def _own_version() -> str:
    return version("topobelief")


def _shown(found: object) -> str:
    return found if isinstance(found, str) else "none"
