"""What a study varies: worlds, sessions, noises, strategies, objectives and seeds, read from a YAML file.

Every combination is a task. A session runs in all worlds unless it names its own; paths are relative to the YAML file.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, TypeVar, cast, get_args

import numpy as np

from topobelief.bounds.entropy_bounds import Determinant
from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.propose import CandidateRule
from topobelief.errors import FileError
from topobelief.estimation import optimize
from topobelief.graph.noise import Noise
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.files import StrPath
from topobelief.io.floor_plan import read_world
from topobelief.io.formats import read_pose_graph
from topobelief.io.ros_map import Unknown
from topobelief.io.yaml_fields import Field, read_fields
from topobelief.planning.registry import AUTO, BOUNDS, OBJECTIVES, has_bounds
from topobelief.strategies.registry import STRATEGIES
from topobelief.world import World

_Entry = TypeVar("_Entry")
_NO_LIMIT = ("none", "inf", ".inf")
_VARIED = ("num_paths", "seed", "information")  # by session, seed and noise
_NOT_STATED = ("closures", "observations", "attitude")  # by other keys, learned, and for planes alone
_CANDIDATE_KEYS = tuple(field.name for field in fields(CandidateRule) if field.name not in (*_VARIED, *_NOT_STATED))
_LEARNED, _BY_HAND = "learned", "by hand"
_CLOSURE_KEYS = ("closure_radius", "closure_angle", "min_index_gap")  # of a rule by hand


def _default_candidates() -> CandidateRule:
    """As in `topobelief plan`, but with closures by a rule and poses by distance, as in the paper."""
    return CandidateRule(turn=None, closures=ClosureModel.by_hand())


@dataclass(frozen=True, slots=True)
class Rule:
    """How candidates are found, their factors predicted and their entropies bounded.

    Attributes
    ----------
    candidates
        But for what the tasks vary: number of paths, seed and noise.
    bounds, determinant
        As the planner takes them.
    """

    candidates: CandidateRule = field(default_factory=_default_candidates)
    bounds: str = "fischer"
    determinant: Determinant = "cholesky"

    @property
    def content(self) -> dict[str, object]:
        """All of it by the keys of the YAML file; inf where detours have no limit."""
        rule = self.candidates
        detour = math.inf if rule.max_detour is None else rule.max_detour
        values: dict[str, object] = {key: getattr(rule, key) for key in _CANDIDATE_KEYS}
        if rule.turn is None:
            del values["turn"]
        values |= {"max_detour": detour, "bounds": self.bounds, "determinant": self.determinant}
        if rule.closures is None:
            return {**values, "closures": _LEARNED}
        by_hand = (rule.closures.radius, rule.closures.angle, rule.closures.min_index_gap)
        return {**values, **dict(zip(_CLOSURE_KEYS, by_hand, strict=True))}


@dataclass(frozen=True, eq=False, slots=True)
class Session:
    """A drive from goal to goal; the decision on the way to the last one is the one that is studied.

    Attributes
    ----------
    name
    graph : PoseGraph
        What the robot knows at the start: one pose, or a recorded graph at its maximum-likelihood estimate.
    goals : tuple of (x, y)
        Metres.
    num_paths : tuple of int
        Candidates, goal by goal.
    """

    name: str
    graph: PoseGraph
    goals: tuple[tuple[float, float], ...]
    num_paths: tuple[int, ...]


@dataclass(frozen=True, eq=False, slots=True)
class Specification:
    """A study.

    Attributes
    ----------
    worlds
        By name.
    sessions
        Each with the names of the worlds that it runs in.
    noises, strategies, objectives, seeds, rule
    """

    worlds: dict[str, World]
    sessions: tuple[tuple[Session, tuple[str, ...]], ...]
    noises: tuple[Noise, ...]
    strategies: tuple[str, ...]
    objectives: tuple[str, ...]
    seeds: tuple[int, ...]
    rule: Rule


def read_specification(path: StrPath) -> Specification:
    """The study that a YAML file describes, with its worlds and graphs read.

    Raises
    ------
    FileError
        Names the file, the line and the field; or the map or graph that is wrong.
    """
    folder = Path(path).parent
    fields = read_fields(path).mapping(
        required=("worlds", "sessions", "noises", "strategies", "seeds"), optional=("objectives", "rule")
    )
    worlds = {name: _world(field, folder) for name, field in fields["worlds"].entries().items()}
    sessions = tuple(_session(name, field, folder, worlds) for name, field in fields["sessions"].entries().items())
    objectives = ("joint",)
    if "objectives" in fields:
        objectives = _several(fields["objectives"], lambda item: item.choice(OBJECTIVES))
    rule = _rule(fields["rule"], objectives) if "rule" in fields else Rule()
    return Specification(
        worlds=worlds,
        sessions=sessions,
        noises=_several(fields["noises"], _noise),
        strategies=_several(fields["strategies"], lambda item: item.choice(STRATEGIES)),
        objectives=objectives,
        seeds=_seeds(fields["seeds"]),
        rule=rule,
    )


def _several(field: Field, read: Callable[[Field], _Entry]) -> tuple[_Entry, ...]:
    """The entries of a list, all different."""
    found: list[_Entry] = []
    for item in field.items():
        entry = read(item)
        if entry in found:
            item.refuse("entries that differ", "one that stood before")
        found.append(entry)
    return tuple(found)


def _world(field: Field, folder: Path) -> World:
    unknown: Unknown = "occupied"
    source = field
    if field.is_mapping():
        keys = field.mapping(required=("map",), optional=("unknown",))
        source = keys["map"]
        if "unknown" in keys:
            unknown = cast("Unknown", keys["unknown"].choice(get_args(Unknown)))
    return read_world(_existing(source, folder, "the path of a map (.yaml or .csv)"), unknown=unknown)


def _existing(field: Field, folder: Path, expected: str) -> Path:
    path = folder / field.text(expected=expected)
    if not path.is_file():
        field.refuse(expected, f"{str(path)!r}, which is no file")
    return path


def _session(name: str, field: Field, folder: Path, worlds: dict[str, World]) -> tuple[Session, tuple[str, ...]]:
    keys = field.mapping(required=("goals",), optional=("start", "graph", "candidates", "worlds"))
    if ("start" in keys) == ("graph" in keys):
        field.refuse("one of the keys 'start' and 'graph'", "both" if "start" in keys else "none")
    graph = _at(keys["start"]) if "start" in keys else _recorded(keys["graph"], folder)
    goals = tuple(_place(item) for item in keys["goals"].items(expected="a list of goals [x, y]"))
    names = tuple(worlds)
    if "worlds" in keys:
        names = _several(keys["worlds"], lambda item: item.choice(tuple(worlds)))
    return Session(name, graph, goals, _num_paths(keys.get("candidates"), len(goals))), names


def _at(field: Field) -> PoseGraph:
    """A robot that knows nothing but where it is."""
    pose = field.numbers(2, 3, expected="a start [x, y] or [x, y, theta]")
    no_edges = np.zeros((0, 2), dtype=np.int64)
    return PoseGraph([[*pose[:2], pose[2] if len(pose) == 3 else 0.0]], no_edges, None, np.eye(3))


def _recorded(field: Field, folder: Path) -> PoseGraph:
    path = _existing(field, folder, "the path of a pose graph (.g2o or .toro)")
    graph = read_pose_graph(path)
    if graph.group.position_dim != 2:
        raise FileError(path, f"expected a graph in SE(2) to plan in the plane, got one in {graph.group.name}")
    return optimize(graph)


def _place(field: Field) -> tuple[float, float]:
    x, y = field.numbers(2, expected="a goal [x, y]")
    return x, y


def _num_paths(field: Field | None, num_goals: int) -> tuple[int, ...]:
    if field is None:
        return (20,) * num_goals
    if not field.is_list():
        return (field.whole(at_least=1),) * num_goals
    counts = tuple(item.whole(at_least=1) for item in field.items())
    if len(counts) != num_goals:
        field.refuse(f"one number, or one for each of the {num_goals} goals")
    return counts


def _noise(field: Field) -> Noise:
    keys = field.mapping(required=("sigma_p", "sigma_theta"))
    return Noise(keys["sigma_p"].number(above=0), keys["sigma_theta"].number(above=0))


def _seeds(field: Field) -> tuple[int, ...]:
    """How many, from 0 on, or which."""
    if field.is_list():
        return _several(field, lambda item: item.whole(at_least=0))
    return tuple(range(field.whole(at_least=1)))


def _rule(field: Field, objectives: Collection[str]) -> Rule:
    """How candidates are found, with bounds that every objective has."""
    families = [name for name in (*BOUNDS, AUTO) if all(has_bounds(objective, name) for objective in objectives)]
    readers: dict[str, Callable[[Field], object]] = {
        "num_vertices": lambda item: item.whole(at_least=2),
        "robot_radius": lambda item: item.number(above=0),
        "max_detour": _detour,
        "spacing": lambda item: item.number(above=0),
        "turn": _turn,
        "closures": lambda item: item.choice((_LEARNED, _BY_HAND)),
        "closure_radius": lambda item: item.number(above=0),
        "closure_angle": lambda item: item.number(above=0, at_most=math.pi),
        "min_index_gap": lambda item: item.whole(at_least=2),
        "line_of_sight": Field.flag,
        "bounds": lambda item: item.choice(families),
        "determinant": lambda item: item.choice(get_args(Determinant)),
    }
    keys = field.mapping(optional=readers)
    values = {key: readers[key](child) for key, child in keys.items()}
    learned = values.pop("closures", _BY_HAND) == _LEARNED
    by_hand: dict[str, Any] = {key: values.pop(key) for key in _CLOSURE_KEYS if key in values}
    if learned and by_hand:
        keys["closures"].refuse(f"{_BY_HAND!r} where {' and '.join(by_hand)} is given", repr(_LEARNED))
    of_candidates: dict[str, Any] = {key: value for key, value in values.items() if key in _CANDIDATE_KEYS}
    others: dict[str, Any] = {key: value for key, value in values.items() if key not in _CANDIDATE_KEYS}
    closures = None if learned else ClosureModel.by_hand(**by_hand)
    return Rule(replace(_default_candidates(), closures=closures, **of_candidates), **others)


def _turn(field: Field) -> float | None:
    if field.text(expected="a number above 0, or none for poses by distance only").lower() in _NO_LIMIT:
        return None
    return field.number(above=0)


def _detour(field: Field) -> float | None:
    expected = "a number of at least 1, or none for no limit"
    if field.text(expected=expected).lower() in _NO_LIMIT:
        return None
    return field.number(at_least=1)
