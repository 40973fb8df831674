"""The TORO reader: the order of its information, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from data_files import data_file
from topobelief.errors import FileError, ReadingWarning
from topobelief.io.g2o import read_g2o
from topobelief.io.toro import read_toro

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
        ("BR 0 7 1 2 3 4", "got landmarks (BR on line 3)"),
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
