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
import struct
import warnings
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Literal

import numpy as np
import yaml
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageFile, UnidentifiedImageError

from topobelief.arrays import BoolArray, FloatArray
from topobelief.errors import FileError, InvalidInputError, InvalidMapError, MapWarning, require_positive
from topobelief.io.files import EXPANSION, StrPath, atomic_file
from topobelief.io.yaml_fields import Field, read_fields
from topobelief.world import World

Unknown = Literal["occupied", "free"]

_KEYS = ("image", "mode", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_MODES = ("trinary", "scale", "raw")
_OCCUPIED_COLOUR, _UNKNOWN_COLOUR, _FREE_COLOUR = 0, 205, 254  # of map_saver

_DAMAGE = (ArithmeticError, EOFError, LookupError, NotImplementedError, SyntaxError, TypeError, ValueError, struct.error)
"""What Pillow's decoders raise on damaged images, besides OSError."""

MAX_PIXELS = 150_000_000  # some 1.2 GB and 8 s
_ALWAYS_PIXELS = 30_000_000  # that an image may have however few bytes it was compressed to
SMALLEST_RESOLUTION, LARGEST_RESOLUTION = 1e-6, 1e6  # metres a pixel
_COARSE = 2.0  # metres a pixel, above which millimetres are more likely
MAX_CELLS_AWAY = 1e9  # from the origin of the world, at which coordinates still resolve a millionth of a cell


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

    Warns
    -----
    MapWarning
        Where the grey of unknown cells counts as free, and where a pixel is so large that millimetres must be meant.
    """
    if unknown not in ("occupied", "free"):
        raise InvalidInputError(f'expected unknown cells to be "occupied" or "free", got {unknown!r}')
    header = _read_header(path)
    image = _read_image(path, header.image)
    free = _free_cells(header, image, unknown_is_free=unknown == "free")
    for problem in _doubts(header, image, free, unknown_is_free=unknown == "free"):
        warnings.warn(f"{path}: {problem}", MapWarning, stacklevel=2)
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
        The YAML file, which ends in .yaml or .yml.
    occupancy : shape (rows, columns)
        0 free, 100 occupied, -1 unknown, as in nav_msgs/OccupancyGrid; row 0 is the lowest in y.
    resolution
        Side of a cell, metres.
    origin : (x, y, yaw)
        Pose of the lower left corner of cell (0, 0).

    Raises
    ------
    InvalidInputError
        For another shape, other values, a resolution that is not positive, an origin that is not finite, or another suffix.
    FileError
        Where a file cannot be written.
    """
    cells = np.asarray(occupancy)
    if cells.ndim != 2 or cells.size == 0 or not np.isin(cells, (-1, 0, 100)).all():
        raise InvalidInputError(f"expected cells of -1, 0 and 100, shape (rows, columns), got {cells.dtype} of {cells.shape}")
    require_positive("a resolution", resolution, unit="m")
    if len(origin) != 3 or not all(map(math.isfinite, origin)):
        raise InvalidInputError(f"expected a finite origin (x, y, yaw), got {origin}")
    if Path(path).suffix.lower() not in (".yaml", ".yml"):
        raise InvalidInputError(f"expected a file that ends in .yaml or .yml, got {Path(path).name!r}")
    colour = np.select([cells == 100, cells == 0], [_OCCUPIED_COLOUR, _FREE_COLOUR], _UNKNOWN_COLOUR).astype(np.uint8)
    image = Path(path).with_suffix(".pgm")
    header: dict[str, object] = {
        "image": image.name,
        "mode": "trinary",
        "resolution": float(resolution),
        "origin": [float(number) for number in origin],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    with atomic_file(path) as temporary_header, atomic_file(image) as temporary_image:  # both files or none
        Image.fromarray(colour[::-1]).save(temporary_image)  # images start at the top
        temporary_header.write_text(yaml.safe_dump(header, sort_keys=False), encoding="utf-8", newline="\n")


@dataclass(frozen=True, slots=True)
class _Header:
    image: Path
    resolution: float  # metres a pixel
    origin: tuple[float, float, float]  # x, y, yaw
    negate: bool
    occupied_thresh: float
    free_thresh: float
    mode: str


@dataclass(frozen=True, slots=True)
class _Image:
    """Pixels as levels, of which there are few enough for a table; rows from the top."""

    levels: NDArray[np.uint8] | NDArray[np.uint16]  # (rows, columns)
    colours: FloatArray  # mean colour of each level, from 0 to 255
    opaque: BoolArray | None  # (rows, columns); None: everywhere


def _read_header(path: StrPath) -> _Header:
    top = read_fields(path)
    fields = top.entries(expected="a YAML mapping with the keys of a ROS map")

    def required(key: str) -> Field:
        if key not in fields:
            close = get_close_matches(key, fields.keys() - set(_KEYS), n=1)
            top.refuse(f"the key {key!r} of a ROS map", f"{close[0]!r}" if close else "none")
        return fields[key]

    resolution, free_thresh, occupied_thresh = map(required, ("resolution", "free_thresh", "occupied_thresh"))
    metres = resolution.number(above=0)
    if not SMALLEST_RESOLUTION <= metres <= LARGEST_RESOLUTION:
        resolution.refuse(f"{SMALLEST_RESOLUTION:g} to {LARGEST_RESOLUTION:g} metres a pixel")
    free_below, occupied_above = (threshold.number(at_least=0, at_most=1) for threshold in (free_thresh, occupied_thresh))
    if free_below > occupied_above:
        free_thresh.refuse(f"a threshold of at most occupied_thresh, which is {occupied_above:g}")
    negate = required("negate").text(expected="0 or 1").lower()
    if negate not in ("0", "1", "false", "true"):
        required("negate").refuse("0 or 1")
    return _Header(
        image=Path(path).parent / required("image").text(expected="a file name"),
        resolution=metres,
        origin=_origin(required("origin"), metres),
        negate=negate in ("1", "true"),
        occupied_thresh=occupied_above,
        free_thresh=free_below,
        mode=fields["mode"].choice(_MODES) if "mode" in fields else "trinary",
    )


def _origin(field: Field, resolution: float) -> tuple[float, float, float]:
    x, y, yaw = field.numbers(3, expected="[x, y, yaw]")
    if max(abs(x), abs(y)) > MAX_CELLS_AWAY * resolution:
        field.refuse(f"an origin within {MAX_CELLS_AWAY:g} cells of (0, 0)", f"({x:g}, {y:g}) with cells of {resolution:g} m")
    if abs(yaw) > 2 * math.pi:
        field.refuse("a yaw in radians, from -2 pi to 2 pi", f"{yaw:g}; if it is in degrees, write {math.radians(yaw):.7g}")
    return x, y, yaw


def _read_image(path: StrPath, image_path: Path) -> _Image:
    try:
        _require_file(path, image_path)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's, of sizes below our own limit and of metadata
            with Image.open(image_path) as image:
                _require_pixels_of_maps(image, image_path)
                image.load()
                return _levels(image)
    except UnidentifiedImageError:
        raise FileError(image_path, f"expected a PGM, PNG or other image, got {_kind_of_file(image_path)}") from None
    except Image.DecompressionBombError:
        raise _too_large(image_path, "more than Pillow opens") from None
    except OSError as error:
        raise FileError(image_path, f"expected an image that can be read, got {error.strerror or error}") from None
    except _DAMAGE as error:
        raise FileError(image_path, f"expected an image that can be read, got {error}") from None


def _require_file(path: StrPath, image_path: Path) -> None:
    """Refuse an image that is no file, and name the one of that name beside the map where there is one."""
    if image_path.is_file():
        return
    found = "is a directory" if image_path.is_dir() else "is no file" if image_path.exists() else "does not exist"
    beside = Path(path).parent / image_path.name.rsplit("\\")[-1]  # where Windows wrote the path, too
    hint = f"; {beside.name} lies beside the map: write image: {beside.name}" if beside.is_file() else ""
    raise FileError(path, f"expected image to name a file, got {image_path}, which {found}{hint}")


def _require_pixels_of_maps(image: Image.Image, path: Path) -> None:
    """Refuse, before anything is decoded, what is too large, shifted or not of 8 or 16 bits a channel."""
    width, height = image.size
    if width * height > MAX_PIXELS:
        raise _too_large(path, f"{width} x {height}")
    size = path.stat().st_size
    if width * height > max(_ALWAYS_PIXELS, EXPANSION * size):
        raise FileError(
            path,
            f"expected an image of at most {_ALWAYS_PIXELS / 1e6:g} million pixels, or {EXPANSION} for each byte, got "
            f"{width} x {height} in {size} bytes; crop the map, or save it as a PGM, which is not compressed",
        )
    if image.mode == "F" or (image.mode == "I" and image.format not in ("PNG", "PPM")):  # there Pillow's I is 16 bits
        kind = "floating-point numbers" if image.mode == "F" else "signed or 32-bit integers"
        raise FileError(
            path, f"expected pixels of 8 or 16 bits, got {image.format} with {kind}; save the map as an 8-bit PGM or PNG"
        )
    if image.format == "PPM" and _has_crlf(image, path):
        raise FileError(
            path,
            "expected pixels right after one line feed, got a carriage return too: line ends have been converted, which "
            "shifts all pixels; copy the image again as binary (in git, mark *.pgm as binary)",
        )


def _has_crlf(image: Image.Image, path: Path) -> bool:
    """Whether the header of a binary PGM ends in CR LF, of which Pillow takes the LF for the first pixel."""
    if not isinstance(image, ImageFile.ImageFile) or image.tile[0][0] == "ppm_plain":
        return False
    with path.open("rb") as file:
        file.seek(image.tile[0][2] - 1)  # where the pixels begin
        return file.read(2) == b"\r\n"


def _too_large(path: Path, got: str) -> FileError:
    return FileError(
        path,
        f"expected an image of at most {MAX_PIXELS / 1e6:g} million pixels, got {got}; crop the map, or save it with "
        "larger cells (half the width and height, twice the resolution)",
    )


def _kind_of_file(path: Path) -> str:
    with path.open("rb") as file:
        first = file.read(64)
    if not first:
        return "an empty file"
    if first.startswith(b"version https://git-lfs"):
        return "a Git LFS pointer; fetch the image with `git lfs pull`"
    return "a file of another kind, or one without pixels"


def _levels(image: Image.Image) -> _Image:
    if image.mode.startswith("I"):  # 16 bits, in which Pillow keeps the largest value of a PGM at 65535
        return _Image(np.asarray(image).astype(np.uint16), np.linspace(0, 255, 65536), None)
    if image.mode in ("1", "L") and "transparency" not in image.info:
        return _Image(np.asarray(image.convert("L")), np.arange(256.0), None)
    pixels = np.asarray(image.convert("RGBA"))
    return _Image(pixels[..., :3].sum(axis=-1, dtype=np.uint16), np.arange(3 * 255 + 1) / 3, pixels[..., 3] == 255)


def _free_cells(header: _Header, image: _Image, *, unknown_is_free: bool) -> BoolArray:
    """Which pixels a robot may be in, shape (rows, columns)."""
    colours = image.colours
    unknown_level = np.zeros(len(colours), dtype=np.bool_)
    if header.mode == "raw":
        occupied, unknown_level = colours >= 50, colours > 100
    else:
        p = colours / 255 if header.negate else (255 - colours) / 255
        if header.mode == "trinary":
            occupied = p > header.occupied_thresh
            unknown_level = ~occupied & ~(p < header.free_thresh)
        else:
            occupied = p > (header.free_thresh + header.occupied_thresh) / 2
    free = np.where(unknown_level, unknown_is_free, ~occupied)[image.levels]
    if image.opaque is not None and header.mode != "raw":
        free[~image.opaque] = unknown_is_free
    return free


def _doubts(header: _Header, image: _Image, free: BoolArray, *, unknown_is_free: bool) -> list[str]:
    """What of a map is likely to mean something else than it says."""
    doubts: list[str] = []
    if header.resolution > _COARSE:
        width = header.resolution * free.shape[1]
        doubts.append(
            f"resolution is {header.resolution:g} metres a pixel, so the map is {width:g} m wide; "
            f"if millimetres are meant, write {header.resolution / 1000:g}"
        )
    if header.mode == "trinary" and not header.negate and not unknown_is_free:
        (unknown_levels,) = np.nonzero(np.abs(image.colours - _UNKNOWN_COLOUR) < 0.5)
        count = np.count_nonzero(free & np.isin(image.levels, unknown_levels))
        if count:
            doubts.append(
                f"free_thresh {header.free_thresh:g} makes the grey 205 free, with which map_saver marks unknown cells "
                f"({100 * count / free.size:.2g} % of the map); to keep them unknown, write free_thresh: 0.196"
            )
    return doubts
