"""Archives of Boost serialization, in which slam_toolbox saves its graph (.posegraph): named, and not read.

Their layout follows the classes of the program that wrote them and changes with its versions, so that no other program reads
them safely. slam_toolbox itself can load one and publish the graph.
"""

from __future__ import annotations

from typing import NoReturn

from topobelief.errors import FileError
from topobelief.io.files import StrPath
from topobelief.io.reading import ReadingOptions


def is_boost_archive(head: bytes) -> bool:
    """Whether a file begins as text or binary archives do."""
    return b"serialization::archive" in head[:64]


def refuse_boost_archive(path: StrPath, options: ReadingOptions) -> NoReturn:
    """Say how to get the graph out of slam_toolbox instead."""
    del options
    raise FileError(
        path,
        "expected a pose graph, got an archive of slam_toolbox (.posegraph), which only the version that wrote it can read; "
        "let slam_toolbox load it (service /slam_toolbox/deserialize_map), record what it publishes with "
        "`ros2 topic echo --once --full-length /slam_toolbox/graph_visualization > graph.yaml`, and read graph.yaml",
    )
