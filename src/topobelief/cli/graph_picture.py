"""The picture of `topobelief info`."""

from __future__ import annotations

from pathlib import Path

from topobelief.cli.console import Reporter
from topobelief.errors import FileError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.files import atomic_file
from topobelief.world import World

_SUFFIXES = (".png", ".pdf", ".svg")


def check_picture_file(file: Path | None) -> None:
    """Refuse a picture that cannot be written, before any work is done for it.

    Raises
    ------
    FileError
        For another suffix or a missing folder.
    """
    if file is None:
        return
    if file.suffix.lower() not in _SUFFIXES:
        raise FileError(file, f"expected a picture that ends in .png, .pdf or .svg, got {file.suffix or 'no suffix'}")
    if not file.absolute().parent.is_dir():
        raise FileError(file, "expected a file to write, got a folder that does not exist; make it, or choose another file")


def write(file: Path, graph: PoseGraph, name: str, world: World | None, reporter: Reporter) -> None:
    """Draw a graph, with the world beneath where there is one.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    with reporter.stage("picture"), atomic_file(file) as temporary:
        from topobelief.report.canvas import save_figure
        from topobelief.report.graph_figure import draw_graph_figure

        save_figure(draw_graph_figure(graph, name, world=world), temporary)
