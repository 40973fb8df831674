"""Following a path by the pose estimate: pure pursuit that looks only as far ahead as the path stays straight.

Pure pursuit (Coulter, CMU-RI-TR-92-01) steers on the arc to a point on the path ahead of the robot, the carrot. A carrot far
ahead makes it smooth and lets it cut corners; one near by the reverse. Here the carrot lies as far ahead as the path keeps
within a tolerance of the straight way to it: far on straights and gentle bends, near before corners. The robot could stop at
the carrot at any time, slows down with the angle to it, and turns on the spot where that is large, so a corner in a doorway is
taken slowly and tightly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray, frozen_floats
from topobelief.errors import InvalidInputError, require_positive
from topobelief.geometry import wrap_angle

_SAMPLE_SPACING = 0.02  # m, between the points of the path that are looked at
_SEARCH = 1.0  # m along the path, in which the robot is looked for
_DETOUR_COST = 0.2  # m a metre along the path, and
_TURN_COST = 0.1  # m for a right angle: where the path runs close to itself, which stretch is meant
_TURN_GAIN = 3.0  # 1/s


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowerSettings:
    """How a path is followed.

    Parameters
    ----------
    speed, turn_rate
        At most, m/s and rad/s.
    look_ahead
        Of the carrot at most, metres.
    corner_cut
        How far the straight way to the carrot may leave the path, metres.
    turn_above, drive_below
        Angles to the carrot, radians: above the first the robot turns on the spot, until it is below the second.
    deceleration
        With which it comes to the goal, m/s².
    arrival_radius
        Distance from the goal, by the estimate, at which the robot has arrived, metres.
    patience
        Seconds without progress after which it is stuck.
    """

    speed: float = 0.7
    turn_rate: float = 1.5
    look_ahead: float = 0.6
    corner_cut: float = 0.03
    turn_above: float = 0.6
    drive_below: float = 0.1
    deceleration: float = 0.5
    arrival_radius: float = 0.15
    patience: float = 10.0

    def __post_init__(self) -> None:
        for name in self.__slots__:
            require_positive(f"a path follower's {name}", getattr(self, name))


class PathFollower:
    """Steers along one path to its end, and says when it got there or why it does not.

    Parameters
    ----------
    waypoints : shape (k, 2)
        Corners of the path, metres; the last is the goal. The robot need not stand at the first.
    settings

    Attributes
    ----------
    path, settings
    arrived : bool
        Whether the estimate came within the arrival radius of the goal; stays true.
    stuck : str or None
        Why the goal is not being reached, in words; stays set. None while all is well.

    Raises
    ------
    InvalidInputError
        Where there is no waypoint, or one is not finite.

    Examples
    --------
    >>> follower = PathFollower([(0, 0), (5, 0)])
    >>> follower.command(np.array([0.0, 0.0, 0.0]), time=0.0)
    (0.7, 0.0)
    >>> follower.command(np.array([4.95, 0.0, 0.0]), time=8.0)
    (0.0, 0.0)
    >>> follower.arrived
    True
    """

    def __init__(self, waypoints: ArrayLike, *, settings: FollowerSettings | None = None) -> None:
        path = frozen_floats(waypoints, name="waypoints")
        if path.ndim != 2 or path.shape[1] != 2 or len(path) == 0 or not np.isfinite(path).all():
            raise InvalidInputError(f"expected finite waypoints of shape (k, 2), k > 0, got shape {path.shape}")
        self.path = path
        self.settings = settings or FollowerSettings()
        self.arrived = False
        self.stuck: str | None = None
        self._points, self._stations, self._headings = _sampled(path)
        self._nearest = 0  # index of the point of the path next to the robot
        self._turning = False
        self._least_to_go = math.inf
        self._last_progress = -math.inf

    @property
    def goal(self) -> FloatArray:
        """End of the path, shape (2,)."""
        return self.path[-1]

    @property
    def remaining(self) -> FloatArray:
        """What is left of the path, from the point next to the robot, shape (k, 2)."""
        station = self._stations[self._nearest]
        return np.concatenate([self._points[self._nearest][None], self.path[_stations(self.path) > station]])

    @property
    def length_to_go(self) -> float:
        """Metres along the path from the point next to the robot to the goal."""
        return float(self._stations[-1] - self._stations[self._nearest])

    def command(self, pose_estimate: FloatArray, time: float) -> tuple[float, float]:
        """Speed (m/s) and turn rate (rad/s) for the next control period; (0, 0) once arrived or stuck.

        Parameters
        ----------
        pose_estimate : shape (3,)
            Where the robot believes it is, in the frame of the path; it may jump where a closure corrects it.
        time
            Seconds, of any clock that the robot keeps.

        Raises
        ------
        InvalidInputError
            Where the pose is not finite.
        """
        pose = frozen_floats(pose_estimate, name="the pose estimate")
        if pose.shape != (3,) or not np.isfinite(pose).all():
            raise InvalidInputError(f"expected a finite pose estimate (x, y, theta), got {pose.tolist()}")
        if not (self.arrived or self.stuck):
            while (nearest := self._next_to(pose)) != self._nearest:  # ends, as each is closer than the last
                self._nearest = nearest
            self._watch(pose[:2], time)
        return (0.0, 0.0) if self.arrived or self.stuck else self._steer(pose)

    def _next_to(self, pose: FloatArray) -> int:
        """The path point nearest the robot, near the last one and with a similar heading: a path may pass a place twice."""
        here = float(self._stations[self._nearest])
        first, end = np.searchsorted(self._stations, (here - _SEARCH, here + _SEARCH)).tolist()
        costs = np.linalg.norm(self._points[first : end + 1] - pose[:2], axis=1)
        costs += _DETOUR_COST * np.abs(self._stations[first : end + 1] - here)
        costs += _TURN_COST * (1 - np.cos(self._headings[first : end + 1] - pose[2]))
        return first + int(np.argmin(costs))

    def _watch(self, place: FloatArray, time: float) -> None:
        """Notice arrival, on the last stretch of a path that may have passed the goal before, and lack of progress."""
        from_goal = math.dist(place.tolist(), self.goal.tolist())
        if from_goal <= self.settings.arrival_radius and self.length_to_go <= _SEARCH:
            self.arrived = True
            return
        off_path = math.dist(place.tolist(), self._points[self._nearest].tolist())
        if self.length_to_go + off_path < self._least_to_go - _SAMPLE_SPACING:
            self._least_to_go, self._last_progress = self.length_to_go + off_path, time
        if time - self._last_progress > self.settings.patience:
            self.stuck = (
                f"no progress for {self.settings.patience:g} s at ({place[0]:.2f}, {place[1]:.2f}), "
                f"{self.length_to_go:.1f} m of path before the goal and {off_path:.2f} m off the path"
            )

    def _steer(self, pose: FloatArray) -> tuple[float, float]:
        settings = self.settings
        ahead = self._carrot() - pose[:2]
        distance = float(np.linalg.norm(ahead))
        angle = float(wrap_angle(np.arctan2(ahead[1], ahead[0]) - pose[2]))
        self._turning = abs(angle) > (settings.drive_below if self._turning else settings.turn_above)
        if self._turning:
            return 0.0, math.copysign(min(_TURN_GAIN * abs(angle), settings.turn_rate), angle)
        speed = min(settings.speed, math.sqrt(2 * settings.deceleration * distance))  # to stop at the carrot
        speed *= 1 - abs(angle) / settings.turn_above
        curvature = 2 * math.sin(angle) / max(distance, _SAMPLE_SPACING)
        return speed, min(max(speed * curvature, -settings.turn_rate), settings.turn_rate)

    def _carrot(self) -> FloatArray:
        """The furthest point ahead to which the straight way keeps near the path, shape (2,)."""
        here = self._nearest
        station = float(self._stations[here])
        end = int(np.searchsorted(self._stations, station + self.settings.look_ahead, side="right"))
        stretch = self._points[here:end] - self._points[here]
        if len(stretch) < 2:
            return self._points[-1]
        chords: FloatArray = stretch[1:]
        squares = np.einsum("ij,ij->i", chords, chords).clip(min=1e-12)
        along = np.clip(chords @ stretch.T / squares[:, None], 0.0, 1.0)  # of each point, in each chord
        off_chord: FloatArray = np.linalg.norm(along[:, :, None] * chords[:, None, :] - stretch, axis=2)
        leaves = np.tril(off_chord, k=1).max(axis=1) > self.settings.corner_cut  # only points before the chord's end
        furthest = int(np.argmax(leaves)) if leaves.any() else len(chords)
        return self._points[here + max(furthest, 1)]


def _sampled(path: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points along the path, at most `_SAMPLE_SPACING` apart, how far along each lies, and the heading from there on."""
    corners = _stations(path)
    stations = np.unique(np.concatenate([corners, np.arange(0.0, corners[-1], _SAMPLE_SPACING)]))
    points = np.stack([np.interp(stations, corners, path[:, axis]) for axis in (0, 1)], axis=1)
    steps = np.diff(points, axis=0) if len(points) > 1 else np.zeros((1, 2))
    headings = np.arctan2(steps[:, 1], steps[:, 0])
    return points, stations, np.concatenate([headings, headings[-1:]])[: len(points)]


def _stations(path: FloatArray) -> FloatArray:
    """How far along the path each corner lies, metres, shape (k,)."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
