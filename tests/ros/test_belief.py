"""What topics say, as messages with the fields of ROS; nothing of ROS is needed."""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from topobelief.errors import PlanningError, TopobeliefError
from topobelief.ros.belief import Belief
from topobelief.ros.explorer import Explorer


def thing(**fields: Any) -> SimpleNamespace:
    return SimpleNamespace(**fields)


def header(seconds: float) -> SimpleNamespace:
    return thing(stamp=thing(sec=int(seconds), nanosec=0), frame_id="map")


def pose(x: float, y: float, z: float = 0.0) -> SimpleNamespace:
    return thing(position=thing(x=float(x), y=float(y), z=z), orientation=thing(x=0.0, y=0.0, z=0.0, w=1.0))


def grid(
    seconds: float = 1.0, *, side: int = 20, origin: tuple[float, float] = (-1.0, -1.0), extra: int = 0
) -> SimpleNamespace:
    info = thing(width=side, height=side, resolution=0.5, origin=pose(*origin))
    return thing(header=header(seconds), info=info, data=np.zeros(side * side + extra, dtype=np.int8))


def drawn(num_poses: int, seconds: float = 1.0, *, x: float | None = None) -> SimpleNamespace:
    """As slam_toolbox draws: a sphere a pose, and the lines between them."""

    def marker(number: int, kind: int, at: Any, points: list[Any]) -> SimpleNamespace:
        return thing(header=header(seconds), ns="slam", id=number, type=kind, action=0, pose=at, points=points)

    spheres = [marker(i, 2, pose(i * 0.5 if x is None else x, 0), []) for i in range(num_poses)]
    places = [sphere.pose.position for sphere in spheres]
    lines = [point for pair in itertools.pairwise(places) for point in pair]
    return thing(markers=[*spheres, marker(num_poses, 5, pose(0, 0), lines)])


def stamped(seconds: float, x: float, y: float) -> SimpleNamespace:
    return thing(header=header(seconds), pose=pose(x, y))


def known() -> Belief:
    belief = Belief((0.05, 0.02))
    belief.take_map(grid())
    belief.take_graph(drawn(6))
    return belief


def test_nothing_is_decided_before_map_and_graph_are_there() -> None:
    belief = Belief((0.05, 0.02))
    with pytest.raises(PlanningError, match="a map and a pose graph"):
        belief.situation()
    belief.take_map(grid())
    with pytest.raises(PlanningError, match="expected a pose graph"):
        belief.situation()


def test_the_graph_grows_shrinks_and_the_map_changes_size_and_origin() -> None:
    belief = known()
    first = belief.situation()
    assert (first.graph.num_poses, first.start.pose) == (6, 5)
    belief.take_graph(drawn(9, 2.0))
    belief.take_map(grid(2.0, side=30, origin=(-3.0, -2.0)))
    grown = belief.situation()
    assert (grown.graph.num_poses, grown.world.bounds) == (9, (-3.0, -2.0, 12.0, 13.0))
    assert grown.number > first.number
    belief.take_graph(drawn(4, 3.0))
    assert belief.situation().graph.num_poses == 4


def test_what_comes_late_is_left_and_a_clock_that_is_set_back_is_followed() -> None:
    belief = known()
    belief.take_graph(drawn(9, 100.0))
    belief.take_graph(drawn(8, 98.0))
    assert belief.situation().graph.num_poses == 9
    belief.take_graph(drawn(7, 0.0))  # without a time
    assert belief.situation().graph.num_poses == 7
    belief.take_graph(drawn(5, 3.0))
    assert belief.situation().graph.num_poses == 5


def test_a_message_that_cannot_be_read_leaves_the_one_before() -> None:
    belief = known()
    belief.situation()
    belief.take_map(grid(2.0, extra=3))
    belief.take_graph(drawn(6, 2.0, x=float("nan")))
    assert belief.situation().graph.num_poses == 6
    assert ["403" in problem or "finite" in problem or "numbers" in problem for problem in belief.problems] == [True, True]
    belief.take_map(grid(3.0))
    belief.take_graph(drawn(7, 3.0))
    assert belief.situation().graph.num_poses == 7
    assert belief.problems == []


def test_a_first_message_that_cannot_be_read_is_an_error() -> None:
    belief = Belief((0.05, 0.02))
    belief.take_map(grid(extra=1))
    with pytest.raises(TopobeliefError, match="cells"):
        belief.situation()


def test_the_robot_stands_where_it_said_last() -> None:
    belief = known()
    assert belief.take_pose(stamped(5.0, 1.2, 0.5))
    assert not belief.take_pose(stamped(4.0, 9.0, 9.0))
    assert not belief.take_pose(stamped(6.0, float("nan"), 0.0))
    assert belief.situation().start.place.tolist() == [1.2, 0.5]


def test_a_trajectory_serves_where_no_graph_is_drawn() -> None:
    belief = Belief((0.05, 0.02))
    belief.take_map(grid())
    belief.take_trajectory(thing(header=header(1.0), poses=[stamped(1.0, i * 0.5, 0) for i in range(5)]))
    assert belief.situation().graph.num_poses == 5


def test_exploring_asks_once_a_trip_and_again_at_its_end() -> None:
    explorer = Explorer(0.5)
    assert explorer.next_step((0, 0)) == "wait"
    explorer.start()
    assert [explorer.next_step((0, 0)) for _ in range(2)] == ["ask", "wait"]
    explorer.answered((3, 0))
    assert [explorer.next_step(place) for place in (None, (1, 0), (2.8, 0))] == ["wait", "wait", "ask"]
    explorer.stop()
    explorer.answered((9, 9))
    assert explorer.next_step((9, 9)) == "wait"
