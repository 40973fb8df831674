"""The TORO reader: the order of its information, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from data_files import data_file
from topobelief.errors import FileError, InvalidInputError, ReadingWarning
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.formats import read_pose_graph
from topobelief.io.g2o import read_g2o
from topobelief.io.toro import read_toro, write_toro

PAIR = "VERTEX2 0 0 0 0\nVERTEX2 1 1 2 0.5\n"


@pytest.fixture
def filed(tmp_path: Path):
    """A function that writes text to graph.toro and returns the path."""

    def write(text: str) -> Path:
        path = tmp_path / "graph.toro"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_information_is_in_the_order_of_the_format(filed):
    """I11 I12 I22 I33 I13 I23."""
    graph = read_toro(filed(PAIR + "EDGE2 0 1 1 2 0.5 11 12 22 33 13 23\n".replace("12", "1.2").replace("13", "1.3")))
    assert graph.information.tolist() == [[[11, 1.2, 1.3], [1.2, 22, 23], [1.3, 23, 33]]]
    assert graph.measurements.tolist() == [[1, 2, 0.5]]
    assert graph.poses.tolist() == [[0, 0, 0], [1, 2, 0.5]]


def test_csail_is_the_same_graph_in_both_formats():
    """The two files of one building agree in every number that they print."""
    toro, g2o = read_toro(data_file("csail.toro")), read_g2o(data_file("csail.g2o"))
    assert np.array_equal(toro.ids, g2o.ids)
    assert np.array_equal(toro.edges, g2o.edges)
    for name in ("poses", "measurements", "information"):
        np.testing.assert_allclose(getattr(toro, name), getattr(g2o, name), rtol=0, atol=1e-6)


def test_fix_lines_comments_and_missing_poses_work_as_in_g2o(filed):
    graph = read_toro(filed("# odometry only\nEDGE2 3 4 1 0 0 1 0 1 1 0 0\nFIX 3\n"))
    assert (graph.ids.tolist(), graph.fixed, graph.poses.tolist()) == ([3, 4], (0,), [[0, 0, 0], [1, 0, 0]])


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("EDGE2 0 1 1 2 0.5 1 0 1 1 0", "expected 6 information entries for EDGE2, got 5"),
        ("EDGE2 0 1 1 2 0.5 1 2 1 1 0 0", "expected a positive definite information matrix for EDGE2, got eigenvalues from -1"),
        ("VERTEX3 5 0 0 0 0 0 0", "got VERTEX3: 3D TORO files are not supported"),
        ("EDGE3 0 1 0 0 0 0 0 0", "got EDGE3: 3D TORO files are not supported"),
        ("EQUIV 0 1", "got pairs of poses that are to be merged into one (EQUIV on line 3)"),
        ("BR 0 7 1 -2 3 4", "expected a range and standard deviations above 0 for BR, got others"),
        ("LANDMARK 0 7 1 2 1 0 0", "expected a positive definite covariance for LANDMARK, got another"),
        ("EDGE_SE2 0 1 1 2 0.5 1 0 0 1 0 1", "expected VERTEX2, EDGE2 or FIX, got EDGE_SE2: it belongs to the format g2o"),
    ],
)
def test_a_bad_line_is_named(line: str, message: str, filed):
    path = filed(PAIR + line + "\nEDGE2 0 1 1 2 0.5 1 0 1 1 0 0\n")
    with pytest.raises(FileError) as caught:
        read_toro(path)
    assert str(caught.value).startswith(f"{path}:3: ")
    assert message in str(caught.value)


ISAM = "EDGE2 0 1 1 2 0.5 100 1 2 90 3 400\n"


def test_the_order_of_isam_is_an_option_that_the_refusal_names(filed):
    """Entries row by row give an indefinite matrix in TORO's order; dropping indefinite edges does not hide that."""
    path = filed(PAIR + ISAM)
    for options in ({}, {"drop": "indefinite"}):
        with pytest.raises(FileError, match=r':3: .*in the other order of EDGE2 all edges have one: .*edge2_order="isam"'):
            read_toro(path, **options)
    assert read_toro(path, edge2_order="isam").information.tolist() == [[[100, 1, 2], [1, 90, 3], [2, 3, 400]]]
    with pytest.raises(FileError, match='edge2_order="toro"'):
        read_toro(filed(PAIR + "EDGE2 0 1 1 2 0.5 100 1 90 400 2 3\n"), edge2_order="isam")


