"""The g2o reader and writer: what lines mean, what comes back, and one file for each way to be wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from data_files import RECORDED, data_file
from graphs import pose_graphs
from topobelief.errors import DisconnectedGraphError, FileError, InvalidInputError, TopobeliefError
from topobelief.geometry import SE2_GROUP, SE3_GROUP
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.g2o import read_g2o, write_g2o

UNIT_2D = "1 0 0 1 0 1"
UNIT_3D = "1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1"
TRIANGLE = f"""VERTEX_SE2 0 0 0 0
VERTEX_SE2 1 1 0 1.5
VERTEX_SE2 2 1 1 3
EDGE_SE2 0 1 1 0 1.5 {UNIT_2D}
EDGE_SE2 1 2 1 0 1.5 {UNIT_2D}
EDGE_SE2 0 2 1 1 3 {UNIT_2D}
"""
PAIR_3D = f"""VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1
VERTEX_SE3:QUAT 1 1 0 0 0 0 0 1
EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1 {UNIT_3D}
"""


@pytest.fixture
def filed(tmp_path: Path):
    """A function that writes text to graph.g2o and returns the path."""

    def write(text: str) -> Path:
        path = tmp_path / "graph.g2o"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_a_planar_line_means_what_the_format_says(filed):
    """Numbers land where the format puts them: id, pose, ids, measurement, upper triangle by rows."""
    graph = read_g2o(filed("VERTEX_SE2 4 1 2 0.5\nVERTEX_SE2 7 3 4 -0.5\nEDGE_SE2 7 4 5 6 0.25 10 1 2 20 3 30\n"))
    assert graph.ids.tolist() == [4, 7]
    assert graph.poses.tolist() == [[1, 2, 0.5], [3, 4, -0.5]]
    assert graph.edges.tolist() == [[1, 0]]
    assert graph.measurements.tolist() == [[5, 6, 0.25]]
    assert graph.information.tolist() == [[[10, 1, 2], [1, 20, 3], [2, 3, 30]]]


def test_a_spatial_line_means_what_the_format_says(filed):
    """Quaternions are qx qy qz qw and are normalised; 21 entries fill a 6 x 6 matrix by rows."""
    entries = np.triu(np.arange(36).reshape(6, 6) / 100) + 10 * np.eye(6)
    text = PAIR_3D.replace("VERTEX_SE3:QUAT 1 1 0 0 0 0 0 1", "VERTEX_SE3:QUAT 1 1 2 3 0 0 2 2").replace(
        UNIT_3D, " ".join(map(repr, entries[np.triu_indices(6)].tolist()))
    )
    graph = read_g2o(filed(text))
    np.testing.assert_allclose(graph.poses[1], [1, 2, 3, 0, 0, np.sqrt(0.5), np.sqrt(0.5)], rtol=1e-15)
    assert np.array_equal(graph.information[0], entries + np.triu(entries, 1).T)


def test_ids_may_be_unordered_and_leave_gaps(filed):
    """Poses are sorted by id and edges keep the order of the file."""
    edges = f"EDGE_SE2 900 5 1 0 0 {UNIT_2D}\nEDGE_SE2 5 30 2 0 0 {UNIT_2D}\n"
    text = "VERTEX_SE2 900 9 0 0\n" + edges + "VERTEX_SE2 5 5 0 0\nVERTEX_SE2 30 3 0 0\n"
    graph = read_g2o(filed(text))
    assert graph.ids.tolist() == [5, 30, 900]
    assert graph.positions[:, 0].tolist() == [5, 3, 9]
    assert graph.edges.tolist() == [[2, 0], [0, 1]]


def test_ids_use_all_of_63_bits_however_they_are_written(filed):
    """No id is rounded on its way, and the last one that fits is read."""
    last = 2**63 - 1
    edges = f"EDGE_SE2 1e3 {last} 1 0 0 {UNIT_2D}\nEDGE_SE2 {last - 1} {last} 1 0 0 {UNIT_2D}\n"
    graph = read_g2o(filed(f"VERTEX_SE2 1000.0 0 0 0\nVERTEX_SE2 {last} 0 0 0\nFIX {last}\n" + edges))
    assert graph.ids.tolist() == [1000, last - 1, last]
    assert graph.edges.tolist() == [[0, 2], [1, 2]]
    assert graph.fixed == (2,)


def test_comments_blank_lines_and_line_ends_are_layout(filed):
    """Comments (whole lines and ends of lines), blank lines, tabs, and the line ends of other systems change nothing."""
    plain = read_g2o(filed(TRIANGLE))
    laid_out = "\ufeff# a map\r\n\r\n" + TRIANGLE.replace(" ", "\t ").replace("\n", "  # näher\r\n")
    decorated = read_g2o(filed(laid_out))
    for name in ("ids", "poses", "edges", "measurements", "information"):
        assert np.array_equal(getattr(plain, name), getattr(decorated, name))


def test_fix_lines_are_metadata(filed):
    """FIX names poses, one or more a line, repeated or not; nothing else changes."""
    graph = read_g2o(filed(TRIANGLE + "FIX 2\nFIX 0 2\n"))
    assert graph.fixed == (0, 2)
    assert graph.chi2 == read_g2o(filed(TRIANGLE)).chi2


def test_one_pose_and_no_edge_is_a_graph(filed):
    graph = read_g2o(filed("VERTEX_SE2 3 1 2 0.5\n"))
    assert (graph.num_poses, graph.num_edges, graph.ids.tolist()) == (1, 0, [3])


def test_a_graph_with_all_poses_may_be_disconnected(filed):
    """Reading a map in two parts is fine: whoever needs it connected says so."""
    graph = read_g2o(filed(TRIANGLE + f"VERTEX_SE2 8 0 0 0\nVERTEX_SE2 9 0 0 0\nEDGE_SE2 8 9 1 0 0 {UNIT_2D}\n"))
    assert graph.topology.num_components == 2


def test_parallel_edges_are_kept(filed):
    graph = read_g2o(filed(TRIANGLE + f"EDGE_SE2 1 0 -1 0 -1.5 {UNIT_2D}\nEDGE_SE2 0 1 1 0 1.5 {UNIT_2D}\n"))
    assert graph.edges.tolist() == [[0, 1], [1, 2], [0, 2], [1, 0], [0, 1]]


def test_missing_poses_are_chained_from_edges(filed):
    """Without VERTEX lines the lowest id is the origin and odometry is preferred to the loop closure that comes first."""
    text = f"EDGE_SE2 10 12 9 9 9 {UNIT_2D}\nEDGE_SE2 10 11 1 0 1.5707963267948966 {UNIT_2D}\nEDGE_SE2 12 11 -1 0 0 {UNIT_2D}\n"
    graph = read_g2o(filed(text))
    np.testing.assert_allclose(graph.poses, [[0, 0, 0], [1, 0, np.pi / 2], [1, 1, np.pi / 2]], atol=1e-15)


def test_given_poses_stay_and_the_others_hang_on_them(filed):
    """A pose in the middle without its VERTEX line is composed from a neighbour that has one."""
    text = TRIANGLE.replace("VERTEX_SE2 1 1 0 1.5\n", "").replace("VERTEX_SE2 0 0 0 0", "VERTEX_SE2 0 100 50 0")
    graph = read_g2o(filed(text))
    np.testing.assert_allclose(graph.poses, [[100, 50, 0], [101, 50, 1.5], [1, 1, 3]], atol=1e-12)


def test_odometry_may_run_on_past_the_last_vertex_line(filed):
    """An edge from one id to the next places a pose even though nothing else names it."""
    graph = read_g2o(filed(TRIANGLE + f"EDGE_SE2 2 3 1 0 0 {UNIT_2D}\n"))
    np.testing.assert_allclose(graph.positions[3], [1 + np.cos(3), 1 + np.sin(3)], atol=1e-15)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(graph=pose_graphs())
def test_writing_and_reading_returns_every_bit(graph: PoseGraph, tmp_path: Path):
    """The writer loses nothing: poses, measurements, information, ids and fixed poses are the same doubles and integers."""
    named = PoseGraph(
        graph.poses,
        graph.edges,
        graph.measurements,
        graph.information,
        ids=2**63 - 1 - 1001 * np.arange(graph.num_poses)[::-1],
        fixed=(graph.num_poses - 1,),
    )
    write_g2o(named, tmp_path / "copy.g2o")
    copy = read_g2o(tmp_path / "copy.g2o")
    for name in ("ids", "poses", "edges", "measurements"):
        assert np.array_equal(getattr(named, name), getattr(copy, name)), name
    upper = (slice(None), *np.triu_indices(graph.tangent_dim))
    assert np.array_equal(named.information[upper], copy.information[upper])
    assert copy.fixed == named.fixed


def test_writing_is_whole_or_not_at_all(filed, tmp_path: Path):
    """A graph that cannot be written leaves the file that was there, and nothing else."""
    path = filed(TRIANGLE)
    broken = read_g2o(path)
    object.__setattr__(broken, "information", None)
    with pytest.raises(TypeError):
        write_g2o(broken, path)
    assert path.read_text(encoding="utf-8") == TRIANGLE
    assert [file.name for file in tmp_path.iterdir()] == ["graph.g2o"]


def test_ids_that_the_reader_would_refuse_are_not_written(tmp_path: Path):
    graph = PoseGraph([[0, 0, 0]], [], None, np.eye(3), ids=[-1])
    with pytest.raises(InvalidInputError, match=r"expected ids from 0 to 2\^63 - 1 for a file, got -1; renumber"):
        write_g2o(graph, tmp_path / "graph.g2o")
    assert not list(tmp_path.iterdir())


SIZES = {
    "intel.g2o": (SE2_GROUP, 1228, 1483),
    "csail.g2o": (SE2_GROUP, 1045, 1172),
    "manhattan3500.g2o": (SE2_GROUP, 3500, 5598),
    "city10000.g2o": (SE2_GROUP, 10000, 20687),
    "ais2klinik.g2o": (SE2_GROUP, 15115, 16727),
    "kitti_05.g2o": (SE2_GROUP, 2761, 2826),
    "parking-garage.g2o": (SE3_GROUP, 1661, 6275),
    "sphere2500.g2o": (SE3_GROUP, 2500, 4949),
    "smallGrid3D.g2o": (SE3_GROUP, 125, 297),
    RECORDED: (SE2_GROUP, 121, 386),
}


@pytest.mark.parametrize("name", SIZES)
def test_public_files_are_read_whole(name: str):
    """Every public file gives its known number of poses and edges, and its first and last edge as they stand there."""
    path = data_file(name)
    graph = read_g2o(path)
    assert (graph.group, graph.num_poses, graph.num_edges) == SIZES[name]
    edge_lines = [line.split() for line in path.read_text().splitlines() if line.startswith("EDGE")]
    k = graph.group.position_dim
    for row in (0, -1):
        assert graph.ids[graph.edges[row]].tolist() == [int(field) for field in edge_lines[row][1:3]]
        assert graph.measurements[row, :k].tolist() == [float(field) for field in edge_lines[row][3 : 3 + k]]
        assert graph.information[row, -1, -1] == float(edge_lines[row][-1])


def test_kitti_without_vertex_lines_is_its_odometry_chained():
    """All 2760 odometry edges of the chain fit exactly, so what chi^2 there is comes from loop closures."""
    graph = read_g2o(data_file("kitti_05.g2o"))
    chain = np.abs(np.diff(graph.edges, axis=1)[:, 0]) == 1
    i, j = graph.edges.T
    residuals = graph.group.residual(graph.measurements, graph.group.between(graph.poses[i], graph.poses[j]))
    assert chain.sum() == graph.num_poses - 1
    assert np.abs(residuals[chain]).max() < 1e-9
    assert np.abs(residuals[~chain]).max() > 1


BAD_LINES = {
    "truncated edge": ("EDGE_SE2 0 1 1 0 1.5 1 0 0 1 0", "expected 6 information entries for EDGE_SE2, got 5"),
    "trailing number": (f"EDGE_SE2 0 1 1 0 1.5 {UNIT_2D} 7", "expected 6 information entries for EDGE_SE2, got 7"),
    "edge cut in its pose": (
        "EDGE_SE2 0 1 1 0",
        "expected 2 ids, 3 numbers and 6 information entries for EDGE_SE2, got 4 fields",
    ),
    "truncated vertex": ("VERTEX_SE2 5 1 2", "expected an id, 3 numbers for VERTEX_SE2, got 3 fields"),
    "vertex with a trailing number": (
        "VERTEX_SE2 5 1 2 3 4",
        "expected an id, 3 numbers for VERTEX_SE2, got 5 fields",
    ),
    "bare tag": ("VERTEX_SE2", "expected an id, 3 numbers for VERTEX_SE2, got 0 fields"),
    "unknown tag": (
        "VERTEX_SE5 0 1",
        "expected VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT or FIX, got the unknown tag VERTEX_SE5",
    ),
    "lower-case tag": ("edge_se2 0 1", "got the unknown tag edge_se2; remove the line"),
    "landmark": ("VERTEX_XY 7 1", "expected an id and 2 numbers for VERTEX_XY, got 2 fields"),
    "landmark at nan": ("VERTEX_XY 7 1 nan", "expected finite numbers for VERTEX_XY, got nan"),
    "observation": (
        "EDGE_SE2_XY 0 7 1 2 1 0",
        "expected 2 ids, 2 numbers and 3 information entries for EDGE_SE2_XY, got 6 fields",
    ),
    "flat observation": ("EDGE_SE2_XY 0 7 1 2 1 1 1", "expected a positive definite information matrix for EDGE_SE2_XY"),
    "observation from nowhere": (
        "EDGE_SE2_XY 5 7 1 2 1 0 1",
        "expected an observation by a pose, got one by 5, which no other",
    ),
    "3D landmark": ("VERTEX_TRACKXYZ 7 1 2 3", "expected lines in SE(2) as VERTEX_SE2 on line 1, got VERTEX_TRACKXYZ"),
    "bearing alone": ("EDGE_BEARING_SE2_XY 0 7 0.1 10", "expected a line VERTEX_XY for landmark 7, which is seen by"),
    "edge between sensors": ("EDGE_SE2_OFFSET 0 1 0 0 1 0 0", "got EDGE_SE2_OFFSET: it measures between sensors"),
    "TORO": ("VERTEX2 9 0 0 0", "got VERTEX2: it belongs to the format TORO, and a file is in one format"),
    "not a number": (f"EDGE_SE2 0 1 one 0 0 {UNIT_2D}", "expected a number for EDGE_SE2, got 'one'"),
    "underscores": (f"EDGE_SE2 0 1 1_0 0 0 {UNIT_2D}", "expected a number for EDGE_SE2, got '1_0'"),
    "foreign digits": (f"EDGE_SE2 0 1 ١ 0 0 {UNIT_2D}", "expected a number for EDGE_SE2, got '١'"),
    "decimal comma": (f"EDGE_SE2 0 1 0,5 0 0 {UNIT_2D}", "expected a number for EDGE_SE2, got '0,5'"),
    "nan": (f"EDGE_SE2 0 1 nan 0 0 {UNIT_2D}", "expected finite numbers for EDGE_SE2, got nan"),
    "infinity": ("VERTEX_SE2 5 inf 0 0", "expected finite numbers for VERTEX_SE2, got inf"),
    "overflow": ("VERTEX_SE2 5 0 -1e999 0", "expected finite numbers for VERTEX_SE2, got -1e999"),
    "infinite information": (
        "EDGE_SE2 0 1 1 0 0 inf 0 0 1 0 1",
        "expected finite numbers for EDGE_SE2, got inf",
    ),
    "fractional id": ("VERTEX_SE2 5.5 0 0 0", "expected whole ids from 0 to 2^63 - 1 for VERTEX_SE2, got 5.5"),
    "negative id": (
        f"EDGE_SE2 0 -1 1 0 0 {UNIT_2D}",
        "expected whole ids from 0 to 2^63 - 1 for EDGE_SE2, got -1",
    ),
    "absurdly large id": (
        "VERTEX_SE2 9223372036854775808 0 0 0",
        "expected whole ids from 0 to 2^63 - 1 for VERTEX_SE2, got 9223372036854775808; renumber the poses",
    ),
    "id beyond 64 bits": (
        "VERTEX_SE2 99999999999999999999999 0 0 0",
        "expected whole ids from 0 to 2^63 - 1 for VERTEX_SE2, got 99999999999999999999999",
    ),
    "nan id": ("VERTEX_SE2 nan 0 0 0", "expected whole ids from 0 to 2^63 - 1 for VERTEX_SE2, got nan"),
    "duplicate id": ("VERTEX_SE2 1 0 0 0", r"expected one VERTEX_SE2 per id, got id 1 again (first on line 2)"),
    "self-loop": (
        f"EDGE_SE2 1 1 0 0 0 {UNIT_2D}",
        "expected an edge between two poses, got a self-loop at 1",
    ),
    "edge to nowhere": (
        f"EDGE_SE2 0 99 1 0 0 {UNIT_2D}",
        "expected an edge between poses, got one to nowhere: 99 has no VERTEX_SE2 line and no other edge",
    ),
    "mixed dimensions": (
        "VERTEX_SE3:QUAT 9 0 0 0 0 0 0 1",
        "expected lines in SE(2) as VERTEX_SE2 on line 1, got VERTEX_SE3:QUAT",
    ),
    "indefinite information": (
        "EDGE_SE2 0 1 1 0 0 1 2 0 1 0 1",
        "expected a positive definite information matrix for EDGE_SE2, got eigenvalues from -1 to 3",
    ),
    "zero information": (
        "EDGE_SE2 0 1 1 0 0 0 0 0 0 0 0",
        "expected a positive definite information matrix for EDGE_SE2, got eigenvalues from 0 to 0",
    ),
    "semidefinite information": (
        "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 0",
        "expected a positive definite information matrix for EDGE_SE2, got eigenvalues from 0 to 1",
    ),
    "FIX of nothing": ("FIX", "expected at least one id for FIX, got none"),
    "FIX of an unknown id": ("FIX 1 77", "expected the id of a pose for FIX, got 77, which no other line names"),
    "FIX of a word": ("FIX first", "expected a number for FIX, got 'first'"),
    "FIX of a fraction": ("FIX 0.5", "expected whole ids from 0 to 2^63 - 1 for FIX, got 0.5"),
}


@pytest.mark.parametrize("case", BAD_LINES)
def test_a_bad_line_is_named(case: str, filed):
    """The error is one line: the file, the line's number, what was expected and what is there."""
    line, message = BAD_LINES[case]
    path = filed(TRIANGLE + line + "\n" + f"EDGE_SE2 2 1 -1 0 -1.5 {UNIT_2D}\n")
    with pytest.raises(FileError) as caught:
        read_g2o(path)
    assert str(caught.value).startswith(f"{path}:7: {message}" if message.startswith("expected") else f"{path}:7: expected")
    assert message in str(caught.value)
    assert caught.value.line == 7
    assert "\n" not in str(caught.value)


