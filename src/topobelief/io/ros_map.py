"""Maps in the format of ROS map_server: a YAML file that names an image, what a pixel is, and where it lies.

With p = (255 - value) / 255, or value / 255 where `negate` is set, a pixel is (docs of map_server, `mode`)
    trinary  occupied where p > occupied_thresh, free where p < free_thresh, unknown between the two
    scale    the same, but of growing occupancy between the two, here taken as occupied from half-way on
    raw      its value as occupancy in percent, here taken as occupied from 50 on; unknown above 100
A pixel that is not opaque is unknown in trinary and scale. The origin is the pose of the lower left corner of the
lower left pixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast

import numpy as np
import yaml
from numpy.typing import ArrayLike
from PIL import Image

from topobelief.arrays import BoolArray, FloatArray
from topobelief.errors import FileError, InvalidInputError, InvalidMapError
from topobelief.io.files import StrPath, atomic_file, read_text, write_text
from topobelief.world import World

Unknown = Literal["occupied", "free"]

_MODES = ("trinary", "scale", "raw")
_OCCUPIED_COLOUR, _UNKNOWN_COLOUR, _FREE_COLOUR = 0, 205, 254  # of map_saver


def read_ros_map(path: StrPath, *, unknown: Unknown = "occupied") -> World:
    """The world that a map_server YAML file and its image describe.

    Parameters
    ----------
    path
        The YAML file; a relative image path is taken from its folder.
    unknown
        What cells that nobody has seen are taken for.

    Raises
    ------
    FileError
        Names the file, and the key or the line to blame.
    """
    if unknown not in ("occupied", "free"):
        raise InvalidInputError(f'expected unknown cells to be "occupied" or "free", got {unknown!r}')
    header = _read_header(path)
    colour, opaque = _read_image(path, header.image)
    free = _free_cells(header, colour, opaque, unknown_is_free=unknown == "free")
    try:
        return World.from_cells(free[::-1], header.resolution, header.origin)  # images start at the top
    except InvalidMapError as error:
        raise FileError(path, str(error)) from None


def write_ros_map(
    path: StrPath, occupancy: ArrayLike, *, resolution: float, origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> None:
    """Write an occupancy grid as map_saver does: a YAML file, and a PGM image of the same name beside it.

    Parameters
    ----------
    path
        The YAML file.
    occupancy : shape (rows, columns)
        0 free, 100 occupied, -1 unknown, as in nav_msgs/OccupancyGrid; row 0 is the lowest in y.
    resolution
        Side of a cell, metres.
    origin : (x, y, yaw)
        Pose of the lower left corner of cell (0, 0).

    Raises
    ------
    InvalidInputError
        For another shape, other values, or a resolution that is not positive.
    FileError
        Where a file cannot be written.
    """
    cells = np.asarray(occupancy)
    if cells.ndim != 2 or cells.size == 0 or not np.isin(cells, (-1, 0, 100)).all():
        raise InvalidInputError(f"expected cells of -1, 0 and 100, shape (rows, columns), got {cells.dtype} of {cells.shape}")
    if not (math.isfinite(resolution) and resolution > 0):
        raise InvalidInputError(f"expected a resolution above 0 m, got {resolution}")
    colour = np.select([cells == 100, cells == 0], [_OCCUPIED_COLOUR, _FREE_COLOUR], _UNKNOWN_COLOUR).astype(np.uint8)
    image = Path(path).with_suffix(".pgm")
    with atomic_file(image) as temporary:
        Image.fromarray(colour[::-1]).save(temporary)  # images start at the top
    header: dict[str, object] = {
        "image": image.name,
        "mode": "trinary",
        "resolution": float(resolution),
        "origin": [float(number) for number in origin],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    write_text(path, yaml.safe_dump(header, sort_keys=False))


@dataclass(frozen=True, slots=True)
class _Header:
    image: Path
    resolution: float  # metres a pixel
    origin: tuple[float, float, float]  # x, y, yaw
    negate: bool
    occupied_thresh: float
    free_thresh: float
    mode: str


def _read_header(path: StrPath) -> _Header:
    try:
        content: object = yaml.safe_load(read_text(path))
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        reason = getattr(error, "problem", None) or "unreadable characters"
        raise FileError(path, f"expected YAML, got {reason}", line=mark.line + 1 if mark else None) from None
    if not isinstance(content, dict):
        raise FileError(path, f"expected a YAML mapping with the keys of a ROS map, got {type(content).__name__}")
    fields = _Fields(path, cast("dict[object, object]", content))
    mode = fields.get("mode") if fields.has("mode") else "trinary"
    if mode not in _MODES:
        raise FileError(path, f"expected mode to be one of {', '.join(_MODES)}, got {mode!r}")
    resolution, free_thresh, occupied_thresh = (fields.number(key) for key in ("resolution", "free_thresh", "occupied_thresh"))
    if not resolution > 0:
        raise FileError(path, f"expected a resolution above 0 metres a pixel, got {resolution:g}")
    if not 0 <= free_thresh <= occupied_thresh <= 1:
        raise FileError(
            path,
            f"expected thresholds with 0 <= free_thresh <= occupied_thresh <= 1, got {free_thresh:g} and {occupied_thresh:g}",
        )
    negate = fields.get("negate")
    if negate not in (0, 1):
        raise FileError(path, f"expected negate to be 0 or 1, got {negate!r}")
    image = fields.get("image")
    if not isinstance(image, str) or not image:
        raise FileError(path, f"expected image to be a file name, got {image!r}")
    return _Header(
        image=Path(path).parent / image,
        resolution=resolution,
        origin=fields.pose("origin"),
        negate=bool(negate),
        occupied_thresh=occupied_thresh,
        free_thresh=free_thresh,
        mode=str(mode),
    )


@dataclass(frozen=True, slots=True)
class _Fields:
    """Values of a YAML mapping, checked one by one."""

    path: StrPath
    values: dict[object, object]

    def has(self, key: str) -> bool:
        return key in self.values

    def get(self, key: str) -> object:
        if not self.has(key):
            raise FileError(self.path, f"expected the key {key!r} of a ROS map, got none")
        return self.values[key]

    def number(self, key: str) -> float:
        return self._number(key, self.get(key))

    def pose(self, key: str) -> tuple[float, float, float]:
        value = self.get(key)
        if not isinstance(value, list) or len(cast("list[object]", value)) != 3:
            raise FileError(self.path, f"expected {key} to be [x, y, yaw], got {value!r}")
        x, y, yaw = (self._number(key, number) for number in cast("list[object]", value))
        return x, y, yaw

    def _number(self, key: str, value: object) -> float:
        if isinstance(value, int | float | str) and not isinstance(value, bool):  # YAML 1.1 reads 5e-2 as text
            try:
                number = float(value)
            except ValueError:
                number = math.nan
            if math.isfinite(number):
                return number
        raise FileError(self.path, f"expected a finite number for {key}, got {value!r}")


def _read_image(path: StrPath, image_path: Path) -> tuple[FloatArray, BoolArray]:
    """Mean colour of each pixel from 0 to 255, and whether it is opaque; shape (rows, columns), top row first."""
    try:
        with Image.open(image_path) as image:
            image.load()
            if image.mode.startswith("I"):  # 16 bits, in which Pillow keeps the largest value of a PGM at 65535
                return np.asarray(image, dtype=np.float64) * (255 / 65535), np.ones(image.size[::-1], dtype=np.bool_)
            pixels = np.asarray(image.convert("RGBA"))
    except FileNotFoundError:
        raise FileError(path, f"expected image to name a file, got {image_path}, which does not exist") from None
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise FileError(image_path, f"expected an image that can be read, got {error}") from None
    return pixels[..., :3].sum(axis=-1, dtype=np.uint16) / 3, np.asarray(pixels[..., 3] == 255)


def _free_cells(header: _Header, colour: FloatArray, opaque: BoolArray, *, unknown_is_free: bool) -> BoolArray:
    """Which pixels a robot may be in, shape (rows, columns)."""
    if header.mode == "raw":
        occupied, unknown = colour >= 50, colour > 100
    else:
        p = colour / 255 if header.negate else (255 - colour) / 255
        if header.mode == "trinary":
            occupied = p > header.occupied_thresh
            unknown = ~opaque | (~occupied & ~(p < header.free_thresh))
        else:
            occupied = p > (header.free_thresh + header.occupied_thresh) / 2
            unknown = ~opaque
    return np.where(unknown, unknown_is_free, ~occupied)
