"""Bags: recordings of ROS topics, in ROS 1's format (.bag) or ROS 2's (SQLite, MCAP, or a folder of them), read without ROS.

Messages are decoded by the definitions that rosbags brings along, which are those of the ROS releases. Definitions in a bag are
not used: code would be made of them, and no bag should bring code.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

from topobelief.errors import FileError
from topobelief.io import decompression
from topobelief.io.files import StrPath, read_head
from topobelief.optional import load
from topobelief.wording import counted

ODOMETRY, PATH, MARKERS, GRID = (
    "nav_msgs/msg/Odometry",
    "nav_msgs/msg/Path",
    "visualization_msgs/msg/MarkerArray",
    "nav_msgs/msg/OccupancyGrid",
)
_ROS_1, _FOLDER, _MCAP, _SQLITE = ".bag", "dir", ".mcap", ".db3"  # the last three as rosbags names them
_RELEASES = ("ROS2_HUMBLE", "ROS2_FOXY")  # a MarkerArray of ROS 2 is one or the other, the rest never changed
_MOST_LISTED = 8  # topics in a message


@dataclass(frozen=True, slots=True)
class Recording:
    """Messages of one topic of a bag, decoded, in the order of their recording: all that were asked for.

    Parameters
    ----------
    topic, kind
        Its name, and the type of its messages.
    messages
        As rosbags decodes them; of odometry the poses alone, geometry_msgs/Pose.
    count
        How many messages the topic has.
    """

    topic: str
    kind: str
    messages: tuple[Any, ...]
    count: int


def is_bag(path: StrPath) -> bool:
    """Whether this is a bag: a file by its content, a folder by its metadata.yaml."""
    return _format(path) is not None


def read_topics(path: StrPath, kinds: Collection[str], wanted: Collection[str], *, option: str) -> list[Recording]:
    """The messages of the topics that are asked for: all of odometry, else the last one, which replaces those before it.

    Parameters
    ----------
    path
    kinds
        The types of messages to look for.
    wanted
        Names of topics of one type. None given: the only topic of these types.
    option
        How to name a topic, for messages.

    Raises
    ------
    InvalidInputError
        If rosbags is not installed.
    FileError
        If the bag is damaged, decompresses to far more than its size, has no such topic, or has several and none is named.
    """
    reader = _reader(path)
    files = [file for file in Path(path).iterdir() if file.is_file()] if Path(path).is_dir() else [Path(path)]
    with decompression.limited(path, sum(file.stat().st_size for file in files)):
        try:
            for file in files:
                if file.suffix == ".zstd":  # which the reader unpacks into the system's folder of temporary files
                    decompression.check_file(file)
            with ExitStack() as stack:
                reader.open()
                stack.callback(reader.close)
                return _read(path, reader, _chosen(path, _topics(reader), kinds, wanted, option))
        except FileError:
            raise
        except Exception as error:  # rosbags has errors of its own, but raises any kind on damaged files
            _refuse_damage(path, error)


def _topics(reader: Any) -> dict[str, tuple[str, int]]:
    """The type of each topic, and how many messages it has."""
    topics: dict[str, tuple[str, int]] = {}
    for connection in reader.connections:
        kind, count = topics.get(connection.topic, (connection.msgtype, 0))
        topics[connection.topic] = kind, count + connection.msgcount
    return topics


def _read(path: StrPath, reader: Any, names: list[str]) -> list[Recording]:
    """The messages of these topics."""
    found: list[Recording] = []
    by_message = reader.metadata.compression_mode == "message" if _format(path) == _FOLDER else False
    if by_message:
        reader.metadata = reader.metadata._replace(compression_mode=None)  # messages are decompressed here
    for name in names:
        connections = [connection for connection in reader.connections if connection.topic == name]
        kind = connections[0].msgtype
        raw: deque[bytes] = deque(maxlen=None if kind == ODOMETRY else 1)
        count = 0
        for count, (_, _, data) in enumerate(reader.messages(connections), start=1):  # noqa: B007
            raw.append(decompression.decompressed(data) if by_message else data)
        if count == 0:
            raise FileError(path, f"expected messages on {_shown(name)}, got none")
        found.append(Recording(name, kind, _decoded(kind, raw, ros_1=_format(path) == _ROS_1), count))
    return found


def _format(path: StrPath) -> str | None:
    """By what rosbags reads it; None where it is no bag."""
    if Path(path).is_dir():
        return _FOLDER if (Path(path) / "metadata.yaml").is_file() else None
    head = read_head(path) if Path(path).is_file() else b""
    if head.startswith(b"#ROSBAG V"):
        return _ROS_1
    if head.startswith(b"\x89MCAP0\r\n"):
        return _MCAP
    return _SQLITE if head.startswith(b"SQLite format 3\0") and b"CREATE TABLE topics" in head else None


def _reader(path: StrPath) -> Any:
    """What opens, lists and reads a bag of this format."""
    kind = _format(path)
    if kind == _ROS_1:
        return load("rosbags.rosbag1", "ros").Reader(Path(path))
    return load("rosbags.rosbag2", "ros").Reader.STORAGE_PLUGINS[kind](Path(path))


def _chosen(
    path: StrPath, topics: dict[str, tuple[str, int]], kinds: Collection[str], wanted: Collection[str], option: str
) -> list[str]:
    """Names of the topics to read."""
    fitting = [name for name, (kind, count) in topics.items() if kind in kinds and count]
    listed = ", ".join(f"{_shown(name)} ({topics[name][0].rpartition('/')[2]})" for name in sorted(fitting)[:_MOST_LISTED])
    more = f" and {len(fitting) - _MOST_LISTED} more" if len(fitting) > _MOST_LISTED else ""
    if not fitting:
        types = " or ".join(sorted(kind.rpartition("/")[2] for kind in kinds))
        raise FileError(path, f"expected a topic with messages of type {types}, got none among {counted(len(topics), 'topic')}")
    if not wanted:
        if len(fitting) > 1:
            raise FileError(path, f"expected one topic, got {listed}{more}; choose one with {option}")
        return fitting
    unknown = next((name for name in wanted if name not in fitting), None)
    if unknown is not None:
        raise FileError(path, f"expected a topic among {listed}{more}, got {_shown(unknown)}")
    chosen = list(dict.fromkeys(wanted))
    if len(chosen) > 1 and any(topics[name][0] != MARKERS for name in chosen):
        raise FileError(
            path, f"expected one topic, or several of type MarkerArray, got {' and '.join(map(_shown, chosen[:2]))}"
        )
    return chosen


def _shown(name: str) -> str:
    """A name that fits into one line."""
    short = name if len(name) <= 60 else f"{name[:60]}…"
    return short if short.isprintable() else repr(short)


def _decoded(kind: str, raw: Iterable[bytes], *, ros_1: bool) -> tuple[Any, ...]:
    """Messages by the first release whose definition fits them."""

    def kept(message: Any) -> Any:
        return message.pose.pose if kind == ODOMETRY else message

    if ros_1:
        store = _definitions("ROS1_NOETIC")
        return tuple(kept(store.deserialize_ros1(data, kind)) for data in raw)
    misfit: Exception = ValueError("no message")
    for release in _RELEASES:
        store = _definitions(release)
        try:
            return tuple(kept(store.deserialize_cdr(data, kind)) for data in raw)
        except Exception as error:  # also what a wrong definition makes of a sound message
            misfit = error
    raise misfit


@cache
def _definitions(release: str) -> Any:
    """The messages of a release, whose decoders are compiled when they are first used."""
    typesys = load("rosbags.typesys", "ros")
    return typesys.get_typestore(typesys.Stores[release])


def _refuse_damage(path: StrPath, error: Exception) -> NoReturn:
    reason = " ".join(str(error).split())[:200].rstrip(".") or type(error).__name__
    advice = "a recording that broke off can be mended with `ros2 bag reindex` or `rosbag reindex`"
    raise FileError(
        path, f"expected a bag that can be read, got a damaged one or one of another kind ({reason}); {advice}"
    ) from None
