"""Where a simulated robot drives: a world, a start, goals in order, and how candidate paths to them are found.

`office` is the second planning environment of Kitanov and Indelman (arXiv 1903.00927) with its sessions S1 and S2, `lab` the
larger test world of its authors, and `corridors` a place where the ways to the goal differ in what they do to the map: an
unknown corridor, the known way back, and a meander between the two.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.resources import as_file, files

from topobelief.candidates.propose import CandidateRule
from topobelief.errors import InvalidInputError, require_choice
from topobelief.io.floor_plan import read_walls
from topobelief.simulation.lidar import LidarSettings
from topobelief.simulation.robot_settings import RobotSettings
from topobelief.world import World

Place = tuple[float, float]
SAFE_MARGIN = 0.1
"""What paths should keep between the chassis and walls, metres: a robot leaves its path in bends and errs in its position."""


@dataclass(frozen=True, slots=True)
class Goal:
    """A place to drive to, metres, and how many candidate paths to it are compared."""

    place: Place
    num_paths: int = 20

    def __post_init__(self) -> None:
        if self.num_paths < 1:
            raise InvalidInputError(f"expected at least 1 candidate path, got {self.num_paths}")


@dataclass(frozen=True, eq=False, slots=True)
class Scenario:
    """A world, and what the robot is to do in it.

    Attributes
    ----------
    name
    world
        Its walls, and the floor plan that the robot knows unless the run starts with an empty map.
    start : (x, y, theta)
        Metres and radians; known to the robot, as a pose graph needs one known pose.
    goals
        In order; each ends a session.
    approach
        Places driven to in a straight line before the first goal, without a choice.
    rule
        Its `max_detour`, `num_vertices`, `robot_radius`, `closures` and `line_of_sight` count. The radius is how far paths keep
        from walls, at least that of the chassis, and better `SAFE_MARGIN` more. Closures that are None are those of the robot's
        own front end, with a probability that is learned from its graph. The goal says how many paths; the run and SLAM give
        the rest.
    robot, lidar
    objective, strategy
        What the robot minimises, and how it chooses, unless a run says otherwise. Without a strategy it ranks by the signature
        that goes with the objective.
    """

    name: str
    world: World
    start: tuple[float, float, float]
    goals: tuple[Goal, ...]
    approach: tuple[Place, ...] = ()
    rule: CandidateRule = field(default_factory=CandidateRule)
    robot: RobotSettings = field(default_factory=RobotSettings)
    lidar: LidarSettings = field(default_factory=LidarSettings)
    objective: str = "error"
    strategy: str | None = None

    def __post_init__(self) -> None:
        if not self.goals:
            raise InvalidInputError(f"expected a scenario with at least one goal, got none in {self.name!r}")
        places = [("start", self.start[:2]), *((f"goal {number}", goal.place) for number, goal in enumerate(self.goals, 1))]
        for (what, (x, y)), clearance in zip(places, self.world.clearance([place for _, place in places]), strict=True):
            if clearance <= self.robot.radius:
                raise InvalidInputError(
                    f"expected room for a robot of radius {self.robot.radius:g} m at the {what} ({x:g}, {y:g}), got "
                    f"a clearance of {max(0.0, float(clearance)):.2f} m; choose a place in the open"
                )
        if self.rule.robot_radius < self.robot.radius:
            raise InvalidInputError(
                f"expected paths planned for at least the chassis of {self.robot.radius:g} m in radius, got a robot_radius of "
                f"{self.rule.robot_radius:g} m; raise it, or make the chassis smaller"
            )

    @property
    def caution(self) -> str | None:
        """What to know before driving: that paths lead close by walls. None where they do not."""
        margin = self.rule.robot_radius - self.robot.radius
        if margin >= SAFE_MARGIN - 1e-9:
            return None
        return (
            f"robot_radius {self.rule.robot_radius:g} m leaves {margin:.2f} m beside the chassis of {self.robot.radius:g} m, "
            f"less than the {SAFE_MARGIN:g} m that a robot needs in bends; paths keep more where its position error asks for it"
        )


def named_scenario(name: str) -> Scenario:
    """One of `SCENARIO_NAMES`.

    Raises
    ------
    InvalidInputError
        Names the choices.
    """
    require_choice("scenario", name, SCENARIO_NAMES)
    return _SCENARIOS[name]()


def _office() -> Scenario:
    return Scenario(
        name="office",
        world=_floor_plan("office"),
        start=(20.0, 0.0, 0.0),
        goals=(Goal((26.0, 8.0), num_paths=9), Goal((25.0, -2.95), num_paths=20)),
    )


def _lab() -> Scenario:
    places = (
        (4.32, -7.00),
        (7.88, -1.56),
        (8.15, 5.38),
        (4.03, -2.60),
        (0.38, 5.91),
        (-4.17, 1.20),
        (-6.41, 12.23),
        (-13.05, 6.21),
        (-13.60, 16.60),
        (-20.44, 5.76),
        (-24.27, -0.12),
        (-12.17, -0.58),
        (-24.21, -6.61),
        (-12.30, -0.64),
        (-4.42, 1.09),
        (-7.84, -6.46),
    )
    return Scenario("lab", _floor_plan("lab"), (-0.15, -6.86, 0.0), tuple(Goal(place) for place in places))


def _corridors() -> Scenario:
    return Scenario(
        name="corridors",
        world=_floor_plan("corridors"),
        start=(0.0, 0.0, 0.0),
        goals=(Goal((4.0, 6.0), num_paths=3),),  # the shortest path of each of three homotopy classes
        approach=((40.0, 0.0), (40.0, 12.0)),
        rule=CandidateRule(max_detour=2.5),
    )


def _floor_plan(name: str) -> World:
    with as_file(files("topobelief.simulation") / "floor_plans" / f"{name}.csv") as path:
        return read_walls(path)


_SCENARIOS: dict[str, Callable[[], Scenario]] = {"office": _office, "lab": _lab, "corridors": _corridors}
SCENARIO_NAMES = tuple(_SCENARIOS)
"""Scenarios that come with the package."""