BAD_SPATIAL = {
    "zero quaternion": (
        PAIR_3D.replace("1 1 0 0 0 0 0 1", "1 1 0 0 0 0 0 0"),
        2,
        "expected a unit quaternion for VERTEX_SE3:QUAT, got one of norm 0",
    ),
    "zero quaternion measured": (
        PAIR_3D.replace("0 1 1 0 0 0 0 0 1 ", "0 1 1 0 0 0 0 0 0 "),
        3,
        "expected a unit quaternion for EDGE_SE3:QUAT, got one of norm 0",
    ),
    "endless quaternion": (
        PAIR_3D.replace("1 1 0 0 0 0 0 1", "1 1 0 0 0 0 0 1e200"),
        2,
        "expected a unit quaternion for VERTEX_SE3:QUAT, got one of norm",
    ),
    "indefinite information": (
        PAIR_3D.replace(UNIT_3D, "-" + UNIT_3D),
        3,
        "expected a positive definite information matrix for EDGE_SE3:QUAT, got eigenvalues from -1 to 1",
    ),
    "wrong count": (
        PAIR_3D.replace(UNIT_3D, UNIT_3D[2:]),
        3,
        "expected 21 information entries for EDGE_SE3:QUAT, got 20",
    ),
}


@pytest.mark.parametrize("case", BAD_SPATIAL)
def test_a_bad_spatial_line_is_named(case: str, filed):
    text, line, message = BAD_SPATIAL[case]
    with pytest.raises(FileError) as caught:
        read_g2o(filed(text))
    assert caught.value.line == line
    assert message in str(caught.value)


