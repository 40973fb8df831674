"""The format of a pose graph is read off the content of its file."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest

from topobelief.errors import FileError
from topobelief.io.formats import read_pose_graph

G2O = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 1 1 0 0 1 2 3 14 5 26\n"
TORO = "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0\nEDGE2 0 1 1 0 0 1 2 14 26 3 5\n"


@pytest.mark.parametrize("name", ["a.g2o", "A.TORO", "a.b.graph", "a.txt", "a"])
@pytest.mark.parametrize("text", [G2O, TORO, "# made by hand\n\n" + TORO, "PARAMS_SE2OFFSET 0 0 0 0\n" + G2O])
def test_the_content_chooses_the_format(name: str, text: str, tmp_path: Path):
    path = tmp_path / name
    path.write_text(text)
    assert read_pose_graph(str(path)).information[0].tolist() == [[1, 2, 3], [2, 14, 5], [3, 5, 26]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("# nothing\n", "expected lines with VERTEX_SE2, .*, EDGE_SE3:QUAT, VERTEX2, EDGE2, got none"),
        ("image: map.pgm\n", r"a\.g2o:1: expected VERTEX_SE2, .*, EDGE2 or FIX, got the unknown tag image:"),
        ("VERTEX3 0 0 0 0 0 0 0\n", "got VERTEX3: 3D TORO files are not supported"),
        (TORO + G2O, r"a\.g2o:4: expected VERTEX2, EDGE2 or FIX, got VERTEX_SE2: it belongs to the format g2o"),
        (G2O + TORO, r"a\.g2o:4: .*got VERTEX2: it belongs to the format TORO"),
    ],
    ids=["comments", "another file", "3D TORO", "both", "both the other way"],
)
def test_content_of_no_format_or_of_two_is_refused(text: str, message: str, tmp_path: Path):
    path = tmp_path / "a.g2o"
    path.write_text(text)
    with pytest.raises(FileError, match=message):
        read_pose_graph(path)


def test_lines_may_come_through_a_pipe(tmp_path: Path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=(G2O,))
    writer.start()
    graph = read_pose_graph(pipe)
    writer.join()
    assert graph.num_edges == 1
