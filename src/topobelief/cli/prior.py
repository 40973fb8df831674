"""The pose graph that a command is about: read, checked to be in one piece, and optimised unless told not to."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from topobelief.cli.console import Reporter
from topobelief.errors import DisconnectedGraphError, FileError
from topobelief.estimation import optimize
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.formats import read_pose_graph


@dataclass(frozen=True, eq=False)
class Prior:
    """A graph at the poses of its file, and at those to work with."""

    filed: PoseGraph
    graph: PoseGraph


def read_prior(path: Path, reporter: Reporter, *, optimized: bool) -> Prior:
    """Read a pose graph and, if wanted, move it to its maximum-likelihood estimate.

    Raises
    ------
    FileError
        If the file is wrong, or its graph is not connected: names some of the poses that the first one does not reach.
    EstimationError
        If no estimate is found.
    """
    try:
        with reporter.stage("reading"):
            filed = read_pose_graph(path)
        filed.topology.require_connected(names=filed.ids)
    except DisconnectedGraphError as error:
        raise FileError(path, str(error)) from None
    if not optimized:
        return Prior(filed, filed)
    with reporter.stage("optimising"):
        return Prior(filed, optimize(filed))
