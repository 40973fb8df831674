"""Active SLAM in closed loop: at each goal the planner gets the graph and the map, decides, and the robot drives.

After the goals it may drive trips that improve the map (`exploration`), each decided as a way to a goal is.

Everything on the way from the sensors to the wheels reads wheel odometry, scans and a bumper alone; the true pose goes into the
record and nowhere else. A leg ends when the robot believes itself at its goal, and counts as reached where it truly is there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.polyline import path_length
from topobelief.candidates.propose import CandidateRule
from topobelief.errors import PlanningError
from topobelief.geometry import SE2_GROUP
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.compile_kernels import load_kernels
from topobelief.search.anytime import SearchProgress
from topobelief.search.result import SearchResult
from topobelief.simulation.decisions import decision_rule, deliberated, deliberated_trip, value_after
from topobelief.simulation.exploration import DRIVING, Exploration, TripOptions, find_trip
from topobelief.simulation.path_following import PathFollower
from topobelief.simulation.record import (
    ARRIVAL_TOLERANCE,
    ARRIVED,
    CONTACT,
    INTERRUPTED,
    MISSED,
    Deliberation,
    History,
    KeyPoses,
    Leg,
    Record,
    RunOptions,
)
from topobelief.simulation.robot import Robot
from topobelief.simulation.scan import Scan
from topobelief.simulation.scenario import Goal, Scenario
from topobelief.simulation.slam import Slam
from topobelief.simulation.ways import place_with_room, stands_in_the_way
from topobelief.world import World

_BLOCKED = "blocked: by something unknown before, seen from"

Progress = Callable[[str, float, float], None]
"""Called with what is going on, metres driven on this leg and its planned length."""

_MAX_ATTEMPTS = 12  # legs to one goal, after which the robot gives up
_MAX_STUCK = 3  # of which it got stuck
_TRACK_PERIOD = 0.2  # s
_LOOK_PERIOD, _LOOK_AHEAD = 0.3, 1.2  # s and m, in which a robot without a floor plan looks for walls
_BRUSH = 0.03  # m beside its chassis that a wall may come near
_ROBOT, _NOISE, _CHOICE = range(3)  # streams of random numbers


class Episode:
    """One run of a scenario.

    Parameters
    ----------
    scenario, options
    history
        An earlier run to continue from its last key pose. What it sensed is played through SLAM again, which gives the same
        graph and map.
    displaced : (x, y, theta), optional
        Where the robot is put down relative to where it ended when a run continues, metres and radians; a little beside,
        where a wall is too near. SLAM is not given it.
    """

    def __init__(
        self,
        scenario: Scenario,
        options: RunOptions,
        *,
        history: History | None = None,
        displaced: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        load_kernels()
        self._scenario, self._options = scenario, options
        start = np.array(scenario.start)
        self._slam = Slam(start, bounds=scenario.world.bounds, noise=options.noise, rng=self._rng(_NOISE))
        self._legs: list[Leg] = []
        self._deliberations: list[Deliberation] = []
        self._times: list[float] = []
        self._truth: list[FloatArray] = []
        self._wheel: list[FloatArray] = []
        self._motions: list[FloatArray] = []
        self._track: list[FloatArray] = []
        self._wheel_at_start, self._time_at_start = start, 0.0
        self._exploration: Exploration | None = None
        if history is not None:
            self._replay(history)
            start = SE2_GROUP.compose(self._truth[-1], np.array(displaced))
            start[:2] = place_with_room(scenario.world, start[:2], scenario.robot.radius)
        self._robot = Robot(
            scenario.world,
            start,
            settings=scenario.robot,
            lidar=scenario.lidar,
            rng=self._rng(_ROBOT, len(self._legs)),
        )
        moved = np.zeros(3) if history is None else self._slam.put_down(self._robot.scan())
        self._wheel_at_start = SE2_GROUP.compose(self._wheel_at_start, moved)
        if history is None or moved.any():
            self._add_key_pose()

    def _rng(self, *stream: int) -> np.random.Generator:
        return np.random.default_rng([self._options.seed, *stream])

    def _replay(self, history: History) -> None:
        """What an earlier run sensed and concluded."""
        key_poses, legs = history.key_poses, history.legs
        settled = {leg.last_pose for leg in legs if leg.believed_arrived}
        for index in range(len(key_poses)):
            self._slam.add_key_pose(key_poses.wheel_odometry[index], key_poses.scans[index], motion=key_poses.motions[index])
            if index in settled:
                self._slam.settle()
        self._times = key_poses.times.tolist()
        self._truth, self._wheel = list(key_poses.truth), list(key_poses.wheel_odometry)
        self._motions = list(key_poses.motions)
        self._legs, self._track = list(legs), list(history.track)
        self._wheel_at_start, self._time_at_start = self._wheel[-1], self._times[-1]

    def run(
        self,
        *,
        should_stop: Callable[[], bool] = lambda: False,
        on_progress: Progress = lambda what, done, total: None,
        on_leg: Callable[[Record], None] = lambda record: None,
        last_goal: int | None = None,
    ) -> Record:
        """Drive to the goals that are left, and then the trips that the options ask for.

        Parameters
        ----------
        should_stop
            Asked every control period; the run then ends with a complete record.
        on_progress
        on_leg
            Called with the record after each leg.
        last_goal
            Stop after this goal, counted from 1, and drive no trips.
        """
        goals = list(enumerate(self._scenario.goals, start=1))[:last_goal]
        self._should_stop, self._on_progress = should_stop, on_progress
        if self._scenario.approach and not self._believes_reached(0) and not self._attempt(0, None, on_leg):
            return self.record()
        for number, goal in goals:
            if not self._believes_reached(number) and not self._attempt(number, goal, on_leg):
                return self.record()
        if self._options.trips is not None and last_goal is None:
            self._explore(self._options.trips, on_leg)
        return self.record()

    def record(self) -> Record:
        """The run as far as it went."""
        outcomes = {(leg.goal, leg.trip > 0): leg.outcome for leg in self._legs}  # of the last leg to each goal, and trip
        if self._exploration is not None and self._exploration.stopped_by == INTERRUPTED:
            outcomes[0, True] = INTERRUPTED
        failed = [outcome for outcome in outcomes.values() if outcome != ARRIVED]
        key_poses = KeyPoses(
            times=np.array(self._times),
            truth=np.array(self._truth),
            wheel_odometry=np.array(self._wheel),
            motions=np.array(self._motions),
            scans=tuple(self._slam.scans),
        )
        return Record(
            scenario=self._scenario,
            options=self._options,
            history=History(key_poses=key_poses, legs=tuple(self._legs), track=np.array(self._track).reshape(-1, 7)),
            estimate=self._slam.poses,
            graph=self._slam.graph,
            registered=self._slam.registered,
            occupancy=self._slam.occupancy(),
            deliberations=tuple(self._deliberations),
            outcome=failed[-1] if failed else ARRIVED if outcomes else INTERRUPTED,
            exploration=self._exploration,
        )

    def _believes_reached(self, goal: int) -> bool:
        return any(leg.goal == goal and leg.believed_arrived for leg in self._legs)

    def _attempt(self, number: int, goal: Goal | None, on_leg: Callable[[Record], None]) -> bool:
        """Legs to one goal until the robot believes itself there, or there is a reason to stop."""
        stuck = 0
        for _ in range(_MAX_ATTEMPTS):
            leg = self._approach() if goal is None else self._session(number, goal)
            self._legs.append(leg)
            on_leg(self.record())
            if leg.believed_arrived:
                return True
            stuck += leg.outcome.startswith("stuck")
            if stuck == _MAX_STUCK or not leg.outcome.startswith(("stuck", "blocked")):
                return False
        return False

    def _explore(self, trips: TripOptions, on_leg: Callable[[Record], None]) -> None:
        """Trips until it is certain that none gains enough, or there is another reason to stop."""
        stuck = 0
        while True:
            driven = max((leg.trip for leg in self._legs), default=0)
            first = self._slam.num_poses - 1
            leg = Leg(goal=0, trip=driven + 1, first_pose=first, last_pose=first, outcome="")
            try:
                found = self._searched(trips, leg)
            except PlanningError as error:
                self._exploration = Exploration(stopped_by=f"unreachable: {error}", num_trips=driven)
                return
            self._exploration = Exploration.of(found, trips, driven)
            if self._exploration.stopped_by != DRIVING:
                return
            deliberation, leg = deliberated_trip(self._slam.belief, found, self._options.objective, leg, index=len(self._legs))
            self._deliberations.append(deliberation)
            leg = self._driven(found.path, leg)
            self._legs.append(leg)
            stuck += leg.outcome.startswith("stuck")
            if stuck == _MAX_STUCK or not (leg.believed_arrived or leg.outcome.startswith(("stuck", "blocked"))):
                self._exploration = replace(self._exploration, stopped_by=leg.outcome, num_trips=driven + 1)
                on_leg(self.record())
                return
            on_leg(self.record())

    def _searched(self, trips: TripOptions, leg: Leg) -> SearchResult:
        def tell(progress: SearchProgress) -> None:
            self._on_progress(f"{leg.name}: searching", 0.0, 0.0)
            if self._should_stop():
                raise KeyboardInterrupt  # the search ends with what it has

        known, belief = self._known_world(), self._slam.belief
        return find_trip(
            belief,
            known,
            self._rule(belief, known),
            trips,
            self._options.objective,
            chassis=self._scenario.robot.radius,
            position_error=self._slam.position_error,
            on_progress=tell,
        )

    def _approach(self) -> Leg:
        path = np.array([self._slam.poses[-1, :2], *self._scenario.approach])
        return self._driven(
            path, Leg(goal=0, first_pose=self._slam.num_poses - 1, last_pose=0, outcome="", planned=path_length(path))
        )

    def _session(self, number: int, goal: Goal) -> Leg:
        """Plan, decide and drive."""
        first = self._slam.num_poses - 1
        leg = Leg(goal=number, first_pose=first, last_pose=first, outcome="")
        self._on_progress(f"goal {number}: planning", 0.0, 0.0)
        try:
            deliberation, leg = self._deliberated(goal, leg)
        except PlanningError as error:
            return replace(leg, outcome=f"unreachable: {error}")
        self._deliberations.append(deliberation)
        return self._driven(deliberation.paths[leg.chosen], leg)

    def _deliberated(self, goal: Goal, leg: Leg) -> tuple[Deliberation, Leg]:
        """Candidates, the choice among them, and what all of them would have been worth."""
        known, belief = self._known_world(), self._slam.belief
        return deliberated(
            belief,
            known,
            goal,
            self._rule(belief, known),
            self._options,
            leg,
            index=len(self._legs),
            chassis=self._scenario.robot.radius,
            position_error=self._slam.position_error,
            rng=self._rng(_CHOICE, len(self._legs)),
        )

    def _rule(self, belief: PoseGraph, known: World) -> CandidateRule:
        return decision_rule(self._scenario.rule, belief, known, self._slam.settings, seed=self._options.seed)

    def _known_world(self) -> World:
        return self._slam.occupancy().to_world(unknown="optimistic") if self._options.unknown else self._scenario.world

    def _driven(self, path: FloatArray, leg: Leg) -> Leg:
        """The leg once its path was followed, to the end or not."""
        begin, contacts, closures = self._robot.time, self._robot.contacts, self._slam.num_closures
        outcome, distance = self._follow(path, leg.name)
        true, believed = (
            math.dist(pose[:2].tolist(), path[-1].tolist())
            for pose in (self._robot.true_pose, self._slam.pose_now(self._wheel_now()))
        )
        if outcome == ARRIVED and true > ARRIVAL_TOLERANCE:
            outcome = f"{MISSED}: {true:.2f} m from the goal, where the robot believed itself within {believed:.2f} m of it"
        leg = replace(leg, outcome=outcome, goal_distance=true, believed_goal_distance=believed)
        if outcome != INTERRUPTED:
            self._add_key_pose()
        if leg.believed_arrived:
            self._slam.settle()
        objective = self._options.objective
        return replace(
            leg,
            last_pose=self._slam.num_poses - 1,
            distance=distance,
            num_closures=self._slam.num_closures - closures,
            achieved_value=value_after(self._slam.belief, leg.first_pose + 1, objective) if leg.is_decided else math.nan,
            driven_seconds=self._robot.time - begin,
            contacts=self._robot.contacts - contacts,
        )

    def _follow(self, path: FloatArray, name: str) -> tuple[str, float]:
        """Drive along a path; how that ended, and the metres it took."""
        follower, robot, slam = PathFollower(path), self._robot, self._slam
        length, distance, place, looked = path_length(path), 0.0, robot.true_pose[:2], -math.inf
        while True:
            if self._should_stop():
                return INTERRUPTED, distance
            wheel = self._wheel_now()
            if slam.wants_scan(wheel):
                slam.track(wheel, robot.scan())
            if slam.wants_key_pose(wheel):
                self._add_key_pose()
                self._on_progress(name, distance, max(length, distance))
                if self._options.unknown and self._is_blocked(follower.remaining):
                    return f"{_BLOCKED} {_shown(slam.poses[-1])}", distance
            pose = slam.pose_now(wheel)
            if self._options.unknown and robot.time >= looked + _LOOK_PERIOD:
                looked = robot.time
                if self._sees_wall(pose, follower.remaining):
                    return f"{_BLOCKED} {_shown(pose)}", distance
            self._tell_track(pose)
            speed, turn_rate = follower.command(pose, robot.time)
            if follower.arrived:
                return ARRIVED, distance
            if follower.stuck is not None:
                return f"stuck: {follower.stuck}", distance
            contacts = robot.contacts
            robot.step(speed, turn_rate)
            distance += float(np.linalg.norm(robot.true_pose[:2] - place))
            place = robot.true_pose[:2]
            if robot.contacts > contacts:
                believed = slam.pose_now(self._wheel_now())
                return f"{CONTACT}: touched a wall at {_shown(place)}, believed itself at {_shown(believed)}", distance

    def _is_blocked(self, rest: FloatArray) -> bool:
        """Whether what is left of the path leads through what is now known as a wall."""
        return not self._known_world().segments_free(rest[:-1], rest[1:], self._scenario.robot.radius).all()

    def _sees_wall(self, pose: FloatArray, rest: FloatArray) -> bool:
        """Whether the laser meets something just ahead on the path."""
        points = self._robot.scan().points
        poses = np.column_stack([points, np.zeros(len(points))])
        met = SE2_GROUP.compose(np.broadcast_to(pose, poses.shape), poses)[:, :2]
        return stands_in_the_way(met, rest, radius=self._scenario.robot.radius + _BRUSH, ahead=_LOOK_AHEAD)

    def _wheel_now(self) -> FloatArray:
        return SE2_GROUP.compose(self._wheel_at_start, self._robot.wheel_odometry)

    def _add_key_pose(self) -> None:
        """A key pose where the robot is; what SLAM gets is the scan and the wheel odometry."""
        scan: Scan = self._robot.scan()
        wheel = self._wheel_now()
        self._motions.append(self._slam.motion(wheel))
        self._slam.add_key_pose(wheel, scan, motion=self._motions[-1])
        self._times.append(self._time_at_start + self._robot.time)
        self._truth.append(self._robot.true_pose)
        self._wheel.append(wheel)

    def _tell_track(self, pose: FloatArray) -> None:
        now = self._time_at_start + self._robot.time
        if not self._track or now >= self._track[-1][0] + _TRACK_PERIOD:
            self._track.append(np.array([now, *self._robot.true_pose, *pose]))


def _shown(pose: FloatArray) -> str:
    return f"({pose[0]:.2f}, {pose[1]:.2f})"
