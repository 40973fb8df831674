"""A small office to plan in, as files; and the program, run as a shell would run it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from topobelief.cli.app import run
from topobelief.geometry import SE2_GROUP
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.g2o import write_g2o

WALLS = """x_min,y_min,x_max,y_max
-1,-1,11,-0.8
-1,10.8,11,11
-1,-1,-0.8,11
10.8,-1,11,11
3,3,7,7
"""


@dataclass(frozen=True)
class Office:
    """A room of 12 m with a pillar, and a drive halfway around it that ends at (10, 10)."""

    graph_file: Path
    map_file: Path
    graph: PoseGraph

    def plan(self, *options: object) -> list[str]:
        """Arguments that plan from (10, 10) back to (0, 5), on a roadmap that is soon built."""
        files = [str(self.graph_file), "--map", str(self.map_file)]
        return ["plan", *files, "--goal", "0", "5", "--vertices", "200", *map(str, options)]


@dataclass(frozen=True)
class Outcome:
    """What a shell sees."""

    code: int
    out: str
    err: str


@pytest.fixture(scope="session")
def office(tmp_path_factory) -> Office:
    folder = tmp_path_factory.mktemp("office")
    corners = [(x, 0) for x in range(11)] + [(10, y) for y in range(1, 11)]
    headings = [0.0] * 11 + [np.pi / 2] * 10
    poses = np.column_stack([corners, headings])
    chain = [(i, i + 1) for i in range(20)]
    edges = np.array([*chain, (0, 2), (4, 6), (9, 12), (14, 16)])
    noise = np.random.default_rng(4).normal(size=(len(edges), 3)) * [0.05, 0.05, 0.02]
    measured = SE2_GROUP.compose(SE2_GROUP.between(poses[edges[:, 0]], poses[edges[:, 1]]), noise)
    graph = PoseGraph(poses, edges, measured, np.diag([400.0, 400.0, 2500.0]))
    write_g2o(graph, folder / "office.g2o")
    (folder / "office.csv").write_text(WALLS)
    return Office(folder / "office.g2o", folder / "office.csv", graph)


@pytest.fixture
def topobelief(capsys, tmp_path, monkeypatch) -> Callable[[list[str]], Outcome]:
    """Run the program in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(arguments: list[str]) -> Outcome:
        code = run(arguments)
        captured = capsys.readouterr()
        return Outcome(code, captured.out, captured.err)

    return call
