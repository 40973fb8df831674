"""Questions that are being answered: each in a thread of its own, with answers that get better until it is done."""

from __future__ import annotations

import threading
import time
import uuid
from collections.abc import Callable, Mapping
from typing import Literal

from topobelief.errors import InvalidInputError, TopobeliefError
from topobelief.page.question import Question

State = Literal["working", "done", "failed"]
Publish = Callable[[Mapping[str, object]], None]
"""Takes an answer, or a better one."""

Answerer = Callable[[Question, Publish, Callable[[], bool]], None]
"""Answers a question: publishes answers until it is done, or until the last argument says that nobody waits any more."""

_MOST_AT_ONCE = 4
_MOST_KEPT = 32
_PATIENCE = 10.0  # seconds after which a question that nobody has asked about is given up


class Desk:
    """Takes questions, works on a few at once, and keeps the last answers.

    Parameters
    ----------
    answerer
        Called in a thread for each question.
    """

    def __init__(self, answerer: Answerer) -> None:
        self._answerer = answerer
        self._entries: dict[str, _Entry] = {}
        self._lock = threading.Lock()

    def ask(self, question: Question) -> str:
        """Begin to answer a question; returns its id.

        Raises
        ------
        BusyError
            Where as many as may be are being answered.
        """
        with self._lock:
            if sum(entry.state == "working" for entry in self._entries.values()) >= _MOST_AT_ONCE:
                raise BusyError(f"expected at most {_MOST_AT_ONCE} questions at once, got one more; wait until one is answered")
            done = [key for key, entry in self._entries.items() if entry.state != "working"]
            for key in done[: max(0, len(self._entries) + 1 - _MOST_KEPT)]:
                del self._entries[key]
            key = uuid.uuid4().hex
            entry = self._entries[key] = _Entry(question)
        threading.Thread(target=entry.work, args=(self._answerer,), daemon=True).start()
        return key

    def answer(self, key: str, *, after: int, wait: float) -> dict[str, object]:
        """The newest answer, as soon as it is a newer version than `after`, or after so many seconds.

        Raises
        ------
        InvalidInputError
            Where no question has this id.
        """
        return {"id": key, **self._entry(key).newest(after, wait)}

    def stop(self, key: str) -> None:
        """End a question with the answer that it has."""
        self._entry(key).stop()

    def close(self) -> None:
        """End all."""
        with self._lock:
            for entry in self._entries.values():
                entry.stop()

    def _entry(self, key: str) -> _Entry:
        with self._lock:
            if key not in self._entries:
                raise InvalidInputError("expected the id of a question that was asked, got another; ask again")
            return self._entries[key]


class BusyError(TopobeliefError):
    """Too many questions at once."""


class _Entry:
    """A question, its newest answer, and whoever waits for it."""

    def __init__(self, question: Question) -> None:
        self.state: State = "working"
        self._question = question
        self._answer: Mapping[str, object] = {"progress": "looking for ways …"}
        self._version = 0
        self._changed = threading.Condition()
        self._stopped = False
        self._asked = time.monotonic()

    def work(self, answerer: Answerer) -> None:
        try:
            answerer(self._question, self._publish, lambda: self._unwanted)
            self._end("done")
        except TopobeliefError as error:
            self._end("failed", str(error))
        except Exception as error:  # a bug costs its own question, is told on the page and shown to whoever runs the server
            self._end("failed", f"a bug of topobelief: {type(error).__name__}: {error}")
            raise

    def newest(self, after: int, wait: float) -> dict[str, object]:
        self._asked = time.monotonic()
        with self._changed:
            self._changed.wait_for(lambda: self._version > after or self.state != "working", wait)
            return {**self._answer, "question": self._question.document(), "state": self.state, "version": self._version}

    def stop(self) -> None:
        self._stopped = True

    @property
    def _unwanted(self) -> bool:
        return self._stopped or time.monotonic() - self._asked > _PATIENCE

    def _publish(self, answer: Mapping[str, object]) -> None:
        with self._changed:
            self._answer = {**self._answer, **answer}
            self._version += 1
            self._changed.notify_all()

    def _end(self, state: State, error: str | None = None) -> None:
        with self._changed:
            self.state = state
            self._answer = self._answer if error is None else {"progress": "", "error": error}
            self._version += 1
            self._changed.notify_all()
