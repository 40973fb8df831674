"""The public door: a version, and descriptions short enough to read in a session."""

from __future__ import annotations

import math
import subprocess
import sys
from importlib.metadata import version

import numpy as np
import pytest

import topobelief as tb
from topobelief.candidates.propose import Candidates, Routes

OMEGA = np.diag([100.0, 100.0, 400.0])
GRAPH = tb.PoseGraph([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [(0, 1), (1, 2)], None, OMEGA)
SOLID = tb.PoseGraph([[0, 0, 0, 0, 0, 0, 1]], np.zeros((0, 2), int), None, np.eye(6))
REVISIT = tb.Action([[1, 1, 0]], [(2, 3), (3, 0)], OMEGA, label="path 7", cost=0.25)
AHEAD = tb.Action([[3, 0, 0], [4, 0, 0]], [(2, 3), (3, 4)], OMEGA)
ROOM = tb.World.from_boxes([(4, 4, 6, 6)], bounds=(0, 0, 10, 10))
ROADMAP = tb.build_roadmap(ROOM, (1, 1), (9, 9), num_vertices=20)
PATHS = [np.array([(0, 0), (3, 4)], float), np.array([(0, 0), (6, 8)], float)]


def test_the_version_is_that_of_the_package():
    assert tb.__version__ == version("topobelief")


def test_importing_the_package_reads_no_metadata_and_draws_nothing():
    code = (
        "import sys, topobelief; "
        "print([m for m in ('numpy', 'importlib.metadata', 'matplotlib', 'topobelief.version') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (GRAPH, "PoseGraph(SE(2), 3 poses, 2 edges)"),
        (SOLID, "PoseGraph(SE(3), 1 pose, 0 edges)"),
        (GRAPH.topology, "Topology(3 nodes, 2 edges)"),
        (REVISIT, "Action('path 7', 1 new pose, 2 edges, cost 0.25)"),
        (AHEAD, "Action(2 new poses, 2 edges)"),
        (ROOM, "World(10.0 × 10.0 m, 96.0 m² free)"),
        (tb.Bounds(-12.3456, 7.0), "Bounds(-12.35 to 7.00 nats)"),
        (tb.ReadingOptions(), "ReadingOptions()"),
        (tb.ReadingOptions(drop="planes", planar=True), "ReadingOptions(drop=['planes'], planar=True)"),
        (
            tb.DecisionQuality(0.0, 0.0301, True, False, 0.9981, math.nan, 1.0),
            "DecisionQuality(error 0, gamma 0.0301, Spearman 0.998, Kendall nan, Pearson 1)",
        ),
        (
            tb.Planner(GRAPH, objective="map"),
            "Planner(PoseGraph(SE(2), 3 poses, 2 edges), objective 'map', signature 'spanning_trees', bounds 'fischer')",
        ),
        (Routes(ROADMAP, PATHS), "Routes(2 paths, 5.0 to 10.0 m)"),
        (Candidates(Routes(ROADMAP, PATHS[:1]), [AHEAD]), "Candidates(1 path, 5.0 m)"),
        (
            ROADMAP,
            f"Roadmap({len(ROADMAP.vertices)} vertices, {len(ROADMAP.edges)} edges, robot radius 0.35 m)",
        ),
    ],
    ids=lambda value: type(value).__name__,
)
def test_values_describe_themselves_in_one_short_line(value, text):
    assert repr(value) == text
