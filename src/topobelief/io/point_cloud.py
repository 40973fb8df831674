"""Point clouds in files: PLY, and PCD of the Point Cloud Library; of both what is written most, ASCII and uncompressed binary.

Only the coordinates x, y and z are read. Files are checked against the size that their header states before anything of
that size is made.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import FileError
from topobelief.io.files import StrPath, read_bytes

_LONGEST_HEADER = 65536  # bytes
_PLY_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
_PLY_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_PCD_KEYS = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")


def read_point_cloud(path: StrPath) -> FloatArray:
    """The points of a PLY or PCD file, by its suffix.

    Returns
    -------
    shape (N, 3)
        Metres as filed; nan where a lidar had no return.

    Raises
    ------
    FileError
        Where the file is not what it should be, or its points are compressed.
    """
    content = read_bytes(path)
    return _read_pcd(path, content) if Path(path).suffix.lower() == ".pcd" else _read_ply(path, content)


def _read_ply(path: StrPath, content: bytes) -> FloatArray:
    if not content.startswith(b"ply"):
        raise FileError(path, "expected a PLY file, which begins with the line ply, got another file")
    end = content.find(b"end_header", 0, _LONGEST_HEADER)
    if end < 0:
        raise FileError(path, "expected a header that ends with the line end_header, got none")
    body = content.find(b"\n", end) + 1
    order: str | None = None
    names: list[str] = []
    types: list[str] = []
    count, in_vertex, seen_vertex = 0, False, False
    for number, line in enumerate(content[:end].decode("ascii", errors="replace").splitlines(), start=1):
        words = line.split()
        if words[:1] == ["format"]:
            if len(words) != 3 or words[1] not in _PLY_ORDERS:
                raise FileError(path, f"expected the format {' or '.join(_PLY_ORDERS)}, got {line[:60]!r}", line=number)
            order = _PLY_ORDERS[words[1]]
        elif words[:1] == ["element"]:
            in_vertex = words[1:2] == ["vertex"]
            if in_vertex:
                count, seen_vertex = _count(path, number, words[2:]), True
            elif not seen_vertex:
                raise FileError(path, f"expected the element vertex first, got {line[:60]!r}", line=number)
        elif words[:1] == ["property"] and in_vertex:
            if len(words) != 3 or words[1] not in _PLY_TYPES:
                raise FileError(path, f"expected a property of a vertex as TYPE NAME, got {line[:60]!r}", line=number)
            types.append(_PLY_TYPES[words[1]])
            names.append(words[2])
    if order is None or not seen_vertex:
        raise FileError(path, "expected a header with a format and the element vertex, got one without; write the file anew")
    if not order:
        return _ascii(path, content[body:], names, count)
    return _binary(path, content[body:], names, [order + each for each in types], [1] * len(types), count)


def _read_pcd(path: StrPath, content: bytes) -> FloatArray:
    header: dict[str, list[str]] = {}
    lines: dict[str, int] = {}
    body = number = 0
    while "DATA" not in header:
        end = content.find(b"\n", body, _LONGEST_HEADER)
        if end < 0:
            raise FileError(path, "expected a PCD header that ends with the line DATA, got none")
        number += 1
        words = content[body:end].decode("ascii", errors="replace").split()
        body = end + 1
        if not words or words[0].startswith("#"):
            continue
        if words[0] not in _PCD_KEYS:
            raise FileError(path, f"expected a PCD header with {', '.join(_PCD_KEYS)}, got {words[0][:40]!r}", line=number)
        header[words[0]], lines[words[0]] = words[1:], number
    names = header.get("FIELDS", [])
    sizes, types = header.get("SIZE", []), header.get("TYPE", [])
    counts = [_count(path, lines.get("COUNT", 1), [word]) for word in header.get("COUNT", ["1"] * len(names))]
    if not names or len({len(names), len(sizes), len(types), len(counts)}) != 1:
        raise FileError(path, "expected FIELDS, SIZE, TYPE and COUNT of the same length, got others")
    if "POINTS" in header:
        count = _count(path, lines["POINTS"], header["POINTS"])
    else:
        count = 1
        for key in ("WIDTH", "HEIGHT"):
            count *= _count(path, lines.get(key, 1), header.get(key, []))
    kinds: list[str] = []
    for size, kind in zip(sizes, types, strict=True):
        letter = {"F": "f", "I": "i", "U": "u"}.get(kind, "")
        if not letter or size not in (("4", "8") if letter == "f" else ("1", "2", "4", "8")):
            raise FileError(path, f"expected TYPE F, I or U with its SIZE in bytes, got {kind[:8]} and {size[:8]}")
        kinds.append(f"<{letter}{size}")
    data = header["DATA"][0] if header["DATA"] else ""
    if data == "ascii":
        if any(each != 1 for each in counts):
            names = [
                f"{name} {k}" if k else name for name, each in zip(names, counts, strict=True) for k in range(min(each, 4096))
            ]
        return _ascii(path, content[body:], names, count)
    if data == "binary":
        return _binary(path, content[body:], names, kinds, counts, count)
    advice = "; write it anew with `pcl_convert_pcd_ascii_binary IN OUT 1`" if data == "binary_compressed" else ""
    raise FileError(path, f"expected DATA ascii or binary, got {data[:40] or 'nothing'}{advice}", line=lines["DATA"])


def _count(path: StrPath, line: int, words: Sequence[str]) -> int:
    """A whole number of at least 0."""
    if len(words) == 1 and words[0].isdecimal() and words[0].isascii() and len(words[0]) < 16:
        return int(words[0])
    raise FileError(path, f"expected a number of points or values, got {' '.join(words)[:40]!r}", line=line)


def _columns(path: StrPath, names: Sequence[str]) -> list[int]:
    """Where x, y and z are."""
    if missing := [axis for axis in "xyz" if axis not in names]:
        raise FileError(path, f"expected points with x, y and z, got none with {missing[0]}: {' '.join(names)[:60]}")
    return [list(names).index(axis) for axis in "xyz"]


def _ascii(path: StrPath, body: bytes, names: Sequence[str], count: int) -> FloatArray:
    """The coordinates of `count` lines of numbers."""
    columns = _columns(path, names)
    if 2 * count > len(body) + 1:  # a digit and a blank for each point are not enough, but this will do
        raise FileError(path, f"expected {count} points, got a file that ends before; it was cut short")
    rows: list[list[float]] = []
    for number, line in enumerate(body.decode("ascii", errors="replace").splitlines(), start=1):
        if len(rows) == count:
            break
        words = line.split()
        if not words:
            continue
        try:
            if len(words) < len(names):
                raise ValueError
            rows.append([float(words[column]) for column in columns])
        except ValueError:
            expected = f"expected the numbers {' '.join(names)[:60]} for point {number}"
            raise FileError(path, f"{expected}, got {line[:60]!r}") from None
    if len(rows) < count:
        raise FileError(path, f"expected {count} points, got {len(rows)}; the file was cut short")
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def _binary(
    path: StrPath, body: bytes, names: Sequence[str], types: Sequence[str], counts: Sequence[int], count: int
) -> FloatArray:
    """The coordinates of `count` records."""
    columns = _columns(path, names)
    sizes = [np.dtype(kind).itemsize * number for kind, number in zip(types, counts, strict=True)]
    size, starts = sum(sizes), np.concatenate([[0], np.cumsum(sizes)])
    if size * count > len(body):
        raise FileError(path, f"expected {count} points of {size} bytes, got {len(body)} bytes; the file was cut short")
    if any(counts[column] != 1 for column in columns):
        raise FileError(path, "expected one number each for x, y and z, got others")
    record = np.dtype(
        {"names": list("xyz"), "formats": [types[k] for k in columns], "offsets": starts[columns].tolist(), "itemsize": size}
    )
    points = np.frombuffer(body, dtype=record, count=count)
    with np.errstate(invalid="ignore"):  # of signalling nan
        return np.column_stack([points[axis].astype(np.float64) for axis in "xyz"]).reshape(-1, 3)
