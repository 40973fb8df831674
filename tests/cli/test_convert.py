"""`convert` writes what it reads, in the format that the suffix names, or leaves nothing."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from topobelief.io.formats import read_pose_graph

TUM = "".join(f"{k} {k} 0 0 0 0 0 1\n" for k in range(5))
SPATIAL = "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n"


def test_formats_with_edges_keep_every_bit(topobelief, office, tmp_path):
    assert topobelief(["convert", str(office.graph_file), "office.graph"]).out == "office.graph: SE(2), 21 poses, 24 edges.\n"
    assert topobelief(["convert", "office.graph", "office.g2o"]).code == 0
    assert (tmp_path / "office.g2o").read_bytes() == office.graph_file.read_bytes()


def test_poses_alone_are_said_to_be_alone(topobelief, office, tmp_path):
    outcome = topobelief(["convert", str(office.graph_file), "office.tum", "--json"])
    document = json.loads(outcome.out)
    assert document["notes"] == ["office.tum: holds the poses alone; edges, their information and ids are not written"]
    assert (document["num_poses"], document["num_edges"]) == (21, 24)
    rows = np.loadtxt(tmp_path / "office.tum")
    np.testing.assert_array_equal(rows[:, 1:3], office.graph.poses[:, :2])


def test_a_trajectory_becomes_a_graph_with_the_noise_in_metres_and_degrees(topobelief, tmp_path):
    Path("poses.tum").write_text(TUM)
    outcome = topobelief(["convert", "poses.tum", "graph.g2o", "--noise", "0.1", "3", "--spacing", "2", "--planar"])
    assert outcome.code == 0
    assert "took 3 of 5 poses of a trajectory" in outcome.out
    graph = read_pose_graph("graph.g2o")
    assert graph.poses[:, 0].tolist() == [0, 2, 4]
    np.testing.assert_allclose(np.diag(graph.information[0]), [100, 100, math.radians(3) ** -2])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["graph.g2o", "out.db"],
            "out.db: expected a graph that ends in .g2o, .graph or .toro (TORO), or .tum (poses alone), got .db",
        ),
        (["graph.g2o", "out"], "got no suffix"),
        (["graph.g2o", "out.toro"], "expected a graph in SE(2) for a TORO file, got one in SE(3); write g2o"),
        (["none.g2o", "out.g2o"], "none.g2o: expected a file to read, got nothing of that name"),
        (["poses.tum", "out.g2o"], "poses.tum: expected a noise for the odometry of a trajectory"),
        (["poses.tum", "out.g2o", "--noise", "0", "1"], "expected a standard deviation from 1e-06 to 1e+06 m, got 0.0"),
        (["poses.tum", "out.g2o", "--noise", "1"], "'--noise' requires 2 arguments"),
        (["poses.tum", "out.g2o", "--noise", "1", "1", "--closure-radius", "-1"], "expected a number above 0, got -1"),
        (["poses.tum", "missing/out.g2o", "--noise", "1", "1"], "missing/out.g2o: expected a file to write, got a folder"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(topobelief, tmp_path, arguments, message):
    Path("graph.g2o").write_text(SPATIAL)
    Path("poses.tum").write_text(TUM)
    outcome = topobelief(["convert", *arguments])
    assert outcome.code == 2
    assert message in outcome.err
    assert outcome.err.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["graph.g2o", "poses.tum"]


def test_an_old_file_stays_where_a_conversion_fails(topobelief, tmp_path):
    Path("graph.g2o").write_text(SPATIAL)
    Path("out.toro").write_text("what was there")
    assert topobelief(["convert", "graph.g2o", "out.toro"]).code == 2
    assert Path("out.toro").read_text() == "what was there"
