"""What a robot's topics have said so far: its map, its pose graph and its own place, each the newest that could be read.

Messages are those of ROS, or anything with the same fields; they are read when a question is asked, not when they come, because
a map may come more often than anybody asks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import Any, Generic, TypeVar

import numpy as np

from topobelief.candidates.start import Start, find_start
from topobelief.errors import PlanningError, TopobeliefError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.projection import projected_to_plane
from topobelief.io.bag_graphs import markers_of_message, poses_of_messages
from topobelief.io.bag_maps import grid_of_message, world_of_grid
from topobelief.io.markers import graph_of_markers
from topobelief.io.reading import ReadingOptions
from topobelief.io.trajectory import graph_along
from topobelief.world import World

_LATE = 5.0  # seconds; a message that is stamped further back is of a clock that was set back

_Value = TypeVar("_Value")


@dataclass(frozen=True, eq=False, slots=True)
class Situation:
    """All that a decision needs; `number` grows whenever something in it is new."""

    number: int
    graph: PoseGraph
    world: World
    start: Start


class Belief:
    """The newest of each, safe to use from several threads.

    Parameters
    ----------
    noise
        Standard deviations of the measurements of a graph whose messages state none, metres and radians.
    graph, world
        Where they come from files; messages replace them.
    """

    def __init__(self, noise: tuple[float, float], *, graph: PoseGraph | None = None, world: World | None = None) -> None:
        options = ReadingOptions(noise=noise)

        def drawn(message: Any) -> PoseGraph:
            markers = list(markers_of_message("graph", message, where="the message"))
            return _planar(graph_of_markers("graph", markers, options).graph)

        def driven(message: Any) -> PoseGraph:
            poses = [stamped.pose for stamped in message.poses]
            return _planar(
                graph_along("trajectory", poses_of_messages("trajectory", poses, where="the message"), options, []).graph
            )

        def mapped(message: Any) -> World:
            return world_of_grid("map", grid_of_message("map", message, where="the message"))

        self._lock = Lock()
        self._world = _Newest(mapped, world)
        self._drawn, self._driven = _Newest(drawn, graph), _Newest(driven)
        self._clock = _Clock()
        self._number = 0
        self.place: tuple[float, float] | None = None
        """Where the robot said last that it is, metres."""

    def take_map(self, message: Any) -> None:
        """A nav_msgs/OccupancyGrid."""
        self._take(self._world, message, _stamp(message))

    def take_graph(self, message: Any) -> None:
        """A visualization_msgs/MarkerArray that draws the pose graph, as slam_toolbox and Cartographer publish it."""
        self._take(self._drawn, message, max(map(_stamp, message.markers), default=0.0))

    def take_trajectory(self, message: Any) -> None:
        """A nav_msgs/Path of all poses so far, which counts where no graph is drawn."""
        self._take(self._driven, message, _stamp(message))

    def take_pose(self, message: Any) -> bool:
        """Where the robot is, a geometry_msgs/PoseStamped; returns whether it was taken."""
        x, y = float(message.pose.position.x), float(message.pose.position.y)
        with self._lock:
            if not math.isfinite(x + y) or not self._clock.is_news(_stamp(message)):
                return False
            self.place = x, y
            return True

    def situation(self) -> Situation:
        """What is known now.

        Raises
        ------
        PlanningError
            Where something is still to come; names it.
        TopobeliefError
            Where the newest message of a kind cannot be read and none could before.
        """
        with self._lock:
            graph, world, place, number = (
                self._drawn.value() or self._driven.value(),
                self._world.value(),
                self.place,
                self._number,
            )
        missing = [name for name, value in (("a map", world), ("a pose graph", graph)) if value is None]
        if graph is None or world is None:
            raise PlanningError(f"expected {' and '.join(missing)} before a question, got none yet; are the topics remapped?")
        start = find_start(graph, None if place is None else np.array(place), world=world)
        return Situation(number, graph, world, start)

    @property
    def problems(self) -> list[str]:
        """Of the newest messages, what is wrong with those that could not be read."""
        with self._lock:
            return [each.problem for each in (self._world, self._drawn, self._driven) if each.problem]

    def _take(self, newest: _Newest[Any], message: Any, stamp: float) -> None:
        with self._lock:
            self._number += newest.take(message, stamp)


class _Clock:
    """Tells messages that come late from those of a clock that was set back, as by a recording that starts again."""

    def __init__(self) -> None:
        self._last = 0.0

    def is_news(self, stamp: float) -> bool:
        """Whether a message counts; one without a time, stamped 0, always does."""
        if stamp and self._last - _LATE < stamp < self._last:
            return False
        self._last = stamp or self._last
        return True


class _Newest(Generic[_Value]):
    """The newest message of a kind, and the value of the newest that could be read."""

    def __init__(self, read: Callable[[Any], _Value], value: _Value | None = None) -> None:
        self._read, self._value = read, value
        self._message: Any = None
        self._clock = _Clock()
        self.problem = ""

    def take(self, message: Any, stamp: float) -> bool:
        """Whether it is news."""
        if not self._clock.is_news(stamp):
            return False
        self._message = message
        return True

    def value(self) -> _Value | None:
        """Of the newest message; where that cannot be read, of the one before, and `problem` says why."""
        if self._message is not None:
            message, self._message, self.problem = self._message, None, ""
            try:
                self._value = self._read(message)
            except TopobeliefError as error:
                self.problem = str(error)
                if self._value is None:
                    raise
        return self._value


def _stamp(message: Any) -> float:
    """Seconds."""
    stamp = message.header.stamp
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def _planar(graph: PoseGraph) -> PoseGraph:
    return projected_to_plane(graph)[0] if graph.group.position_dim == 3 else graph
