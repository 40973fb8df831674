"""Lines of a pose-graph file that are neither poses nor plain edges between them, named for what they are.

The tags are those of g2o (types slam2d, slam3d and their add-ons), of its extensions in hdl_graph_slam, RTAB-Map and Vertigo
(switchable constraints, max-mixtures), and of TORO. What belongs together (a plane, the edges to it, its FIX) is reported and
dropped together.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from topobelief.errors import FileError
from topobelief.io.files import StrPath
from topobelief.io.reading import by_option
from topobelief.io.robust_edges import ROBUST_EDGE

_POSE_EDGE = r"EDGE_SE(2|3|3:QUAT)_"


@dataclass(frozen=True)
class _Kind:
    """Lines that mean one thing: the word that drops them, their name and their tags."""

    word: str
    name: str
    tags: re.Pattern[str]


_KINDS = tuple(  # the first that matches a tag names it
    _Kind(word, name, re.compile(tags))
    for word, name, tags in (
        (
            "robust",
            "robust edges, which may turn out to be outliers",
            rf"VERTEX_SWITCH|EDGE_SWITCH_PRIOR|{_POSE_EDGE}(SWITCHABLE|MAXMIX|MIXTURE|ROBUST)",
        ),
        (
            "gps",
            "absolute positions, as from GPS",
            r"EDGE_(PRIOR_SE[23]_XYZ?|SE[23]_XYZ?_?PRIOR|SE[23]_PRIOR_?XYZ?|(POINT)?XYZ?_PRIOR|.*(GPS|GNSS).*)",
        ),
        ("gravity", "directions of gravity or orientations of an IMU", r"EDGE_(.*GRAVITY.*|SE3_PRIOR_?(VEC|QUAT))"),
        ("priors", "absolute priors on poses", r"EDGE_(SE[23](:QUAT)?_PRIOR|PRIOR_SE[23](:QUAT)?)"),
        ("planes", "planes or lines", r"VERTEX_(PLANE|LINE|SEGMENT).*|EDGE_.*(PLANE|LINE|SEGMENT).*"),
        (
            "landmarks",
            "landmarks",
            r"VERTEX_(XY|XYZ|TRACKXYZ|POINT.*)|EDGE_SE2_(XY.*|LOTSOF.*|TWOPOINTS.*)|EDGE_SE3_(XYZ|TRACK.*|LOTSOF.*)"
            r"|EDGE_(SE[23]_)?POINT.*|EDGE_(BEARING|RANGE|PROJECT)_.*|LANDMARK|BR",
        ),
        ("equiv", "pairs of poses that are to be merged into one", r"EQUIV"),
    )
)


@dataclass
class _Found:
    """The lines of one kind: their tags with counts and first lines, and the vertices among them."""

    counts: dict[str, tuple[int, int]] = field(default_factory=dict[str, tuple[int, int]])
    fixed: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])

    def text(self) -> str:
        """What was found where."""
        parts = [
            f"{tag} on line {line}" if count == 1 else f"{count} {tag} from line {line} on"
            for tag, (count, line) in self.counts.items()
        ]
        parts += [f"FIX {vertex} on line {line}" for line, vertex in self.fixed]
        return ", ".join(parts)


class ForeignLines:
    """Foreign lines of one file, collected while it is read."""

    def __init__(self) -> None:
        self._found: dict[str, _Found] = {}
        self.vertices: dict[int, str] = {}  # id of a vertex that is no pose: its kind

    def take(self, tag: str, line: int, fields: Sequence[str]) -> bool:
        """Whether the line is foreign; if so it is remembered."""
        kind = next((kind for kind in _KINDS if kind.tags.fullmatch(tag)), None)
        if kind is None:
            return False
        found = self._found.setdefault(kind.word, _Found())
        count, first = found.counts.get(tag, (0, line))
        found.counts[tag] = count + 1, first
        if tag.startswith("VERTEX_") and fields and fields[0].isdecimal() and len(fields[0]) < 20:
            self.vertices[int(fields[0])] = kind.word
        return True

    def take_fixed(self, line: int, ids: Sequence[int]) -> list[int]:
        """The ids of a FIX line without those of foreign vertices, which are remembered."""
        for vertex in ids:
            if vertex in self.vertices:
                self._found[self.vertices[vertex]].fixed.append((line, vertex))
        return [vertex for vertex in ids if vertex not in self.vertices]

    def refuse(self, path: StrPath, allowed: Collection[str]) -> None:
        """Raise one error that names all lines of the kinds that are not to be dropped."""
        refused = {kind: self._found[kind.word] for kind in _KINDS if kind.word in self._found and kind.word not in allowed}
        if not refused:
            return
        listed = " and ".join(f"{kind.name} ({found.text()})" for kind, found in refused.items())
        words = [kind.word for kind in refused]
        advice = f"leave them out together with {by_option(*words)}"
        if any(ROBUST_EDGE.fullmatch(tag) for found in refused.values() for tag in found.counts):
            advice += ", or take robust edges for plain ones with --robust-as-plain (robust_as_plain=True)"
        first = min(line for found in refused.values() for _, line in found.counts.values())
        raise FileError(path, f"expected poses and plain edges between them, got {listed}; {advice}", line=first)

    def notes(self) -> list[str]:
        """A sentence for each kind that was dropped."""
        return [
            f"dropped {kind.name}: {self._found[kind.word].text()}; what they measure is not counted"
            for kind in _KINDS
            if kind.word in self._found
        ]
