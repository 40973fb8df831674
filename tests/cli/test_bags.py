"""Bags on the command line: a graph and a map to plan in, and the map written as a ROS map."""

from __future__ import annotations

import json

import numpy as np

from bag_files import Messages, write_bag
from door_files import LIST, SPHERE
from topobelief.io.ros_map import read_ros_map


def recording(folder):
    """A drive around a square of 6 m as slam_toolbox draws it, its map of 10 m, and a local costmap."""
    made = Messages()
    places = [(x, 0.0) for x in range(6)] + [(6.0, y) for y in range(6)]
    places += [(x, 6.0) for x in range(6, 0, -1)] + [(0.0, y) for y in range(6, 0, -1)]
    places += places[:6]
    pairs = [(k, k + 1) for k in range(len(places) - 1)] + [(k + 24, k) for k in range(6)]
    spots = [(x + 0.01 * (k >= 24), y) for k, (x, y) in enumerate(places)]  # a place that is seen again is another pose
    lines = made.marker("edges", 0, LIST, [spots[end] for pair in pairs for end in pair])
    bodies = [made.marker("poses", k, SPHERE, at=spot) for k, spot in enumerate(spots)]
    cells = np.zeros((20, 20))
    cells[6:14, 6:14], cells[:, 0] = 100, -1
    grid, local = made.grid(cells, 0.5, (-2, -2)), made.grid(np.zeros((2, 2)))
    topics = {"/graph": [made.markers(*bodies, lines)], "/map": [grid], "/local_costmap": [local]}
    return write_bag(folder, "ROS 2 MCAP", made, topics)


def test_plan_takes_graph_and_map_from_one_bag(topobelief, tmp_path):
    bag = str(recording(tmp_path))
    outcome = topobelief(["info", bag, "--map", bag])
    assert (outcome.code, outcome.err.count("\n")) == (2, 1)
    assert "got /local_costmap (OccupancyGrid), /map (OccupancyGrid); choose one with --map-topic NAME" in outcome.err
    arguments = ["--map", bag, "--map-topic", "/map", "--goal", "0", "5", "--vertices", "100", "--seconds", "0.3"]
    outcome = topobelief(["plan", bag, *arguments, "--json"])
    assert outcome.code == 0, outcome.err
    notes = json.loads(outcome.out)["notes"]
    assert any("read the last of 1 message of '/graph' (visualization_msgs/MarkerArray)" in note for note in notes)


def test_convert_writes_the_map_of_a_bag(topobelief, tmp_path):
    bag = str(recording(tmp_path))
    outcome = topobelief(["convert", bag, "map.yaml", "--topic", "/map", "--json"])
    assert outcome.code == 0, outcome.err
    document = json.loads(outcome.out)
    assert (document["columns"], document["rows"], document["resolution"], document["origin"]) == (20, 20, 0.5, [-2, -2, 0])
    np.testing.assert_allclose(read_ros_map("map.yaml").free.area, (20 * 19 - 64) * 0.25)
    outcome = topobelief(["convert", bag, "map.yaml"])
    assert (outcome.code, outcome.err.count("\n")) == (2, 1)
    (tmp_path / "poses.tum").write_text("0 0 0 0 0 0 0 1\n")
    outcome = topobelief(["convert", "poses.tum", "map.yaml"])
    assert (outcome.code, outcome.err.count("\n")) == (2, 1)
    assert "expected a bag to take a map from" in outcome.err
