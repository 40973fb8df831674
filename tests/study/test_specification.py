"""What a study's YAML means, and that each mistake is named with its file, line and field."""

from __future__ import annotations

import re

import numpy as np
import pytest

from topobelief.candidates.closures import ClosureModel
from topobelief.errors import FileError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.g2o import write_g2o
from topobelief.study.specification import read_specification


def test_all_that_is_said_is_read(specification_file):
    found = read_specification(specification_file)
    assert list(found.worlds) == ["room"]
    assert found.worlds["room"].bounds == (0, 0, 12, 12)
    (across, in_all), (back, in_named) = found.sessions
    assert (across.name, across.goals, across.num_paths, in_all) == ("across", ((11.0, 11.0),), (4,), ("room",))
    assert (back.goals, back.num_paths, in_named) == (((11.0, 11.0), (1.0, 8.0)), (3, 5), ("room",))
    assert back.graph.poses.tolist() == [[1, 1, 0.5]]
    assert [noise.sigma_theta for noise in found.noises] == [0.01, 0.085]  # 1e-2, which YAML 1.1 takes for a text
    assert found.noises[1].xi == pytest.approx(0.85)
    assert np.diag(found.noises[1].information) == pytest.approx([100, 100, 0.085**-2])
    assert (found.strategies, found.objectives, found.seeds) == (("spanning_trees", "random"), ("joint",), (0, 1, 2))
    rule = found.rule.candidates
    assert (rule.max_detour, rule.line_of_sight, rule.num_vertices) == (None, False, 120)
    assert rule.closures == ClosureModel.paper()  # the radius, which is not said, is the paper's too
    assert rule.turn is None


def test_closures_may_be_learned_and_poses_stand_at_turns(specification_file):
    text = specification_file.read_text().replace("closure_angle: 1.0, min_index_gap: 2", "closures: learned, turn: 0.3")
    specification_file.write_text(text)
    rule = read_specification(specification_file).rule
    assert (rule.candidates.closures, rule.candidates.turn) == (None, 0.3)
    assert rule.content["closures"] == "learned"