def test_equiv_lines_can_be_ignored(filed):
    with pytest.warns(ReadingWarning, match=r"dropped pairs of poses that are to be merged into one: EQUIV on line 4"):
        graph = read_toro(filed(PAIR + "EDGE2 0 1 1 2 0.5 1 0 1 1 0 0\nEQUIV 0 1\n"), drop="equiv")
    assert graph.num_edges == 1


@pytest.mark.parametrize("tag", ["EDGE2", "ODOMETRY", "Constraint2"])
def test_isam_states_a_square_root_of_the_information(tag: str, filed):
    """R11 R12 R13 R22 R23 R33 of an upper triangular R; the information is R^T R."""
    path = filed(f"{tag} 0 1 1 0 0.5 10 2 3 20 4 5\n{tag} 1 2 1 0 0 10 0 0 20 0 5\n")
    root = np.array([[10, 2, 3], [0, 20, 4], [0, 0, 5]])
    graph = read_toro(path, edge2_order="isam_root")
    assert graph.information[0].tolist() == (root.T @ root).tolist()
    np.testing.assert_allclose(graph.poses[1], [1, 0, 0.5])
    assert read_pose_graph(path, edge2_order="isam").information[0].tolist() == [[10, 2, 3], [2, 20, 4], [3, 4, 5]]


def test_the_other_order_and_its_square_root_are_offered(filed):
    with pytest.raises(FileError, match=r'edge2_order="isam"\), or isam_root where they are square roots'):
        read_toro(filed("EDGE2 0 1 1 0 0.5 3.16 0 0 3.16 0 5\n"))


def test_what_is_written_is_read_to_the_last_bit(tmp_path: Path):
    rng = np.random.default_rng(1)
    root = rng.normal(size=(2, 3, 3))
    graph = PoseGraph(
        rng.normal(size=(3, 3)),
        [(2, 0), (0, 1)],
        rng.normal(size=(2, 3)),
        root.mT @ root + np.eye(3),
        ids=[4, 7, 2**62],
        fixed=(1,),
    )
    write_toro(graph, tmp_path / "graph.toro")
    back = read_pose_graph(tmp_path / "graph.toro")
    for name in ("poses", "edges", "measurements", "information", "ids"):
        assert np.array_equal(getattr(back, name), getattr(graph, name)), name
    assert back.fixed == (1,)


def test_space_has_no_lines_in_toro(tmp_path: Path):
    graph = PoseGraph([[0, 0, 0, 0, 0, 0, 1]], np.zeros((0, 2), int), None, np.eye(6))
    with pytest.raises(InvalidInputError, match=r"expected a graph in SE\(2\) for a TORO file, got one in SE\(3\); write g2o"):
        write_toro(graph, tmp_path / "graph.toro")
    assert not (tmp_path / "graph.toro").exists()


@pytest.mark.parametrize(
    ("order", "numbers", "message"),
    [
        ("covariance", "1 0 1e308 1 0 0", "expected a positive definite information matrix for EDGE2, got eigenvalues"),
        (
            "isam_root",
            "1 1e308 1 1 0 0",
            "expected a positive definite information matrix for EDGE2, got one that is not finite",
        ),
    ],
)
@pytest.mark.filterwarnings("error")
def test_information_beyond_all_bounds_is_refused(tmp_path, order, numbers, message):
    path = tmp_path / "graph.toro"
    path.write_text(f"VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0\nEDGE2 0 1 1 0 0 {numbers}\n")
    with pytest.raises(FileError, match=message):
        read_toro(path, edge2_order=order)
