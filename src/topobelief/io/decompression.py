"""Limits of what compressed bags hold.

rosbags decompresses chunks and messages whole, without a limit. Its tables of decompressors get others here, which do as its
own do but keep to the limit of the bag that is being read; nothing changes for other users of rosbags in the same program.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from topobelief.errors import FileError
from topobelief.io.files import EXPANSION, StrPath
from topobelief.optional import load

_ALWAYS = 256_000_000  # bytes that any bag may hold: the largest map is smaller
_STEP = 16 << 20  # bytes that are decompressed at once
_left: ContextVar[list[int] | None] = ContextVar("left", default=None)  # bytes; nothing where no bag is being read


@contextmanager
def limited(path: StrPath, size: int) -> Generator[None]:
    """While a bag of so many bytes is read: what it decompresses to in all is limited, or the block raises.

    Raises
    ------
    FileError
        As soon as more was decompressed than 100 times the bag's size and 256 MB.
    """
    _limit_rosbags()
    most = max(_ALWAYS, EXPANSION * size)
    left = [most]
    token = _left.set(left)
    try:
        yield
    finally:
        _left.reset(token)
        if left[0] < 0:
            raise FileError(
                path,
                f"expected a bag that decompresses to at most {most / 1e6:.0f} MB ({EXPANSION} times its size, or "
                f"{_ALWAYS / 1e6:.0f} MB), got one that holds more; record the topics that are needed alone",
            ) from None


def decompressed(content: bytes) -> bytes:
    """Bytes of Zstandard, within the limit."""
    return _whole(_zstd().ZstdDecompressor, content)


def check_file(path: Path) -> None:
    """Decompress a file of Zstandard without keeping it, within the limit."""
    with _zstd().open(path, "rb") as file:
        while part := file.read(_STEP):
            _take(len(part))


def _limit_rosbags() -> None:
    lz4, bz2 = load("lz4.frame", "ros").LZ4FrameDecompressor, load("bz2", "ros").BZ2Decompressor
    ros_1, mcap = load("rosbags.rosbag1.reader", "ros").decompressors, load("rosbags.rosbag2.storage_mcap", "ros").DECOMPRESSORS
    ros_1.update(lz4=_limited(lz4), bz2=_limited(bz2))
    mcap.update(lz4=_limited(lz4), zstd=_limited(_zstd().ZstdDecompressor))


def _zstd() -> Any:
    """Python's module of that name, or what stands in for it."""
    return load("rosbags.rosbag2.reader", "ros").zstd


def _limited(make: Callable[[], Any]) -> Callable[..., bytes]:

    def decompress(content: bytes, _stated_size: int = 0) -> bytes:
        return _whole(make, content)

    return decompress


def _whole(make: Callable[[], Any], content: bytes) -> bytes:
    """All frames of some bytes, one after the other."""
    parts: list[bytes] = []
    while content:
        frame = make()
        while not frame.eof:
            parts.append(frame.decompress(content, max_length=_STEP))
            content = b""
            _take(len(parts[-1]))
            if frame.needs_input and not frame.eof:
                raise ValueError("compressed bytes end before they should")
        content = frame.unused_data or b""
    return b"".join(parts)


def _take(count: int) -> None:
    left = _left.get()
    if left is None:
        return
    left[0] -= count
    if left[0] < 0:
        raise ValueError("more than its size lets expect")
