"""Tasks one after the other in this process, which protects from no crash and no hang."""

from __future__ import annotations

from collections.abc import Generator, Sequence

from topobelief.runs.attempt import Finished, R, T, Work, attempt


class InProcess:
    """An executor without other processes."""

    def run(self, work: Work[T, R], tasks: Sequence[T]) -> Generator[Finished[T, R]]:
        """Work on all tasks in their order."""
        for task in tasks:
            yield Finished(task, attempt(work, task), attempts=1)
