"""What a run leaves: plain values, complete at any moment, from which pictures, tables and a continuation are made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from topobelief.arrays import FloatArray
from topobelief.graph.pose_graph import PoseGraph
from topobelief.simulation.exploration import Exploration, TripOptions
from topobelief.simulation.noise import InjectedNoise
from topobelief.simulation.occupancy import OccupancyMap
from topobelief.simulation.scan import Scan
from topobelief.simulation.scenario import Scenario
from topobelief.strategies.choice import Choice
from topobelief.strategies.question import Question

ARRIVED, MISSED, CONTACT, INTERRUPTED = "arrived", "missed", "contact", "interrupted"
ARRIVAL_TOLERANCE = 0.3
"""Distance from its goal, metres, within which a robot that believes to have arrived truly has."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """What a run may vary in a scenario.

    Attributes
    ----------
    strategy, objective
        How paths are chosen (`topobelief.strategies.registry`), and what the planner minimises; by default the expected error
        of the map, by its signature.
    seed
        The same seed gives the same run on one machine.
    noise : InjectedNoise or None
        None: physical noise alone.
    unknown
        Start with an empty map instead of the floor plan.
    trips
        Which trips to drive after the goals to improve the map; None: none.
    """

    strategy: str = "resistance"
    objective: str = "error"
    seed: int = 0
    noise: InjectedNoise | None = None
    unknown: bool = False
    trips: TripOptions | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    """A way that was planned and driven: to a goal, or as far as it went.

    Attributes
    ----------
    goal
        Counts from 1; 0 for the approach, on which nothing is decided, and for trips.
    first_pose, last_pose
        Key poses at its begin and end.
    outcome
        "arrived", "interrupted", or why it ended, in words: "missed: ..." where the robot believed itself at the goal and was
        not, "contact: ..." where its chassis touched a wall, "stuck: ...", "blocked: ...", "unreachable: ...".
    num_candidates, chosen
        The latter counts from 0.
    planned, distance
        Length of the chosen path and of what was driven, metres.
    num_closures
        Loop closures that the front end accepted on the way.
    prior_value, predicted_value, achieved_value
        The objective, in its unit: before, as the chosen action predicts it, and of what came of it; nan where nothing was
        decided.
    candidates_seconds, decision_seconds
        Wall time of making the candidates and of choosing one.
    driven_seconds
        Simulated time.
    contacts
        Physics steps (of 5 ms) in which the chassis touched a wall.
    goal_distance, believed_goal_distance
        From the goal at the end of the leg, of the robot's true position and of where it believed itself to be, metres; nan
        where nothing was driven. Of a trip: from its end.
    trip
        Counts from 1; 0 for a leg to a goal and for the approach.
    """

    goal: int
    first_pose: int
    last_pose: int
    outcome: str
    num_candidates: int = 0
    chosen: int = 0
    planned: float = float("nan")
    distance: float = 0.0
    num_closures: int = 0
    prior_value: float = float("nan")
    predicted_value: float = float("nan")
    achieved_value: float = float("nan")
    candidates_seconds: float = 0.0
    decision_seconds: float = 0.0
    driven_seconds: float = 0.0
    contacts: int = 0
    goal_distance: float = float("nan")
    believed_goal_distance: float = float("nan")
    trip: int = 0

    @property
    def name(self) -> str:
        """What to call it."""
        return f"trip {self.trip}" if self.trip else f"goal {self.goal}" if self.goal else "approach"

    @property
    def is_decided(self) -> bool:
        """Whether its path was chosen, as that of every leg but the approach is."""
        return self.goal > 0 or self.trip > 0

    @property
    def arrived(self) -> bool:
        """Whether its goal was reached: by the robot's own estimate, and in truth within `ARRIVAL_TOLERANCE`."""
        return self.outcome == ARRIVED

    @property
    def believed_arrived(self) -> bool:
        """Whether its goal was reached by the robot's own estimate, which is all that the robot knows."""
        return self.arrived or self.outcome.startswith(MISSED)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Deliberation:
    """A decision and all that it was made from.

    Attributes
    ----------
    leg
        Index of the leg that it led to.
    question : Question
        The belief that was decided on, K candidates, and the objective.
    paths
        Of the candidates.
    values : shape (K,)
        Their exact objective, in its unit, whether or not the strategy looked at it.
    choice
    """

    leg: int
    question: Question
    paths: Sequence[FloatArray]
    values: FloatArray
    choice: Choice


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class KeyPoses:
    """What the robot sensed at each key pose, and, for scoring alone, where it truly was.

    Attributes
    ----------
    times : shape (n,)
        Seconds.
    truth, wheel_odometry : shape (n, 3)
        In the world; the latter from the known start on.
    motions : shape (n, 3)
        Since the key pose before, as the front end had tracked it when the key pose was made.
    scans
        n of them.
    """

    times: FloatArray
    truth: FloatArray
    wheel_odometry: FloatArray
    motions: FloatArray
    scans: tuple[Scan, ...]

    def __len__(self) -> int:
        return len(self.times)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class History:
    """What a run can be continued from.

    Attributes
    ----------
    key_poses
    legs
    track : shape (t, 7)
        Time, true pose and believed pose, several times a second.
    """

    key_poses: KeyPoses
    legs: tuple[Leg, ...]
    track: FloatArray


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Record:
    """A run as far as it went.

    Attributes
    ----------
    scenario, options
    history
        Legs in order, those of earlier runs that were resumed included, and what was sensed on them.
    estimate : shape (n, 3)
        What the robot drove by.
    graph, registered : PoseGraph
        What it decided on, at its own estimate, and the same without injected noise.
    occupancy
        The map at the end.
    deliberations
        Of this run.
    outcome
        "arrived" where all goals that it set out for were reached, else what the last leg to the last of the others says.
    exploration
        How trips to improve the map ended; None where there were none, or not yet.
    """

    scenario: Scenario
    options: RunOptions
    history: History
    estimate: FloatArray
    graph: PoseGraph
    registered: PoseGraph
    occupancy: OccupancyMap
    deliberations: tuple[Deliberation, ...]
    outcome: str
    exploration: Exploration | None = None

    @property
    def truth(self) -> FloatArray:
        """True key poses, shape (n, 3). For scoring alone."""
        return self.history.key_poses.truth

    @property
    def legs(self) -> tuple[Leg, ...]:
        """In order."""
        return self.history.legs

    @property
    def num_goals_reached(self) -> int:
        """How many goals were reached in truth."""
        return sum(leg.arrived for leg in self.legs if leg.goal > 0)
