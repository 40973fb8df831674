"""The node: topics in, a decision out. It is thin: what it says is that of `topobelief plan`.

Subscribed, remap as needed: `map` (nav_msgs/OccupancyGrid), `graph` (visualization_msgs/MarkerArray), `trajectory`
(nav_msgs/Path), `pose` (geometry_msgs/PoseStamped), `pose_with_covariance` (PoseWithCovarianceStamped),
and `goal` (PoseStamped).

Published: `~/path` and `~/alternatives/aN` (nav_msgs/Path), `~/candidates` (MarkerArray), `~/decision` (std_msgs/String, JSON),
and, with the parameter `drive`, `goal_pose` (PoseStamped). Services: `~/plan` and `~/explain` (std_srvs/Trigger), `~/explore`
(std_srvs/SetBool).
"""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

from topobelief.errors import InvalidInputError, TopobeliefError
from topobelief.io.json_values import without_nan
from topobelief.page.desk import Answerer
from topobelief.page.question import Question
from topobelief.ros.belief import Belief, Situation
from topobelief.ros.explorer import Explorer
from topobelief.ros.messages import Messages

PARAMETERS: Mapping[str, Any] = {
    "max_length": 30.0,  # metres; of a trip without a goal
    "objective": "error",
    "closures": "learned",
    "enough": 0.0,  # in the unit of the objective; exploring ends when no trip gains more
    "return_to_start": False,  # of trips
    "alternatives": 3,  # how many to publish as paths
    "arrived": 0.5,  # metres from the end of a trip at which the next is asked for
    "frame": "map",
    "drive": False,  # publish where the chosen way ends as goal_pose
}
"""The node's own parameters and their defaults; whatever else a decision depends on is an option of `topobelief ros`."""

Answers = Callable[[Situation, Answerer | None], Answerer]
"""Makes what answers questions about a situation, from what answered those about the one before."""


