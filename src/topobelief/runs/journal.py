"""Finished tasks as lines of JSON in one file: the settings of the run, then a line for each task.

A line is appended whole and flushed to the disk before the next task counts as done. What a killed run left of a half-written
last line is cut off when the file is opened again, and its task is worked on again.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Generic, cast

from topobelief.errors import FileError
from topobelief.io.files import write_text
from topobelief.runs.attempt import Finished, R, T

SCHEMA = "topobelief.journal/1"


class Journal(Generic[T, R]):
    """The tasks of one run that are finished.

    Parameters
    ----------
    path
        Made where there is no such file; its folder exists.
    settings
        For JSON. They identify the run: a file with others is refused.
    encode
        Turns a result into what JSON can hold, in lists and dictionaries of text, numbers, flags and None.
    about
        For JSON. Noted when the file is made, and never compared.

    Attributes
    ----------
    about
        As noted when the file was made.

    Raises
    ------
    FileError
        Where the file is of a run with other settings, which it names, or it is no such file.
    """

    def __init__(
        self,
        path: Path,
        settings: Mapping[str, object],
        encode: Callable[[R], object],
        *,
        about: Mapping[str, object] | None = None,
    ) -> None:
        self._path, self._encode = path, encode
        self._entries: dict[str, dict[str, Any]] = {}
        header: dict[str, Any] = {"schema": SCHEMA, "settings": dict(settings), "about": dict(about or {})}
        if path.exists():
            known = self._read()
            self._require_same(json.loads(json.dumps(header["settings"])), known["settings"])  # lists for tuples
            self._header = known
        else:
            self._header = header
            write_text(path, json.dumps(header, allow_nan=False) + "\n")
        self.about: dict[str, Any] = self._header["about"]

    def __contains__(self, task: str, /) -> bool:
        return task in self._entries

    def failed(self, tasks: Iterable[str], /) -> int:
        """How many of the tasks have failed."""
        return sum(self.error(task) is not None for task in tasks)

    def error(self, task: str) -> str | None:
        """Why a task failed; None where it did not, or is not finished."""
        return self._entries.get(task, {}).get("error")

    def result(self, task: str) -> Any:
        """What `encode` made of the result of a finished task, as JSON gives it back; None where it failed."""
        return self._entries[task]["result"]

    @property
    def seconds(self) -> float:
        """Spent on the tasks that are finished, in all."""
        return sum(entry["seconds"] for entry in self._entries.values())

    def add(self, finished: Finished[T, R], /) -> None:
        """Append a line.

        Raises
        ------
        FileError
            If it cannot be written, or the task has a line.
        """
        task, outcome = finished.task.id, finished.outcome
        if task in self._entries:
            raise FileError(self._path, f"expected one line for each task, got a second one for {task}")
        entry: dict[str, Any] = {
            "task": task,
            "error": outcome.error,
            "attempts": finished.attempts,
            "seconds": round(outcome.seconds, 3),
            "result": None if outcome.result is None else self._encode(outcome.result),
        }
        try:
            with self._path.open("ab") as file:
                file.write(json.dumps(entry, allow_nan=False).encode() + b"\n")
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise FileError(self._path, f"expected a file to write to, got: {error.strerror}") from None
        self._entries[task] = entry

    def drop_failed(self) -> None:
        """Forget the tasks that failed, so that they are worked on again."""
        kept = {task: entry for task, entry in self._entries.items() if entry["error"] is None}
        if len(kept) < len(self._entries):
            lines = [json.dumps(line, allow_nan=False) for line in (self._header, *kept.values())]
            write_text(self._path, "\n".join(lines) + "\n")
            self._entries = kept

    def _read(self) -> dict[str, Any]:
        """Fill in the entries; the header."""
        header: dict[str, Any] = {}
        try:
            content = self._path.read_bytes()
            whole = content[: content.rfind(b"\n") + 1]
            if len(whole) < len(content):
                os.truncate(self._path, len(whole))
        except OSError as error:
            raise FileError(self._path, f"expected a file to read, got: {error.strerror}") from None
        for number, line in enumerate(whole.splitlines(), start=1):
            try:
                read = cast("dict[str, Any]", json.loads(line))
                if number == 1:
                    header = {name: read[name] for name in ("schema", "settings", "about")}
                    if header["schema"] != SCHEMA or not isinstance(header["settings"], dict):
                        raise ValueError
                else:
                    entry = {name: read[name] for name in ("task", "error", "attempts", "seconds", "result")}
                    self._entries[entry["task"]] = entry
            except (ValueError, KeyError, TypeError):
                what = "the settings of a run" if number == 1 else "a finished task"
                raise FileError(self._path, f"expected {what}, got something else; choose another --out", line=number) from None
        if not header:
            raise FileError(self._path, "expected the settings of a run, got none; choose another --out")
        return header

    def _require_same(self, settings: dict[str, Any], known: dict[str, Any]) -> None:
        for name in dict.fromkeys((*settings, *known)):
            if settings.get(name) != known.get(name):
                expected, got = _shown(settings.get(name)), _shown(known.get(name))
                raise FileError(
                    self._path,
                    f"expected a run with the same settings, {name} {expected}, got {name} {got}; choose another --out",
                )


def _shown(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:60]}…"