def test_the_first_of_several_bad_matrices_is_named(filed):
    """Counting edges is not counting lines: the line is that of the edge, wherever edges stand among vertices."""
    bad = f"EDGE_SE2 0 1 1 0 0 -{UNIT_2D}\n"
    with pytest.raises(FileError, match=r"graph\.g2o:5: expected a positive definite"):
        read_g2o(filed(TRIANGLE.replace("EDGE_SE2 1 2", bad + "EDGE_SE2 1 2") + bad))


BAD_FILES = {
    "no lines of a graph": ("# nothing here\n\n", "expected lines with VERTEX_SE2, EDGE_SE2,"),
    "no edges": ("VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n", "expected EDGE_SE2 lines between the 2 poses, got none"),
    "FIX alone": ("FIX 0\n", "expected lines with VERTEX_SE2, EDGE_SE2,"),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_a_file_without_a_graph_is_refused(case: str, filed):
    text, message = BAD_FILES[case]
    with pytest.raises(FileError, match=message):
        read_g2o(filed(text))


def test_poses_that_nothing_can_place_are_named(filed):
    """Poses without VERTEX lines, linked only with each other, leave nothing to compose them from."""
    loose = f"EDGE_SE2 7 8 1 0 0 {UNIT_2D}\nEDGE_SE2 7 8 1 0 0 {UNIT_2D}\n"
    with pytest.raises(DisconnectedGraphError, match=r"connected graph in .*graph\.g2o, got 2 node.*: 7, 8;") as caught:
        read_g2o(filed(TRIANGLE + loose))
    assert caught.value.nodes == (7, 8)
    with pytest.raises(DisconnectedGraphError, match=r"got 2 node.*node 0 does not reach: 7, 8"):
        read_g2o(filed(f"EDGE_SE2 0 1 1 0 0 {UNIT_2D}\n" + loose))


@pytest.mark.parametrize("text", [TRIANGLE + "FIX 0\n", PAIR_3D + "FIX 0\n"], ids=["planar", "spatial"])
def test_a_file_cut_anywhere_gives_a_graph_or_one_line(text: str, filed):
    """However many bytes of a file arrive, the reader returns a graph or raises one of its own errors, in one line."""
    messages: list[str] = []
    for length in range(len(text)):
        try:
            read_g2o(filed(text[:length]))
        except TopobeliefError as error:
            messages.append(str(error))
    assert len(messages) > len(text) / 2
    assert not any("\n" in message for message in messages)
