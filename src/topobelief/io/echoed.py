"""Messages as `ros2 topic echo` or `rostopic echo` prints them: indented names and values, one to a line.

This is the part of YAML that those programs write, read line by line: some forty times faster than YAML as a whole, and no file
can make it nest deeply. Each value comes with its line and the names that lead to it; an item of a list has the name "-".
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from topobelief.errors import FileError
from topobelief.io.files import StrPath, read_text

_DEEPEST = 12  # levels of names; messages of visualization_msgs have 6


class EchoedValue(NamedTuple):
    """A value, empty at the head of a list or mapping; the names that lead to it; and its line.

    `item` counts the items of the outermost list that have begun, from 1.
    """

    names: tuple[str, ...]
    item: int
    value: str
    line: int


def echoed_values(path: StrPath) -> Iterator[EchoedValue]:
    """The values of all messages of a file, in its order; a line of --- stands between two messages.

    Raises
    ------
    FileError
        Names a line that is not what those programs write; of a message that was printed in short, how to print it whole.
    """
    stack: list[tuple[int, str]] = []
    item = 0
    for number, line in enumerate(read_text(path).split("\n"), start=1):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        if text == "---":
            stack.clear()
            continue
        if text in ("...", "- ...", "'...'", "- '...'") or text.startswith("WARNING: "):
            raise FileError(path, _cut_short(text), line=number)
        column = len(line) - len(line.lstrip())
        while text == "-" or text.startswith("- "):
            while stack and (stack[-1][0] > column or (stack[-1] == (column, "-"))):
                stack.pop()
            stack.append((column, "-"))
            _require_shallow(path, stack, number)
            item += sum(name == "-" for _, name in stack) == 1
            rest = text[1:].lstrip()
            column, text = column + len(text) - len(rest), rest
        if not text:
            continue
        name, colon, value = text.partition(":")
        if not colon or not name.replace("_", "").isalnum():
            raise FileError(
                path, f"expected a message as `ros2 topic echo` prints it, name: value, got {text[:40]!r}", line=number
            )
        while stack and stack[-1][0] >= column:
            stack.pop()
        stack.append((column, name))
        _require_shallow(path, stack, number)
        yield EchoedValue(tuple(name for _, name in stack), item, value.strip(), number)


def _require_shallow(path: StrPath, stack: list[tuple[int, str]], line: int) -> None:
    if len(stack) > _DEEPEST:
        raise FileError(path, f"expected at most {_DEEPEST} levels of names, got more", line=line)


def _cut_short(text: str) -> str:
    if text.startswith("WARNING"):
        return "expected messages alone, got a warning of the program that printed them; remove the line"
    return "expected all items of a list, got one that is cut short; print it with `ros2 topic echo --full-length`"
