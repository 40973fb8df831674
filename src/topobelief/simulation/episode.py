"""Active SLAM in closed loop: at each goal the planner gets the graph and the map, decides, and the robot drives.

Everything on the way from the sensors to the wheels reads wheel odometry, scans and a bumper alone; the true pose goes into the
record and nowhere else. A leg ends when the robot believes itself at its goal, and counts as reached where it truly is there.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.learned_closures import learn_closures
from topobelief.candidates.polyline import path_length
from topobelief.errors import PlanningError
from topobelief.geometry import SE2_GROUP
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.compile_kernels import load_kernels
from topobelief.planning.planner import Planner
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
from topobelief.simulation.ways import known_candidates, place_with_room, stands_in_the_way
from topobelief.strategies.choose import choose
from topobelief.strategies.question import Ground, Question
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
        """Drive to the goals that are left.

        Parameters
        ----------
        should_stop
            Asked every control period; the run then ends with a complete record.
        on_progress
        on_leg
            Called with the record after each leg.
        last_goal
            Stop after this goal, counted from 1.
        """
        goals = list(enumerate(self._scenario.goals, start=1))[:last_goal]
        self._should_stop, self._on_progress = should_stop, on_progress
        if self._scenario.approach and not self._believes_reached(0) and not self._attempt(0, None, on_leg):
            return self.record()
        for number, goal in goals:
            if not self._believes_reached(number) and not self._attempt(number, goal, on_leg):
                break
        return self.record()

    def record(self) -> Record:
        """The run as far as it went."""
        outcomes = {leg.goal: leg.outcome for leg in self._legs}  # of the last leg to each goal
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
        begin, options, belief = time.perf_counter(), self._options, self._slam.belief
        settings = self._slam.settings
        known, rule = self._known_world(), self._scenario.rule
        closures = rule.closures
        if closures is None:
            seen_in = known if rule.line_of_sight else None
            closures = learn_closures(belief, world=seen_in, rule=settings.expected_closures)
        rule = replace(
            rule,
            closures=closures,
            seed=options.seed,
            spacing=settings.key_pose_distance,
            turn=settings.key_pose_angle,
            information=settings.expected_information if belief.num_edges == 0 else None,
        )
        found = known_candidates(
            belief,
            known,
            goal,
            rule,
            chassis=self._scenario.robot.radius,
            position_error=self._slam.position_error,
        )
        actions, lengths = found.actions, found.lengths
        candidates_seconds = time.perf_counter() - begin
        drawn = int(self._rng(_CHOICE, len(self._legs)).integers(len(actions)))
        random_scores = np.eye(len(actions))[drawn]
        ground = Ground(found.routes.roadmap, goal.place, known, rule)
        question = Question(belief, actions, lengths, random_scores, options.objective, ground=ground)
        choice = choose(options.strategy, question)
        own = choice.proposal
        question = question.joined_by(own)
        values, paths = question.values(), found.paths if own is None else [*found.paths, own.path]
        deliberation = Deliberation(leg=len(self._legs), question=question, paths=paths, values=values, choice=choice)
        return deliberation, replace(
            leg,
            num_candidates=len(paths),
            chosen=choice.index,
            planned=float(question.lengths[choice.index]),
            prior_value=value_after(belief, belief.num_poses, options.objective),
            predicted_value=float(values[choice.index]),
            candidates_seconds=candidates_seconds,
            decision_seconds=choice.seconds,
        )

    def _known_world(self) -> World:
        return self._slam.occupancy().to_world(unknown="optimistic") if self._options.unknown else self._scenario.world

    def _driven(self, path: FloatArray, leg: Leg) -> Leg:
        """The leg once its path was followed, to the end or not."""
        begin, contacts, closures = self._robot.time, self._robot.contacts, self._slam.num_closures
        outcome, distance = self._follow(path, f"goal {leg.goal}" if leg.goal else "approach")
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
            achieved_value=value_after(self._slam.belief, leg.first_pose + 1, objective) if leg.goal else float("nan"),
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


def value_after(graph: PoseGraph, num_existing: int, objective: str) -> float:
    """The objective of a graph whose first `num_existing` poses stood before the leg, in its unit."""
    among = (graph.edges < num_existing).all(axis=1)
    prior = PoseGraph(graph.poses[:num_existing], graph.edges[among], None, graph.information[among])
    rest = Action(graph.poses[num_existing:], graph.edges[~among], graph.information[~among])
    return float(Planner(prior, objective=objective).entropies([rest])[0])
