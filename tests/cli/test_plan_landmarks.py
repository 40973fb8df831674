"""`topobelief plan` on graphs with landmarks: how they are observed, and how observations are counted."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.g2o import write_g2o


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    """A drive of 20 m along x and back, past a tree every 5 m, each seen from up to 5 m."""
    x = np.concatenate([np.arange(21.0), np.arange(19.0, -1, -1)])
    poses = np.column_stack([x, np.where(np.arange(41) > 20, 1.0, 0.0), np.where(np.arange(41) > 20, np.pi, 0)])
    trees = np.array([[5.0 * number, 4.0, 0.0] for number in range(5)])
    seen = [(pose, 41 + tree) for pose in range(41) for tree in range(5) if np.linalg.norm(poses[pose] - trees[tree]) < 5]
    edges = [(index, index + 1) for index in range(40)] + seen
    kinds = ["pose"] * 41 + ["landmark"] * 5
    graph = PoseGraph(np.concatenate([poses, trees]), edges, None, np.diag([400.0, 400.0, 3000.0]), kinds)
    path = tmp_path_factory.mktemp("street") / "street.g2o"
    write_g2o(graph, path)
    return path


def plan(street, *options):
    return ["plan", str(street), "--along-trajectory", "--goal", "15", "0.5", "--vertices", "100", *map(str, options)]


def test_observations_are_learned_and_counted_apart_from_closures(topobelief, street):
    shown = topobelief(plan(street, "--candidates", 2))
    assert shown.code == 0
    assert "landmarks: at most" in shown.out
    assert "in sight or not" in shown.out
    assert re.search(r"closures +observations +metres", shown.out)
    document = json.loads(topobelief(plan(street, "--candidates", 2, "--json")).out)
    first = document["actions"][0]
    assert first["num_observations"] > 0
    assert 0 < first["expected_observations"] <= first["num_observations"]
    assert first["expected_closures"] <= first["num_closures"] <= 2 * first["num_new_poses"]
    assert re.search(r"way +closures +observations +after it", topobelief(plan(street, "--max-evaluations", 20)).out)


def test_what_options_state_is_not_learned(topobelief, street):
    rule = ["--observation-range", 4.1, "--field-of-view", 6.28, "--observation-cap", 3, "--observation-chance", 0.5]
    shown = topobelief(plan(street, "--candidates", 1, *rule)).out
    assert "landmarks: at most 3 a pose within 4.1 m, 360° ahead, in sight or not, 50 % of opportunities" in " ".join(
        shown.split()
    )
    blind = json.loads(topobelief(plan(street, "--candidates", 1, "--observation-range", 0.1, "--json")).out)
    assert blind["actions"][0]["num_observations"] == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--observation-range", 0], "expected a number above 0, got 0"),
        (["--field-of-view", 90], "expected at most 6.28319, got 90; angles are in radians"),
        (["--observation-chance", 2], "expected a probability above 0 and at most 1, got 2"),
        (["--observation-cap", 0], "Input should be greater than or equal to 1"),
    ],
)
def test_numbers_out_of_range_are_refused(topobelief, street, options, message):
    outcome = topobelief(plan(street, *options))
    assert (outcome.code, outcome.err.count("\n")) == (2, 1)
    assert message in outcome.err


def test_a_graph_without_landmarks_has_none_to_observe(topobelief, office):
    outcome = topobelief(office.plan("--observation-range", 5))
    assert (outcome.code, outcome.err.count("\n")) == (2, 1)
    assert "expected landmarks in the graph with --observation-range, got none" in outcome.err
