"""YAML values together with their place in the file, so that an error names the file, the line and the field."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from difflib import get_close_matches
from pathlib import Path
from typing import NoReturn, cast

import yaml

from topobelief.errors import FileError, InvalidInputError
from topobelief.io.files import StrPath, read_text


class Field:
    """A value of a YAML file; its methods read it as what is expected, or raise `FileError`.

    Attributes
    ----------
    name : str
        Where it stands, as in "sessions.S2.goals[1]".
    """

    def __init__(self, path: StrPath, name: str, node: yaml.Node) -> None:
        self.name = name
        self._path, self._node = path, node

    @property
    def line(self) -> int:
        """Where it begins, counted from 1."""
        return self._node.start_mark.line + 1

    def refuse(self, expected: str, got: str | None = None) -> NoReturn:
        """Raise the error that something else was expected here."""
        found = self._shown() if got is None else got
        place = f"{self.name}: " if self.name else ""
        raise FileError(self._path, f"{place}expected {expected}, got {found}", line=self.line)

    def entries(self, *, expected: str = "a mapping") -> dict[str, Field]:
        """The fields of a mapping by their keys, whatever these are; at least one."""
        if not isinstance(self._node, yaml.MappingNode) or not self._node.value:
            self.refuse(expected)
        found: dict[str, Field] = {}
        for key_node, value_node in cast("list[tuple[yaml.Node, yaml.Node]]", self._node.value):
            key = str(cast("object", key_node.value))
            child = Field(self._path, f"{self.name}.{key}" if self.name else key, value_node)
            if not isinstance(key_node, yaml.ScalarNode):
                child.refuse("a name as key", "a key that is a list or a mapping")
            if key in found:
                child.refuse("each key once", f"{key!r} twice")
            found[key] = child
        return found

    def mapping(self, *, required: Collection[str] = (), optional: Collection[str] = ()) -> dict[str, Field]:
        """The fields of a mapping with known keys."""
        known = [*required, *optional]
        found = self.entries(expected=f"a mapping with the keys {', '.join(known)}")
        for key, child in found.items():
            if key not in known:
                close = get_close_matches(key, known, n=1)
                hint = f"{close[0]!r}" if close else f"one of {', '.join(known)}"
                child.refuse(hint, f"the unknown key {key!r}")
        for key in required:
            if key not in found:
                self.refuse(f"the key {key!r}", "none")
        return found

    def items(self, *, expected: str = "a list") -> list[Field]:
        """The fields of a list; at least one."""
        if not isinstance(self._node, yaml.SequenceNode) or not self._node.value:
            self.refuse(expected)
        nodes = cast("list[yaml.Node]", self._node.value)
        return [Field(self._path, f"{self.name}[{index}]", node) for index, node in enumerate(nodes)]

    def is_list(self) -> bool:
        """Whether it is a list rather than one value."""
        return isinstance(self._node, yaml.SequenceNode)

    def is_mapping(self) -> bool:
        """Whether it is a mapping."""
        return isinstance(self._node, yaml.MappingNode)

    def text(self, *, expected: str = "a text") -> str:
        """A scalar as it is written."""
        if not isinstance(self._node, yaml.ScalarNode) or not self._node.value:
            self.refuse(expected)
        return str(cast("object", self._node.value))

    def choice(self, choices: Collection[str]) -> str:
        """One of some words."""
        listed = f"one of {', '.join(choices)}"
        value = self.text(expected=listed)
        if value not in choices:
            self.refuse(listed)
        return value

    def checked(self, check: Callable[[str], str]) -> str:
        """A text that a function takes and gives back, or refuses."""
        try:
            return check(self.text())
        except InvalidInputError as error:
            raise FileError(self._path, f"{self.name}: {error}", line=self.line) from None

    def flag(self) -> bool:
        """Yes or no."""
        value = self.text(expected="true or false").lower()
        if value not in ("true", "yes", "on", "false", "no", "off"):
            self.refuse("true or false")
        return value in ("true", "yes", "on")

    def number(self, *, above: float = -math.inf, at_least: float = -math.inf, at_most: float = math.inf) -> float:
        """A finite number in a range."""
        limits = [
            text
            for text, shown in (
                (f"above {above:g}", above > -math.inf),
                (f"of at least {at_least:g}", at_least > -math.inf),
                (f"of at most {at_most:.6g}", at_most < math.inf),
            )
            if shown
        ]
        expected = " ".join(["a number", " and ".join(limits)]).strip()
        try:
            value = float(self.text(expected=expected))
        except ValueError:
            self.refuse(expected)
        if not (math.isfinite(value) and value > above and at_least <= value <= at_most):
            self.refuse(expected)
        return value

    def whole(self, *, at_least: int) -> int:
        """A whole number."""
        expected = f"a whole number of at least {at_least}"
        try:
            value = int(self.text(expected=expected))
        except ValueError:
            self.refuse(expected)
        if value < at_least:
            self.refuse(expected)
        return value

    def numbers(self, *counts: int, expected: str) -> tuple[float, ...]:
        """Some finite numbers."""
        values = tuple(item.number() for item in self.items(expected=expected))
        if len(values) not in counts:
            self.refuse(expected)
        return values

    def _shown(self) -> str:
        match self._node:
            case yaml.ScalarNode():
                text = str(cast("object", self._node.value))
                return repr(text if len(text) <= 60 else text[:59] + "…") if text else "nothing"
            case yaml.SequenceNode():
                return f"a list of {len(cast('list[object]', self._node.value))}"
            case _:
                return "a mapping" if cast("list[object]", self._node.value) else "an empty mapping"


def read_fields(path: StrPath) -> Field:
    """The one document of a YAML file.

    Raises
    ------
    FileError
        If the file cannot be read or is not YAML.
    """
    first, *others = read_documents(path)
    if others:
        others[0].refuse("one document", "a second one")
    return first


def read_documents(path: StrPath) -> list[Field]:
    """The documents of a YAML file, which lines of --- separate, but for those with nothing in them; at least one.

    Raises
    ------
    FileError
        If the file cannot be read or is not YAML.
    """
    text = read_text(path)
    if Path(path).suffix.lower() == ".json":
        text = text.replace("\t", " ")  # by which JSON may be indented, and YAML not
    try:
        nodes = [node for node in yaml.compose_all(text, Loader=yaml.SafeLoader) if not _is_empty(node)]
    except yaml.YAMLError as error:
        if not isinstance(error, yaml.MarkedYAMLError):
            raise FileError(path, "expected YAML, got unreadable characters") from None
        line = error.problem_mark.line + 1 if error.problem_mark else None
        reason = " ".join(filter(None, (error.context, error.problem)))  # as in "while parsing a flow sequence expected ..."
        raise FileError(path, f"expected YAML, got other text ({reason})", line=line) from None
    except RecursionError:
        raise FileError(path, "expected YAML, got brackets nested too deeply") from None
    if not nodes:
        raise FileError(path, "expected YAML, got comments alone")
    return [Field(path, "", node) for node in nodes]


def _is_empty(node: yaml.Node) -> bool:
    return isinstance(node, yaml.ScalarNode) and node.value == "" and node.style is None
