"""The format of a pose graph is read off the name of its file."""

from __future__ import annotations

from pathlib import Path

import pytest

from topobelief.errors import FileError
from topobelief.io.formats import read_pose_graph

G2O = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 1 1 0 0 1 2 3 14 5 26\n"
TORO = "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0\nEDGE2 0 1 1 0 0 1 2 14 26 3 5\n"


@pytest.mark.parametrize(("name", "text"), [("a.g2o", G2O), ("A.G2O", G2O), ("a.toro", TORO), ("a.b.graph", TORO)])
def test_the_suffix_chooses_the_format(name: str, text: str, tmp_path: Path):
    path = tmp_path / name
    path.write_text(text)
    assert read_pose_graph(str(path)).information[0].tolist() == [[1, 2, 3], [2, 14, 5], [3, 5, 26]]


@pytest.mark.parametrize(("name", "shown"), [("graph.txt", "'.txt'"), ("graph", "'no suffix'")])
def test_another_suffix_is_refused(name: str, shown: str, tmp_path: Path):
    with pytest.raises(FileError, match=rf"expected a name that ends in \.g2o, \.toro, \.graph, got {shown}; rename the file"):
        read_pose_graph(tmp_path / name)
