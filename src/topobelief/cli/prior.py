"""The pose graph that a command is about: read, checked to be in one piece, and optimised unless told not to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from topobelief.cli.console import Reporter
from topobelief.errors import DisconnectedGraphError, FileError
from topobelief.estimation import optimize
from topobelief.graph.components import components
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.formats import read_graph_file
from topobelief.io.reading import ReadingOptions

_AS_FILED = ReadingOptions()


@dataclass(frozen=True, eq=False)
class Prior:
    """A graph at the poses of its file, and at those to work with."""

    filed: PoseGraph
    graph: PoseGraph


def read_filed(path: Path, reporter: Reporter, *, reading: ReadingOptions = _AS_FILED) -> PoseGraph:
    """Read a pose graph, in one piece or in several, and tell what was dropped or assumed.

    Raises
    ------
    FileError
        If the file is wrong, or poses without vertex lines hang on none that has one.
    """
    try:
        with reporter.stage("reading"):
            graph, notes = read_graph_file(path, reading)
    except DisconnectedGraphError as error:
        raise FileError(path, f"{error}, with --component largest") from None
    for note in notes:
        reporter.note(f"{path}: {note}")
    return graph


def read_prior(
    path: Path,
    reporter: Reporter,
    *,
    optimized: bool,
    reading: ReadingOptions = _AS_FILED,
    accepted: Callable[[PoseGraph], PoseGraph] | None = None,
) -> Prior:
    """Read a pose graph and, if wanted, move it to its maximum-likelihood estimate.

    What `accepted` makes of the connected graph takes its place before that; it may refuse it.

    Raises
    ------
    FileError
        If the file is wrong, or its graph is not connected: names some of the poses that the first one does not reach, and the
        option that keeps the largest component.
    EstimationError
        If no estimate is found.
    """
    filed = read_filed(path, reporter, reading=reading)
    try:
        filed.topology.require_connected(names=filed.ids)
    except DisconnectedGraphError as error:
        largest = f"--component largest ({components(filed)[0].num_poses} of {filed.num_poses} poses)"
        raise FileError(path, f"{error}, with {largest} or --component ID") from None
    return estimated(filed if accepted is None else accepted(filed), reporter, optimized=optimized)


def estimated(filed: PoseGraph, reporter: Reporter, *, optimized: bool) -> Prior:
    """A connected graph at the poses of its file and, if wanted, at its maximum-likelihood estimate."""
    if not optimized:
        return Prior(filed, filed)
    with reporter.stage("optimising"):
        return Prior(filed, optimize(filed))
