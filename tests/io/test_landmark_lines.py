"""Landmarks in pose-graph files: g2o's lines, GTSAM's plain ones, and what they mean."""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np
import pytest

import topobelief as tb
from topobelief.errors import FileError, InvalidInputError, ReadingWarning
from topobelief.symbols import node_name

PLANE = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 1.5\nEDGE_SE2 0 1 1 0 1.5 1 0 0 1 0 1\n"
SPACE = (
    "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 1 0 0 0 0 0 1\n"
    "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1 " + " ".join(str(int(i == j)) for i in range(6) for j in range(i, 6)) + "\n"
)


@pytest.fixture
def filed(tmp_path):
    def write(text: str):
        path = tmp_path / "graph.g2o"
        path.write_text(text)
        return path

    return write


def test_g2o_lines_of_the_plane(filed):
    """Landmarks come after the poses, whatever their ids; one without a vertex is where it was seen first."""
    text = "VERTEX_XY 7 3 4\nEDGE_SE2_XY 1 7 1 2 4 1 9\n" + PLANE + "LANDMARK2 1 5 2 0 1 0 1\nFIX 7\n"
    graph = tb.read_g2o(filed(text))
    assert repr(graph) == "PoseGraph(SE(2), 2 poses, 2 landmarks, 3 edges)"
    assert graph.ids.tolist() == [0, 1, 5, 7]
    assert graph.edges.tolist() == [[0, 1], [1, 3], [1, 2]]
    assert graph.positions[3].tolist() == [3, 4]
    assert graph.positions[2] == pytest.approx([1 + 2 * math.cos(1.5), 2 * math.sin(1.5)])
    assert graph.information[1].tolist() == [[4, 1, 0], [1, 9, 0], [0, 0, 0]]
    assert graph.fixed == (3,)


def test_bearings_alone_place_a_landmark_that_has_a_line_of_its_own(filed, tmp_path):
    text = (
        PLANE + "VERTEX_XY 7 2.1 2.2\nEDGE_BEARING_SE2_XY 0 7 0.7853981633974483 400\nEDGE_BEARING_SE2_XY 1 7 -0.39269908 900\n"
    )
    graph = tb.read_g2o(filed(text))
    assert graph.readings.tolist() == ["pose", "bearing", "bearing"]
    assert graph.noise[1:, 0, 0].tolist() == [400, 900]
    found = tb.optimize(graph)
    assert found.chi2 < 1e-9
    x, y = found.positions[2]
    assert x == pytest.approx(y)
    assert math.atan2(y, x - 1) == pytest.approx(1.5 - 0.39269908)
    tb.write_g2o(found, tmp_path / "again.g2o")
    again = tb.read_g2o(tmp_path / "again.g2o")
    assert again.readings.tolist() == graph.readings.tolist()
    assert tb.joint_entropy(again) == pytest.approx(tb.joint_entropy(found), abs=1e-9)


def test_lines_of_gtsam_state_covariances_and_their_own_numbers(filed):
    """A covariance at 10 m is a bearing and a range; a pose and a landmark may have one number, then landmarks are symbols."""
    text = PLANE + "LANDMARK 0 1 3 4 0.4 0 0.4\nLANDMARK 1 1 1 0 0.5 0.1 0.4\nBR 0 2 0.5 2 0.1 0.2\n"
    graph = tb.read_g2o(filed(text))
    assert [node_name(name) for name in graph.ids.tolist()] == ["0", "1", "l1", "l2"]
    assert graph.readings.tolist() == ["pose", "bearing_range", "position", "bearing_range"]
    assert graph.noise[1, :2, :2] == pytest.approx(np.diag([1 / 0.04, 1 / 0.4]))
    assert graph.information[2, :2, :2] == pytest.approx(np.linalg.inv([[0.5, 0.1], [0.1, 0.4]]))
    assert graph.measurements[3, :2] == pytest.approx([2 * math.cos(0.5), 2 * math.sin(0.5)])
    assert graph.noise[3, :2, :2] == pytest.approx(np.diag([100, 25]))


def test_a_sensor_set_off_from_the_pose_is_taken_into_its_frame(filed):
    """A quarter turn to the left, a metre ahead: its x axis is y of the pose."""
    half = math.sqrt(0.5)
    text = f"PARAMS_SE3OFFSET 3 1 0 0 0 0 {half} {half}\n{SPACE}EDGE_SE3_TRACKXYZ 0 9 3 2 0 0 4 0 0 1 0 9\n"
    graph = tb.read_g2o(filed(text))
    assert graph.measurements[1, :3] == pytest.approx([1, 2, 0])
    assert graph.positions[2] == pytest.approx([1, 2, 0])
    assert graph.information[1, :3, :3] == pytest.approx(np.diag([1, 4, 9]))
    with pytest.raises(FileError, match="expected a line PARAMS_SE3OFFSET 4 with a pose for EDGE_SE3_TRACKXYZ, got none"):
        tb.read_g2o(filed(f"{SPACE}EDGE_SE3_TRACKXYZ 0 9 4 2 0 0 4 0 0 1 0 9\n"))


