"""Scenarios by name, or from a YAML file with a map of one's own.

    map: building.yaml            # a ROS map, or walls in a .csv; relative to this file
    unknown: occupied             # what unknown cells of a ROS map are taken for
    start: [20, 0, 0]             # x, y, heading: metres and radians
    goals: [[26, 8], [25, -2.95]]
    candidates: [9, 20]           # paths to compare, one number or one a goal
    max_detour: 1.3               # none for no limit
    objective: error              # what the robot minimises
    strategy: resistance          # how it chooses; default: the signature that goes with the objective
    closures: learned             # or paper
    as_paper: false               # true: joint, spanning_trees and paper, unless the three above say otherwise
    robot_radius: 0.35            # metres that paths keep from walls; default: the chassis and 0.1 m
    lidar: {max_range: 10, range_noise: 0.01}
    robot: {radius: 0.25, wheel_slip: 0.02}

Only map, start and goals must be given.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, TypeVar, cast, get_args

from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.propose import CandidateRule
from topobelief.errors import InvalidInputError
from topobelief.io.floor_plan import read_world
from topobelief.io.ros_map import Unknown
from topobelief.io.yaml_fields import Field, read_fields
from topobelief.planning.registry import OBJECTIVES
from topobelief.simulation.lidar import LidarSettings
from topobelief.simulation.robot_settings import RobotSettings
from topobelief.simulation.scenario import SAFE_MARGIN, SCENARIO_NAMES, Goal, Scenario, named_scenario
from topobelief.strategies.registry import checked_strategy

_Settings = TypeVar("_Settings", RobotSettings, LidarSettings)
Closures = Literal["learned", "paper"]
"""Loop closures predicted as the robot's own front end makes them, with a probability learned from its graph; or as the paper
predicts them, all poses within 2 m and 1 rad, through walls, with certainty."""


_DECISION_KEYS = ("objective", "strategy", "closures", "as_paper")


def scenario_of(name: str) -> Scenario:
    """A scenario by its name, or the one that a YAML file describes.

    Raises
    ------
    InvalidInputError
        Where it is neither a known name nor a YAML file.
    FileError
        Names the file, the line and the field.
    """
    if Path(name).suffix.lower() in (".yaml", ".yml"):
        return read_scenario(Path(name))
    if name not in SCENARIO_NAMES:
        raise InvalidInputError(f"expected a scenario of {', '.join(SCENARIO_NAMES)}, or a .yaml file, got {name!r}")
    return named_scenario(name)


def with_detour(scenario: Scenario, max_detour: float | None) -> Scenario:
    """The scenario with another detour limit; 0 for none, None for its own.

    Raises
    ------
    InvalidInputError
        For a limit between 0 and 1.
    """
    if max_detour is None:
        return scenario
    if 0 < max_detour < 1:
        raise InvalidInputError(f"expected a detour limit of at least 1, or 0 for none, got {max_detour:g}")
    return dataclasses.replace(scenario, rule=dataclasses.replace(scenario.rule, max_detour=max_detour or None))


def with_closures(scenario: Scenario, closures: Closures | None) -> Scenario:
    """The scenario with other predicted closures; None for its own."""
    if closures is None:
        return scenario
    paper = closures == "paper"
    model = ClosureModel.paper() if paper else None
    return dataclasses.replace(scenario, rule=dataclasses.replace(scenario.rule, closures=model, line_of_sight=not paper))


def as_in_paper(scenario: Scenario) -> Scenario:
    """The scenario decided as in the paper: joint entropy, ranked by spanning trees, with its rule of closures."""
    return dataclasses.replace(with_closures(scenario, "paper"), objective="joint", strategy="spanning_trees")


def read_scenario(path: Path) -> Scenario:
    """The scenario of a YAML file, named as the file is.

    Raises
    ------
    FileError
        Names the file, the line and the field.
    """
    top = read_fields(path)
    keys = top.mapping(
        required=("map", "start", "goals"),
        optional=("unknown", "candidates", "max_detour", "robot_radius", *_DECISION_KEYS, "lidar", "robot"),
    )
    map_file = path.parent / keys["map"].text(expected="the path of a map (.yaml or .csv)")
    if not map_file.is_file():
        keys["map"].refuse("the path of a map (.yaml or .csv)", f"{str(map_file)!r}, which is no file")
    unknown = cast("Unknown", keys["unknown"].choice(get_args(Unknown))) if "unknown" in keys else "occupied"
    start = keys["start"].numbers(2, 3, expected="a start [x, y] or [x, y, theta]")
    goals = _goals(keys["goals"], keys.get("candidates"))
    robot = _settings(keys.get("robot"), RobotSettings())
    rule = _rule(keys, chassis=robot.radius)
    lidar = _settings(keys.get("lidar"), LidarSettings())
    try:
        scenario = Scenario(
            name=path.stem,
            world=read_world(map_file, unknown=unknown),
            start=(start[0], start[1], start[2] if len(start) == 3 else 0.0),
            goals=goals,
            rule=rule,
            robot=robot,
            lidar=lidar,
        )
    except InvalidInputError as error:
        top.refuse("a start and goals where the robot fits", str(error))
    return _decided(scenario, keys)


def _decided(scenario: Scenario, keys: Mapping[str, Field]) -> Scenario:
    """The scenario with the decisions that a file asks for."""
    if "as_paper" in keys and keys["as_paper"].flag():
        scenario = as_in_paper(scenario)
    if "closures" in keys:
        scenario = with_closures(scenario, cast("Closures", keys["closures"].choice(get_args(Closures))))
    if "objective" in keys:
        scenario = dataclasses.replace(scenario, objective=keys["objective"].choice(OBJECTIVES))
    if "strategy" in keys:
        scenario = dataclasses.replace(scenario, strategy=keys["strategy"].checked(checked_strategy))
    return scenario


def _goals(field: Field, candidates: Field | None) -> tuple[Goal, ...]:
    places = [item.numbers(2, expected="a goal [x, y]") for item in field.items(expected="a list of goals [x, y]")]
    counts = [20] * len(places)
    if candidates is not None and candidates.is_list():
        counts = [item.whole(at_least=1) for item in candidates.items()]
        if len(counts) != len(places):
            candidates.refuse(f"one number, or one for each of the {len(places)} goals")
    elif candidates is not None:
        counts = [candidates.whole(at_least=1)] * len(places)
    return tuple(Goal((x, y), count) for (x, y), count in zip(places, counts, strict=True))


def _rule(keys: Mapping[str, Field], *, chassis: float) -> CandidateRule:
    rule = CandidateRule(robot_radius=chassis + SAFE_MARGIN)
    if "max_detour" in keys:
        field = keys["max_detour"]
        unlimited = field.text(expected="a number of at least 1, or none for no limit").lower() == "none"
        rule = dataclasses.replace(rule, max_detour=None if unlimited else field.number(at_least=1))
    if "robot_radius" in keys:
        field = keys["robot_radius"]
        radius = field.number(above=0)
        if radius < chassis:
            field.refuse(
                f"at least the radius of the chassis, {chassis:g} m",
                f"{radius:g}; raise it, or make the chassis smaller by robot: {{radius: ...}}",
            )
        rule = dataclasses.replace(rule, robot_radius=radius)
    return rule


def _settings(field: Field | None, default: _Settings) -> _Settings:
    """Settings with some numbers replaced."""
    if field is None:
        return default
    numbers = [one.name for one in dataclasses.fields(default) if isinstance(getattr(default, one.name), int | float)]
    values = {
        name: child.whole(at_least=0) if isinstance(getattr(default, name), int) else child.number()
        for name, child in field.mapping(optional=numbers).items()
    }
    try:
        return dataclasses.replace(default, **values)
    except InvalidInputError as error:
        field.refuse("settings in their ranges", str(error))
