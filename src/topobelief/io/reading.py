"""How a pose-graph file is read: what to leave out and what to assume, and the graph with a note of each.

A file that holds more than poses and edges between them is refused by default; `ReadingOptions` says what to do instead.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection
from dataclasses import dataclass, fields
from typing import Literal, NamedTuple, TypedDict, get_args

from topobelief.errors import InvalidInputError, ReadingWarning, require_choice, require_positive
from topobelief.graph.pose_graph import PoseGraph

Droppable = Literal["priors", "gps", "gravity", "planes", "landmarks", "robust", "equiv", "indefinite"]
Edge2Order = Literal["toro", "isam", "isam_root", "covariance"]

_DEVIATIONS = (1e-6, 1e6)  # beyond which a unit must be wrong


class ReadingKeywords(TypedDict, total=False):
    """The keywords of the readers: the fields of `ReadingOptions`."""

    drop: Droppable | Collection[Droppable]
    robust_as_plain: bool
    edge2_order: Edge2Order
    component: int | str
    planar: bool
    noise: tuple[float, float] | None
    spacing: float
    closure_radius: float | None
    topic: str | Collection[str]


@dataclass(frozen=True, slots=True)
class ReadingOptions:
    """What to leave out of a file and what to assume about it.

    Parameters
    ----------
    drop
        What to leave out, one word or several: "priors" (absolute priors on poses), "gps" (positions as from GPS), "gravity"
        (directions of gravity and orientations of an IMU), "planes" (and lines), "landmarks" (with their observations),
        "robust" (edges that may be outliers, with their switches), "equiv" (pairs of poses to merge), "indefinite" (edges whose
        information is not positive definite). Vertices go together with their edges and FIX lines.
    robust_as_plain
        Read switchable and max-mixture edges as plain ones: correct measurements with the information that they state.
    edge2_order
        What the information in EDGE2 lines is: I11 I12 I22 I33 I13 I23 ("toro"), I11 I12 I13 I22 I23 I33 ("isam"), or
        R11 R12 R13 R22 R23 R33 ("isam_root") of an upper triangular R, where the information is R^T R, or
        C11 C12 C13 C22 C23 C33 ("covariance") of the inverse of the information.
    component
        Of a disconnected graph: "all" parts, the "largest" one (of equal ones the one with the lowest id), or the one that
        holds the pose with this id or name.
    planar
        Project a graph in SE(3) onto the plane, as `topobelief.projected_to_plane` does.
    noise
        Standard deviations of every edge, metres and radians, for files that state none: trajectories and markers.
    spacing
        Of a trajectory, keep the first pose, each that lies at least so many metres from the last one kept, and the last pose.
    closure_radius
        Join each kept pose of a trajectory to the nearest earlier one within so many metres that the robot has left by
        three times that since. None: a trajectory is odometry alone.
    topic
        Of a bag, the name of the topic to read, or several of markers that draw one graph together, as Cartographer's two.
        None named: the only one that can be read.

    Raises
    ------
    InvalidInputError
        For a word that is none of these, where robust edges are to be both dropped and read, for noise and distances that are
        not above 0, and for closures between poses that stand closer than a tenth of their radius.
    """

    drop: Droppable | Collection[Droppable] = ()
    robust_as_plain: bool = False
    edge2_order: Edge2Order = "toro"
    component: int | str = "all"
    planar: bool = False
    noise: tuple[float, float] | None = None
    spacing: float = 0.0
    closure_radius: float | None = None
    topic: str | Collection[str] = ()

    def __repr__(self) -> str:
        """Only what differs from the defaults; words to drop in alphabetical order."""
        values = {field.name: (getattr(self, field.name), field.default) for field in fields(self)}
        values["drop"] = (sorted(self.drop), [])
        return f"ReadingOptions({', '.join(f'{name}={value!r}' for name, (value, usual) in values.items() if value != usual)})"

    def __post_init__(self) -> None:
        words = (self.drop,) if isinstance(self.drop, str) else tuple(self.drop)
        for word in words:
            require_choice("drop", word, get_args(Droppable))
        require_choice("edge2_order", self.edge2_order, get_args(Edge2Order))
        if self.robust_as_plain and "robust" in words:
            raise InvalidInputError("expected robust edges to be dropped or read as plain ones, got both; choose one")
        if self.noise is not None:
            if len(self.noise) != 2:
                raise InvalidInputError(f"expected two standard deviations, metres and radians, got {len(self.noise)}")
            for deviation, unit in zip(self.noise, ("m", "rad"), strict=True):
                if not _DEVIATIONS[0] <= deviation <= _DEVIATIONS[1]:
                    limits = " to ".join(f"{limit:g}" for limit in _DEVIATIONS)
                    raise InvalidInputError(f"expected a standard deviation from {limits} {unit}, got {deviation}")
        if not (math.isfinite(self.spacing) and self.spacing >= 0):
            raise InvalidInputError(f"expected a spacing of at least 0 m, got {self.spacing}")
        if self.closure_radius is not None:
            require_positive("a closure radius", self.closure_radius, unit="m")
            if self.spacing < self.closure_radius / 10:
                raise InvalidInputError(
                    f"expected a spacing of at least a tenth of the closure radius, {self.closure_radius / 10:g} m, "
                    f"got {self.spacing:g} m; every pose that is kept beside a former place makes a closure"
                )
        object.__setattr__(self, "drop", frozenset(words))
        object.__setattr__(self, "topic", (self.topic,) if isinstance(self.topic, str) else tuple(self.topic))


class ReadGraph(NamedTuple):
    """A graph and, for each option that changed it, a sentence that says what was dropped or assumed."""

    graph: PoseGraph
    notes: tuple[str, ...]

    def warned(self) -> PoseGraph:
        """The graph, each note issued as a `ReadingWarning` to the caller of the reader."""
        for note in self.notes:
            warnings.warn(note, ReadingWarning, stacklevel=3)
        return self.graph


def by_option(*drop: str) -> str:
    """How to drop these kinds: on the command line, and in Python."""
    words = list(dict.fromkeys(drop))
    return f"{' '.join(f'--drop {word}' for word in words)} (in Python drop={words})"
