"""Messages of ROS made from answers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

_TYPES = {
    "OccupancyGrid": "nav_msgs.msg",
    "Path": "nav_msgs.msg",
    "PoseStamped": "geometry_msgs.msg",
    "PoseWithCovarianceStamped": "geometry_msgs.msg",
    "Point": "geometry_msgs.msg",
    "Marker": "visualization_msgs.msg",
    "MarkerArray": "visualization_msgs.msg",
    "String": "std_msgs.msg",
    "ColorRGBA": "std_msgs.msg",
    "Trigger": "std_srvs.srv",
    "SetBool": "std_srvs.srv",
}
_COLOURS = {"best": (0.84, 0.37, 0.0, 1.0), "possible": (0.0, 0.45, 0.7, 0.9), "ruled-out": (0.55, 0.55, 0.55, 0.6)}
_SEEN = (0.0, 0.62, 0.45, 0.9)


class Messages:
    """Makes messages in a frame; its attributes are the types of ROS.

    Parameters
    ----------
    frame
        The frame of the map.
    """

    def __init__(self, frame: str) -> None:
        self._frame = frame

    def __getattr__(self, name: str) -> Any:
        if name not in _TYPES:
            raise AttributeError(name)
        return getattr(import_module(_TYPES[name]), name)

    def text(self, content: str) -> Any:
        """std_msgs/String."""
        return self.String(data=content)

    def pose(self, x_y_yaw: Sequence[float], stamp: Any) -> Any:
        """geometry_msgs/PoseStamped."""
        message = self.PoseStamped()
        message.header.frame_id, message.header.stamp = self._frame, stamp
        x, y, yaw = x_y_yaw
        message.pose.position.x, message.pose.position.y = float(x), float(y)
        message.pose.orientation.z, message.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        return message

    def path(self, poses: Sequence[Sequence[float]], stamp: Any) -> Any:
        """nav_msgs/Path of x, y and yaw, metres and radians."""
        message = self.Path()
        message.header.frame_id, message.header.stamp = self._frame, stamp
        message.poses = [self.pose(pose, stamp) for pose in poses]
        return message

    def without_covariance(self, message: Any) -> Any:
        """PoseStamped of a PoseWithCovarianceStamped."""
        return self.PoseStamped(header=message.header, pose=message.pose.pose)

    def candidates(self, answer: Mapping[str, Any], stamp: Any) -> Any:
        """All ways, coloured by what is known of them, what the best one closes loops with, and the certificate as text."""
        markers = [self._marker("", 0, 3, stamp)]  # 3: remove what was drawn before
        for number, way in enumerate(answer["ways"]):
            best = number == answer["best"]
            line = self._marker(
                "ways", number, 0, stamp, kind=4, width=0.08 if best else 0.03, colour=_COLOURS[way["standing"]]
            )
            line.points = [self._point(place, 0.05 if best else 0.0) for place in way["path"]]
            if len(line.points) > 1:
                markers.append(line)
        best = answer["ways"][answer["best"]]
        links = self._marker("closures", 0, 0, stamp, kind=5, width=0.02, colour=_SEEN)
        links.points = [self._point(end, 0.0) for x, y, u, v in best["links"] for end in ((x, y), (u, v))]
        if links.points:
            markers.append(links)
        text = self._marker("certificate", 0, 0, stamp, kind=9, width=0.3, colour=(1.0, 1.0, 1.0, 1.0))
        text.text = f"{answer['headline']}\n{answer['certificate']}"
        text.pose.position.x, text.pose.position.y = best["path"][0]
        text.pose.position.z = 0.5
        return self.MarkerArray(markers=[*markers, text])

    def _marker(
        self,
        namespace: str,
        number: int,
        action: int,
        stamp: Any,
        *,
        kind: int = 0,
        width: float = 0.0,
        colour: Sequence[float] = (0.0,) * 4,
    ) -> Any:
        marker = self.Marker(ns=namespace, id=number, type=kind, action=action)
        marker.header.frame_id, marker.header.stamp = self._frame, stamp
        marker.pose.orientation.w = 1.0
        marker.scale.x = marker.scale.y = marker.scale.z = width
        marker.color = self.ColorRGBA(**dict(zip("rgba", colour, strict=True)))
        return marker

    def _point(self, place: Sequence[float], height: float) -> Any:
        return self.Point(x=float(place[0]), y=float(place[1]), z=height)
