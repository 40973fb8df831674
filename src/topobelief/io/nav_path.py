"""Paths as messages of ROS, nav_msgs/Path, in YAML as `ros2 topic echo` prints it, or in JSON, which is YAML too."""

from __future__ import annotations

import json
from typing import Any

import yaml

from topobelief.arrays import FloatArray
from topobelief.geometry.planar import upright_poses
from topobelief.io.filed_path import FiledPath, path_of_quaternions
from topobelief.io.files import StrPath
from topobelief.io.yaml_fields import Field, read_documents

_EXPECTED = "a nav_msgs/Path with its list of poses"


def read_nav_path(path: StrPath) -> FiledPath:
    """Read one nav_msgs/Path; stamps and the frame do not matter.

    Raises
    ------
    FileError
        Names the line and the field that is not what it should be; of a message that was printed in short, how to print
        it whole.
    """
    documents = read_documents(path)
    if len(documents) > 1:
        documents[1].refuse("one message", f"{len(documents)}; keep one, as `ros2 topic echo --once` prints it")
    rows: list[list[float]] = []
    lines: list[int] = []
    for item in _child(documents[0], "poses", _EXPECTED).items(expected="a list of at least one pose"):
        if not item.is_mapping() and not item.is_list() and item.text() == "...":
            item.refuse("all poses", "a list that is cut short; print it with `ros2 topic echo --full-length`")
        pose = _child(item, "pose", "a pose with its header")
        position, orientation = (_child(pose, name, f"the field {name}") for name in ("position", "orientation"))
        parts = ((position, "xyz"), (orientation, "xyzw"))
        rows.append([_child(part, name, f"the field {name}").number() for part, names in parts for name in names])
        lines.append(item.line)
    return path_of_quaternions(path, rows, lines)


def _child(field: Field, name: str, expected: str) -> Field:
    """A field of a message, whatever other fields it has."""
    found = field.entries(expected=expected)
    if name not in found:
        field.refuse(expected, f"no field {name!r} in it")
    return found[name]


def yaml_of_path(poses: FloatArray) -> str:
    """The text of a YAML file of poses of shape (N, 3), at height 0, or (N, 7), as `ros2 topic echo` prints it; frame "map"."""
    return yaml.safe_dump(_message(poses), sort_keys=False)


def json_of_path(poses: FloatArray) -> str:
    """As `yaml_of_path`, in JSON."""
    return json.dumps(_message(poses), indent=2) + "\n"


def _message(poses: FloatArray) -> dict[str, Any]:
    def header() -> dict[str, Any]:
        return {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "map"}

    rows: list[list[float]] = (poses if poses.shape[1] == 7 else upright_poses(poses)).tolist()
    return {
        "header": header(),
        "poses": [
            {
                "header": header(),
                "pose": {
                    "position": dict(zip("xyz", row[:3], strict=True)),
                    "orientation": dict(zip("xyzw", row[3:], strict=True)),
                },
            }
            for row in rows
        ],
    }