def run(belief: Belief, answers: Answers, arguments: list[str]) -> None:
    """Spin until interrupted.

    Raises
    ------
    InvalidInputError
        Where rclpy is not there.
    """
    rclpy = load_ros("rclpy")
    rclpy.init(args=arguments)
    node = make_node(belief, answers)
    executor = load_ros("rclpy.executors").SingleThreadedExecutor()
    executor.add_node(node)
    try:
        node.trigger_configure()
        node.trigger_activate()
        executor.spin()
    except (KeyboardInterrupt, load_ros("rclpy.executors").ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def load_ros(module: str) -> Any:
    """A module of ROS 2.

    Raises
    ------
    InvalidInputError
        Where it cannot be imported; says how to make it so.
    """
    try:
        return import_module(module)
    except ImportError:
        raise InvalidInputError(
            f"expected ROS 2 with {module} for this interpreter, got none; run `source /opt/ros/NAME/setup.bash` first, "
            "and install topobelief for the interpreter of ROS"
        ) from None


def make_node(belief: Belief, answers: Answers) -> Any:
    """A lifecycle node, unconfigured."""
    lifecycle = load_ros("rclpy.lifecycle")
    base: Any = lifecycle.LifecycleNode
    done = lifecycle.TransitionCallbackReturn.SUCCESS

    class Node(base):  # rclpy is not there when types are checked
        desk: _Desk | None = None

        def on_configure(self, state: Any) -> Any:
            self.desk = _Desk(self, belief, answers)
            return done

        def on_activate(self, state: Any) -> Any:
            if self.desk is not None:
                self.desk.active = True
            return done

        def on_deactivate(self, state: Any) -> Any:
            if self.desk is not None:
                self.desk.active = False
            return done

        def on_cleanup(self, state: Any) -> Any:
            if self.desk is not None:
                self.desk.close()
                self.desk = None
            return done

        on_shutdown = on_cleanup

    node: Any = Node("topobelief")
    for name, value in PARAMETERS.items():
        node.declare_parameter(name, value)
    return node


class _Desk:
    """Subscriptions, services, and the one question that is being answered."""

    def __init__(self, node: Any, belief: Belief, answers: Answers) -> None:
        self.active = False
        self._node, self._belief, self._make_answers = node, belief, answers
        self._messages = Messages(str(self._value("frame")))
        self._explorer = Explorer(float(self._value("arrived")))
        self._answerer: tuple[int, Answerer] | None = None
        self._asked = 0  # questions so far; only the last one is answered
        self._answer: Mapping[str, Any] | None = None
        self._goal: tuple[float, float] | None = None
        self._publishers: dict[str, Any] = {}
        messages, latched = self._messages, _latched()
        create, self._entities = node.create_subscription, list[Any]()
        for kind, topic, take, quality in (
            (messages.OccupancyGrid, "map", belief.take_map, latched),
            (messages.MarkerArray, "graph", belief.take_graph, 1),
            (messages.Path, "trajectory", belief.take_trajectory, 1),
            (messages.PoseStamped, "pose", self._take_pose, 1),
            (messages.PoseWithCovarianceStamped, "pose_with_covariance", self._take_uncertain_pose, 1),
            (messages.PoseStamped, "goal", self._take_goal, 1),
        ):
            self._entities.append(create(kind, topic, take, quality))
        for kind, name, serve in (
            (messages.Trigger, "plan", self._plan),
            (messages.Trigger, "explain", self._explain),
            (messages.SetBool, "explore", self._explore),
        ):
            self._entities.append(node.create_service(kind, f"~/{name}", serve))
        self._timer = node.create_timer(0.2, self._look_around)

    def close(self) -> None:
        """Let go of everything."""
        self._asked += 1
        self._explorer.stop()
        destroy = self._node
        destroy.destroy_timer(self._timer)
        for entity in self._entities:
            (destroy.destroy_service if hasattr(entity, "srv_type") else destroy.destroy_subscription)(entity)
        for publisher in self._publishers.values():
            destroy.destroy_publisher(publisher)

    def _value(self, name: str) -> Any:
        return self._node.get_parameter(name).value

    def _take_pose(self, message: Any) -> None:
        self._belief.take_pose(message)

    def _take_uncertain_pose(self, message: Any) -> None:
        self._belief.take_pose(self._messages.without_covariance(message))

    def _take_goal(self, message: Any) -> None:
        x, y = message.pose.position.x, message.pose.position.y
        if not math.isfinite(x + y):
            self._node.get_logger().warning("expected a goal with finite coordinates, got another; it is ignored")
            return
        self._goal = (x, y)
        self._explorer.stop()
        self._ask()

    def _plan(self, _: Any, response: Any) -> Any:
        """Answer the last goal anew, or a trip where there was none."""
        response.success, response.message = self._ask()
        return response

    def _explain(self, _: Any, response: Any) -> Any:
        ways: list[Any] = [] if self._answer is None else self._answer.get("ways", [])
        response.success = bool(ways)
        response.message = "\n".join(way["why"] for way in ways) or "nothing has been decided yet"
        return response

    def _explore(self, request: Any, response: Any) -> Any:
        if request.data:
            self._explorer.start()
        else:
            self._explorer.stop()
        response.success, response.message = True, "exploring" if request.data else "stopped"
        return response

    def _look_around(self) -> None:
        if self.active and self._explorer.next_step(self._belief.place) == "ask":
            self._goal = None
            success, message = self._ask()
            if not success:
                self._explorer.answered(None)
                self._node.get_logger().info(message, throttle_duration_sec=5.0)

    def _ask(self) -> tuple[bool, str]:
        """Begin to answer a question; whatever was being answered ends."""
        if not self.active:
            return False, "expected an active node; activate it first"
        try:
            situation = self._belief.situation()
            question = self._question()
        except TopobeliefError as error:
            return False, str(error)
        for problem in self._belief.problems:
            self._node.get_logger().warning(f"a message is ignored: {problem}")
        self._asked += 1
        threading.Thread(target=self._think, args=(self._asked, situation, question), daemon=True).start()
        return True, "thinking; the answer comes on ~/decision"

    def _question(self) -> Question:
        trip = self._goal is None
        return Question.read(
            {
                "goal": None if self._goal is None else list(self._goal),
                "return": bool(self._value("return_to_start")),
                "max_length": float(self._value("max_length")) if trip else None,
                "objective": self._value("objective"),
                "closures": self._value("closures"),
            }
        )

    def _think(self, number: int, situation: Situation, question: Question) -> None:
        """Answer a question in a thread of its own; better answers replace the first."""
        answer: dict[str, Any] = {}

        def publish(found: Mapping[str, object]) -> None:
            answer.update(found)
            if "ways" in found and number == self._asked:
                self._publish(question, answer, final=False)

        try:
            if self._answerer is None or self._answerer[0] != situation.number or self._moved(situation):
                earlier = None if self._answerer is None else self._answerer[1]
                self._answerer = situation.number, self._make_answers(situation, earlier)
            self._answerer[1](question, publish, lambda: number != self._asked)
        except TopobeliefError as error:
            answer = {"error": str(error)}
        if number == self._asked:
            self._publish(question, answer, final=True)

    def _moved(self, situation: Situation) -> bool:
        start = getattr(self._answerer and self._answerer[1], "start", None)
        return start is None or bool((start.place != situation.start.place).any())

    def _publish(self, question: Question, answer: Mapping[str, Any], *, final: bool) -> None:
        """Publish an answer; the last one also ends the trip's question."""
        self._answer = answer
        enough = question.goal is None and "ways" in answer and answer["most_to_gain"] <= self._value("enough")
        document = {**question.document(), **{key: answer[key] for key in answer if key not in ("ways", "progress")}}
        document |= {"final": final, "enough": enough, "exploring": self._explorer.active and not enough}
        stamp = self._node.get_clock().now().to_msg()
        if "ways" in answer:
            document["ways"] = [
                {key: way[key] for key in way if key not in ("files", "links", "path")} for way in answer["ways"]
            ]
            best = answer["ways"][answer["best"]]
            others = sorted((way for way in answer["ways"] if way is not best), key=lambda way: way["rank"])
            others = others[: int(self._value("alternatives"))]
            self._send("~/path", self._messages.path(best["poses"], stamp))
            for place, way in enumerate(others):
                self._send(f"~/alternatives/a{place}", self._messages.path(way["poses"], stamp))
            self._send("~/candidates", self._messages.candidates(answer, stamp))
            if final and self._value("drive") and not enough and len(best["poses"]) > 1:
                self._send("goal_pose", self._messages.pose(best["poses"][-1], stamp))
            if final:
                end = best["poses"][-1]
                self._explorer.answered((end[0], end[1]))
        elif final:
            self._explorer.answered(None)
        if enough and final:
            self._explorer.stop()
        self._send("~/decision", self._messages.text(json.dumps(without_nan(document), allow_nan=False)))

    def _send(self, topic: str, message: Any) -> None:
        if topic not in self._publishers:
            self._publishers[topic] = self._node.create_publisher(type(message), topic, _latched())
        self._publishers[topic].publish(message)


def _latched() -> Any:
    """Kept for whoever subscribes later, as maps are."""
    qos = load_ros("rclpy.qos")
    return qos.QoSProfile(depth=1, durability=qos.DurabilityPolicy.TRANSIENT_LOCAL)