def test_a_session_may_begin_with_a_recorded_graph(specification_file):
    graph = PoseGraph([[1, 1, 0], [2.2, 1, 0], [3, 1, 0]], [(0, 1), (1, 2)], [[1, 0, 0], [1, 0, 0]], np.eye(3))
    write_g2o(graph, specification_file.with_name("drive.g2o"))
    text = specification_file.read_text().replace("start: [1, 1], goals", "graph: drive.g2o, goals")
    specification_file.write_text(text)
    session, _ = read_specification(specification_file).sessions[0]
    assert session.graph.poses == pytest.approx(np.array([[1, 1, 0], [2, 1, 0], [3, 1, 0]]))  # at its estimate


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("seeds: 3", "sedes: 3", 10, "sedes: expected 'seeds', got the unknown key 'sedes'"),
        ("seeds: 3", "seeds: -3", 10, "seeds: expected a whole number of at least 1, got '-3'"),
        ("seeds: 3", "seeds: [1, 2, 1]", 10, "seeds[2]: expected entries that differ, got one that stood before"),
        ("seeds: 3\n", "", 1, "expected the key 'seeds', got none"),
        ("seeds: 3", "seeds: 3\nseeds: 4", 11, "seeds: expected each key once, got 'seeds' twice"),
        ("[spanning_trees, random]", "[spanning_tree]", 8, "strategies[0]: expected one of spanning_trees, von_neumann"),
        ("[joint]", "[]", 9, "objectives: expected a list, got a list of 0"),
        ("[joint]", "[entropy]", 9, "objectives[0]: expected one of joint, map, per_pose, error, got 'entropy'"),
        ("1e-2", "0", 6, "noises[0].sigma_theta: expected a number above 0, got '0'"),
        ("1e-2", "tiny", 6, "noises[0].sigma_theta: expected a number above 0, got 'tiny'"),
        ("1e-2", ".nan", 6, "noises[0].sigma_theta: expected a number above 0"),
        ("sigma_theta: 1e-2", "xi: 0.1", 6, "noises[0].xi: expected one of sigma_p, sigma_theta, got the unknown key 'xi'"),
        ("[1, 1, 0.5]", "[1]", 4, "sessions.back.start: expected a start [x, y] or [x, y, theta], got a list of 1"),
        ("start: [1, 1], goals", "goals", 3, "sessions.across: expected one of the keys 'start' and 'graph', got none"),
        ("start: [1, 1], goals", "graph: no.g2o, goals", 3, "sessions.across.graph: expected the path of a pose graph"),
        ("[[11, 11], [1, 8]]", "[11, 11]", 4, "sessions.back.goals[0]: expected a goal [x, y], got '11'"),
        ("[3, 5]", "[3]", 4, "sessions.back.candidates: expected one number, or one for each of the 2 goals"),
        ("worlds: [room]", "worlds: [roof]", 4, "sessions.back.worlds[0]: expected one of room, got 'roof'"),
        ("room: room.csv", "room: attic.csv", 1, "worlds.room: expected the path of a map"),
        ("max_detour: none", "max_detour: 0.9", 11, "rule.max_detour: expected a number of at least 1, got '0.9'"),
        ("closure_angle: 1.0", "closure_angle: 4", 11, "rule.closure_angle: expected a number above 0 and of at most 3.14159"),
        ("rule: {", "rule: {closures: learned, ", 11, "rule.closures: expected 'by hand' where closure_angle"),
        ("rule: {", "rule: {closures: lerned, ", 11, "rule.closures: expected one of learned, by hand, got 'lerned'"),
        ("line_of_sight: false", "line_of_sight: maybe", 11, "rule.line_of_sight: expected true or false, got 'maybe'"),
        ("rule: {", "rule: {radius: 2, ", 11, "rule.radius: expected 'robot_radius', got the unknown key 'radius'"),
        ("[joint]\nseeds: 3\nrule: {", "[error]\nseeds: 3\nrule: {bounds: paper, ", 11, "rule.bounds: expected one of fischer"),
        ("rule: {", "rule: {{", 12, "expected YAML, got other text (while parsing a flow mapping expected "),
    ],
)  # fmt: skip
def test_mistakes_are_named_with_their_place(specification_file, old, new, line, message):
    text = specification_file.read_text()
    assert old in text
    specification_file.write_text(text.replace(old, new, 1))
    with pytest.raises(FileError) as raised:
        read_specification(specification_file)
    assert str(raised.value).startswith(f"{specification_file}:{line}: {message}")


def test_a_file_of_comments_is_no_study(specification_file):
    specification_file.write_text("# nothing yet\n")
    with pytest.raises(FileError, match="expected YAML, got comments alone"):
        read_specification(specification_file)


def test_a_graph_in_space_is_refused(specification_file):
    graph = PoseGraph([[0, 0, 0, 0, 0, 0, 1], [1, 0, 0, 0, 0, 0, 1]], [(0, 1)], None, np.eye(6))
    write_g2o(graph, specification_file.with_name("flight.g2o"))
    specification_file.write_text(specification_file.read_text().replace("start: [1, 1], goals", "graph: flight.g2o, goals"))
    with pytest.raises(FileError, match=r"flight\.g2o: expected a graph in SE\(2\)"):
        read_specification(specification_file)


@pytest.mark.parametrize("family", ["paper", "fischer_step"])
def test_bounds_that_an_objective_does_not_have_are_refused(specification_file, family):
    text = specification_file.read_text().replace("[joint]", "[joint, error]").replace("rule: {", f"rule: {{bounds: {family}, ")
    specification_file.write_text(text)
    message = f"study.yaml:11: rule.bounds: expected one of fischer, anchored, chain, auto, got '{family}'"
    with pytest.raises(FileError, match=re.escape(message)):
        read_specification(specification_file)
