"""The TORO reader: the order of its information, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from data_files import data_file
from topobelief.errors import FileError
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
        ("EQUIV 0 1", "got EQUIV: merging two poses into one is not supported"),
        ("BR 0 7 1 2 3 4", "got BR: landmarks are not supported yet"),
        ("EDGE_SE2 0 1 1 2 0.5 1 0 0 1 0 1", "expected VERTEX2, EDGE2 or FIX, got the unknown tag EDGE_SE2"),
    ],
)
def test_a_bad_line_is_named(line: str, message: str, filed):
    path = filed(PAIR + line + "\nEDGE2 0 1 1 2 0.5 1 0 1 1 0 0\n")
    with pytest.raises(FileError) as caught:
        read_toro(path)
    assert str(caught.value).startswith(f"{path}:3: ")
    assert message in str(caught.value)