def test_six_numbers_beside_landmark_lines_are_covariances_where_they_cannot_be_information(filed):
    text = "ODOMETRY 0 1 1 0 0 0.01 0 0 0.04 0 0.25\nLANDMARK 1 2 3 0 0.4 0 0.4\n"
    with pytest.warns(ReadingWarning, match="took the six numbers of EDGE2 and ODOMETRY lines for covariances, as GTSAM does"):
        graph = tb.read_pose_graph(filed(text))
    assert graph.information[0] == pytest.approx(np.diag([100, 25, 4]))
    stated = tb.read_pose_graph(filed(text.splitlines()[0]), edge2_order="covariance")
    assert stated.information[0] == pytest.approx(np.diag([100, 25, 4]))


def test_landmarks_join_components_and_can_be_left_out(filed):
    text = PLANE + "VERTEX_SE2 8 5 5 0\nVERTEX_XY 9 6 6\nEDGE_SE2_XY 8 9 1 1 1 0 1\n"
    whole = tb.read_g2o(filed(text))
    assert whole.topology.num_components == 2
    with pytest.warns(ReadingWarning, match="kept one of 2 components"):
        part = tb.read_g2o(filed(text), component="8")
    assert (part.ids.tolist(), part.num_landmarks) == ([8, 9], 1)
    joined = tb.read_g2o(filed(text + "EDGE_SE2_XY 1 9 1 1 1 0 1\n"), component="largest")
    assert joined.num_nodes == 4
    with pytest.warns(ReadingWarning, match="dropped landmarks: VERTEX_XY on line 5, EDGE_SE2_XY on line 6"):
        assert tb.read_g2o(filed(text), drop="landmarks").num_landmarks == 0


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("VERTEX_XY 7 1 2\nVERTEX_XY 7 1 2", ":5: expected one VERTEX_XY per id, got id 7 again (first on line 4)"),
        (
            "EDGE_BEARING_SE2_XY 0 7 0.1 9",
            ":4: expected a line VERTEX_XY for landmark 7, which is seen by its bearing first, got",
        ),
        (
            "VERTEX_XY 7 1 2\nEDGE_BEARING_SE2_XY 0 7 0.1 -9",
            ":5: expected a positive definite information matrix for EDGE_BEAR",
        ),
        ("EDGE_BEARING_SE2_XY 0 7 0.1", ":4: expected 2 ids, a bearing and its information for EDGE_BEARING_SE2_XY, got 3"),
        ("EDGE_SE2_XY 0 7.5 1 2 1 0 1", ":4: expected whole ids from 0 to 2^63 - 1 for EDGE_SE2_XY, got 7.5"),
        (
            "VERTEX_XY 7 1 2\nEDGE_SE3_TRACKXYZ 0 7 0 1 1 1 1 0 0 1 0 1",
            ":5: expected landmarks in SE(2) as on line 4, got EDGE_SE3",
        ),
        (
            "VERTEX_XY 7 1 2\nEDGE_SE2 0 7 1 0 0 1 0 0 1 0 1",
            ":5: expected an edge between poses, got one to 7, which is no pose",
        ),
    ],
)
def test_a_bad_line_is_named(line, message, filed):
    with pytest.raises(FileError) as caught:
        tb.read_g2o(filed(PLANE + line + "\n"))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    "text", [PLANE + "EDGE_SE2_XY 1 7 1 2 4 1 9\nFIX 7\n", SPACE + "EDGE_SE3_TRACKXYZ 0 9 0 2 0 0 4 0 0 1 0 9\n"]
)
def test_what_is_written_is_read_again(text, filed, tmp_path):
    graph = tb.read_g2o(filed("PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n" + text))
    tb.write_g2o(graph, tmp_path / "again.g2o")
    again = tb.read_g2o(tmp_path / "again.g2o")
    for name in ("poses", "edges", "measurements", "information", "ids", "is_landmark"):
        np.testing.assert_array_equal(getattr(again, name), getattr(graph, name))
    assert again.fixed == graph.fixed


def test_bearings_and_ranges_are_written_as_the_positions_that_they_are_to_first_order(filed, tmp_path):
    graph = tb.read_g2o(filed(PLANE + "BR 0 7 0.5 2 0.1 0.2\nBR 1 7 1.5 2.2 0.1 0.2\n"))
    with pytest.raises(InvalidInputError, match="got bearing and range; take them for positions at the estimate"):
        tb.write_g2o(graph, tmp_path / "again.g2o")
    linear = graph.with_positions()
    assert linear.chi2 == pytest.approx(graph.chi2)
    assert tb.joint_entropy(linear) == pytest.approx(tb.joint_entropy(graph), abs=1e-9)
    tb.write_g2o(linear, tmp_path / "again.g2o")
    assert tb.read_g2o(tmp_path / "again.g2o").chi2 == pytest.approx(graph.chi2)


@pytest.mark.parametrize(
    "line",
    [
        "EDGE_SE2_XY 1 7 1 2 4 1e308 9",
        "EDGE_SE2_XY 1 7 1e200 2 4 1 9",
        "EDGE_SE2_XY 1 7 1 2 1.7e308 1 1.7e308",
        "BR 0 7 0.5 2 1e-200 0.2",
        "LANDMARK 0 7 1 0 1e-320 0 1",
        "LANDMARK 0 7 1 0 0.4 1e308 0.4",
    ],
)
@pytest.mark.filterwarnings("error")
def test_numbers_beyond_all_bounds_are_read_or_refused_without_a_word_from_numpy(filed, line):
    with suppress(FileError):
        tb.read_g2o(filed(f"{PLANE}{line}\n"))
