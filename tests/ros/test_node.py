"""The node across processes, over real DDS: a fake robot replays the recorded office drive and asks where to go.

Runs where rclpy is installed (`make test-ros`); nothing stands in for it.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

rclpy = pytest.importorskip("rclpy")
from geometry_msgs.msg import Point, PoseStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import Marker, MarkerArray

import topobelief as tb

OFFICE = Path(__file__).parents[2] / "examples" / "office"
GOAL = (25.0, -2.95)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
WAIT = 120.0  # seconds; kernels may have to be compiled first


class Robot:
    """Publishes what a SLAM system would, and keeps what the node says."""

    def __init__(self) -> None:
        rclpy.init()
        self.node = rclpy.create_node("robot")
        self.graph = tb.read_g2o(OFFICE / "recorded.g2o")
        self.decisions: list[dict[str, Any]] = []
        self.paths: list[Any] = []
        self.goal_poses: list[Any] = []
        node = self.node
        self.map = node.create_publisher(OccupancyGrid, "map", LATCHED)
        self.drawing = node.create_publisher(MarkerArray, "graph", 1)
        self.pose = node.create_publisher(PoseStamped, "pose", 1)
        self.goal = node.create_publisher(PoseStamped, "goal", 1)
        node.create_subscription(String, "topobelief/decision", lambda m: self.decisions.append(json.loads(m.data)), LATCHED)
        node.create_subscription(PathMessage, "topobelief/path", self.paths.append, LATCHED)
        node.create_subscription(PoseStamped, "goal_pose", self.goal_poses.append, LATCHED)
        self.candidates: list[Any] = []
        node.create_subscription(MarkerArray, "topobelief/candidates", self.candidates.append, LATCHED)
        self.services = {
            name: node.create_client(kind, f"topobelief/{name}")
            for name, kind in (("plan", Trigger), ("explain", Trigger), ("explore", SetBool), ("change_state", ChangeState))
        }

    def until(self, condition: Callable[[], object]) -> None:
        """Spin until something is so."""
        end = time.monotonic() + WAIT
        while not condition():
            assert time.monotonic() < end, "the node does not answer"
            rclpy.spin_once(self.node, timeout_sec=0.05)

    def call(self, name: str, request: Any) -> Any:
        client = self.services[name]
        self.until(client.service_is_ready)
        future = client.call_async(request)
        self.until(future.done)
        return future.result()

    def grid(self, *, cut: int = 0) -> OccupancyGrid:
        """The map; cut short by so many cells."""
        facts = yaml.safe_load((OFFICE / "recorded.yaml").read_text())
        pixels = np.flipud(np.asarray(Image.open(OFFICE / facts["image"]).convert("L")))
        cells = np.select([pixels >= 250, pixels <= 5], [0, 100], -1).astype(np.int8).ravel()
        message = OccupancyGrid(data=cells[: len(cells) - cut].tolist())
        message.info.height, message.info.width = pixels.shape
        message.info.resolution = float(facts["resolution"])
        message.info.origin.position.x, message.info.origin.position.y = map(float, facts["origin"][:2])
        message.info.origin.orientation.w = 1.0
        return message

    def drawn(self, num_poses: int) -> MarkerArray:
        """The first poses of the drive and the edges between them, as slam_toolbox draws them."""
        markers: list[Marker] = []
        points = [Point(x=float(x), y=float(y)) for x, y in self.graph.positions[:num_poses]]
        for number, point in enumerate(points):
            marker = Marker(ns="slam_toolbox", id=number, type=Marker.SPHERE)
            marker.pose.position, marker.pose.orientation.w = point, 1.0
            markers.append(marker)
        lines = Marker(ns="slam_toolbox", id=num_poses, type=Marker.LINE_LIST)
        lines.points = [points[end] for edge in self.graph.edges.tolist() if max(edge) < num_poses for end in edge]
        return MarkerArray(markers=[*markers, lines])

    def stamped(self, x: float, y: float) -> PoseStamped:
        message = PoseStamped()
        message.pose.position.x, message.pose.position.y = float(x), float(y)
        message.header.stamp = self.node.get_clock().now().to_msg()
        return message

    def answered(self) -> dict[str, Any]:
        """The next decision that is final."""
        seen = len(self.decisions)
        self.until(lambda: any(decision["final"] for decision in self.decisions[seen:]))
        return self.decisions[-1]


@pytest.fixture(scope="module")
def robot() -> Iterator[Robot]:
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    os.environ["ROS_DOMAIN_ID"] = str(os.getpid() % 100)
    parameters = ["-p", "drive:=true", "-p", "max_length:=15.0"]
    command = [sys.executable, "-m", "topobelief", "ros", "--vertices", "300", "--seconds", "1", "--ros-args", *parameters]
    process = subprocess.Popen(command)
    robot = Robot()
    try:
        robot.until(robot.services["plan"].service_is_ready)
        assert "expected a map and a pose graph" in robot.call("plan", Trigger.Request()).message
        robot.map.publish(robot.grid())
        robot.drawing.publish(robot.drawn(100))
        last = robot.graph.positions[99]
        robot.pose.publish(robot.stamped(*last))
        robot.until(lambda: robot.call("plan", Trigger.Request()).success)
        robot.answered()
        yield robot
    finally:
        robot.node.destroy_node()
        rclpy.shutdown()
        process.terminate()
        process.wait(20)


def is_at(stamped: Any, place: Any) -> bool:
    return math.dist((stamped.pose.position.x, stamped.pose.position.y), place[:2]) < 1e-6


def ask(robot: Robot, goal: tuple[float, float] = GOAL) -> dict[str, Any]:
    robot.goal.publish(robot.stamped(*goal))
    decision = robot.answered()
    if decision["goal"] != list(goal):
        decision = robot.answered()
    return decision


def test_a_goal_is_answered_with_a_way_to_drive_and_why(robot: Robot) -> None:
    decision = ask(robot)
    assert decision["headline"].startswith("Drive path")
    robot.until(lambda: robot.paths and is_at(robot.paths[-1].poses[-1], GOAL))
    assert robot.paths[-1].header.frame_id == "map"
    robot.until(lambda: robot.goal_poses and is_at(robot.goal_poses[-1], GOAL))
    robot.until(lambda: any(marker.text.startswith("Drive path") for marker in robot.candidates[-1].markers))
    reasons = robot.call("explain", Trigger.Request())
    assert reasons.success
    assert "chosen: the best way found" in reasons.message


def test_the_first_answer_comes_before_the_last_and_is_no_better(robot: Robot) -> None:
    seen = len(robot.decisions)
    ask(robot)
    values = [decision["ways"][decision["best"]] for decision in robot.decisions[seen:]]
    assert len(values) >= 2
    assert [decision["final"] for decision in robot.decisions[seen:]].count(True) >= 1


def test_the_graph_grows_and_shrinks_and_bad_messages_are_survived(robot: Robot) -> None:
    robot.drawing.publish(robot.drawn(121))
    robot.pose.publish(robot.stamped(*robot.graph.positions[120]))
    grown = ask(robot)
    robot.until(lambda: is_at(robot.paths[-1].poses[0], robot.graph.positions[120]))
    robot.map.publish(robot.grid(cut=7))
    broken = robot.drawn(50)
    broken.markers[3].pose.position.x = math.nan
    robot.drawing.publish(broken)
    robot.goal.publish(robot.stamped(math.inf, 0.0))
    assert ask(robot)["headline"].startswith("Drive path")
    assert len(grown["ways"]) > 1
    robot.drawing.publish(robot.drawn(100))
    robot.pose.publish(robot.stamped(*robot.graph.positions[99]))
    assert ask(robot)["headline"].startswith("Drive path")


def test_a_goal_in_a_wall_is_told(robot: Robot) -> None:
    decision = ask(robot, (-100.0, 40.0))
    assert "expected" in decision["error"]


def test_exploring_goes_from_trip_to_trip_until_it_is_stopped(robot: Robot) -> None:
    assert robot.call("explore", SetBool.Request(data=True)).success
    first = robot.answered()
    assert first["goal"] is None
    end = first["ways"][first["best"]]["poses"][-1]
    robot.pose.publish(robot.stamped(*end[:2]))
    second = robot.answered()
    assert second["goal"] is None
    assert second["ways"][second["best"]]["poses"][0][:2] == pytest.approx(end[:2])
    assert robot.call("explore", SetBool.Request(data=False)).message == "stopped"


def test_it_rests_while_it_is_not_active(robot: Robot) -> None:
    def change(transition: int) -> None:
        request = ChangeState.Request()
        request.transition.id = transition
        assert robot.call("change_state", request).success

    change(Transition.TRANSITION_DEACTIVATE)
    assert not robot.call("plan", Trigger.Request()).success
    change(Transition.TRANSITION_ACTIVATE)
    assert ask(robot)["headline"].startswith("Drive path")
