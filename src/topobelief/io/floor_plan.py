"""Floor plans in files: walls as boxes in CSV, and any kind of map by its suffix.

A CSV plan has the header `x_min,y_min,x_max,y_max`, then one wall per line, in metres. A line that begins with # is a
comment; one of the form `# bounds: x_min y_min x_max y_max` says what the plan shows and where its fence stands. Without
it the plan ends where its walls end.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from topobelief.errors import FileError, InvalidMapError
from topobelief.io.bag_maps import read_bag_map
from topobelief.io.bags import is_bag
from topobelief.io.files import StrPath, read_text
from topobelief.io.map_3d import is_map_3d
from topobelief.io.ros_map import Unknown, read_ros_map
from topobelief.io.transforms import FARTHEST
from topobelief.world import World

_HEADER = ["x_min", "y_min", "x_max", "y_max"]
_BOUNDS = re.compile(r"#\s*bounds\s*:(.*)")
_EXPECTED = "four numbers x_min, y_min, x_max, y_max within 1e9 m with min < max"


def read_world(path: StrPath, *, unknown: Unknown = "occupied", topic: str | None = None) -> World:
    """A world by the suffix of its file: .yaml or .yml a ROS map, .csv walls; or the last occupancy grid in a bag.

    Parameters
    ----------
    path
    unknown
        What the unknown cells of a ROS map or of an occupancy grid are taken for.
    topic
        Of a bag, where more than one topic has occupancy grids.

    Raises
    ------
    FileError
        For any other suffix, and where the file is not what it should be.
    """
    if is_bag(path):
        return read_bag_map(path, unknown=unknown, topic=topic)
    suffix = Path(path).suffix.lower()
    if suffix in (".yaml", ".yml"):
        return read_ros_map(path, unknown=unknown)
    if suffix == ".csv":
        return read_walls(path)
    if is_map_3d(path):
        raise FileError(path, f"expected a floor plan, .yaml, .yml (ROS map) or .csv (walls), got {suffix}, a map in 3D")
    hint = "; name the YAML file that belongs to the image" if suffix in (".pgm", ".png", ".bmp", ".jpg", ".tif") else ""
    raise FileError(
        path, f"expected a map that ends in .yaml, .yml (ROS map) or .csv (walls), or a bag, got {suffix or 'no suffix'}{hint}"
    )


def read_walls(path: StrPath, *, bounds: Sequence[float] | None = None) -> World:
    """The world of a floor plan in CSV.

    Parameters
    ----------
    path
    bounds : (x_min, y_min, x_max, y_max), optional
        Metres; in place of those in the file.

    Raises
    ------
    FileError
        Names the file and the line.
    """
    boxes: list[list[float]] = []
    bounds_in_file: list[float] | None = None
    has_header = False
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        text = line.strip()
        if match := _BOUNDS.fullmatch(text):
            if bounds_in_file is not None:
                raise FileError(path, "expected bounds once, got a second line of them; remove one", line=number)
            bounds_in_file = _extent(path, number, match[1].replace(",", " ").split(), "bounds")
        elif not text or text.startswith("#"):
            continue
        elif not has_header:
            if [name.strip() for name in text.split(",")] != _HEADER:
                raise FileError(path, f"expected the header {','.join(_HEADER)}, got {text[:60]!r}", line=number)
            has_header = True
        else:
            boxes.append(_extent(path, number, text.split(","), "a wall"))
    if not has_header:
        raise FileError(path, f"expected the header {','.join(_HEADER)}, got no line but comments")
    try:
        return World.from_boxes(boxes, bounds_in_file if bounds is None else bounds)
    except InvalidMapError as error:
        raise FileError(path, str(error)) from None


def _extent(path: StrPath, line: int, fields: list[str], what: str) -> list[float]:
    try:
        numbers = [float(field) for field in fields]
    except ValueError:
        numbers = []
    if (
        len(numbers) == 4
        and all(abs(number) <= FARTHEST for number in numbers)
        and numbers[0] < numbers[2]
        and numbers[1] < numbers[3]
    ):
        return numbers
    raise FileError(path, f"expected {what} as {_EXPECTED}, got {' '.join(fields)[:60]!r}", line=line)
