"""Whatever is done to the lines of a valid file, a reader returns a graph or raises one of the project's own errors.

Mutations are drawn from a seed: fields are replaced by odd ones, doubled, dropped or swapped, lines are too, bytes are
overwritten. Options are drawn with them.
"""

from __future__ import annotations

import random
import warnings
from pathlib import Path

import pytest

from graph_texts import PLANAR, SPATIAL, TORO
from topobelief.errors import ReadingWarning, TopobeliefError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.formats import read_pose_graph
from topobelief.io.g2o import read_g2o
from topobelief.io.toro import read_toro

ODD = [
    "",
    "#",
    "-1",
    "0.5",
    "1e400",
    "nan",
    "-inf",
    "9223372036854775807",
    "9223372036854775808",
    "9" * 5000,
    "1_0",
    "١",
    "0x1",
]
ODD += [
    "VERTEX_SE2",
    "EDGE_SE3:QUAT",
    "EDGE2",
    "FIX",
    "PARAMS_",
    "VERTEX_",
    "\ufffd",
    "\u2028",
    "\x85",
    "x0",
    "1e308",
    "5e-324",
]
KINDS = ["priors", "gps", "gravity", "planes", "landmarks", "robust", "equiv", "indefinite"]
ROUNDS = 500


def mutated(text: str, rng: random.Random) -> bytes:
    """The file with one to four mutations."""
    lines = [line.split(" ") for line in text.split("\n")]
    for _ in range(rng.randint(1, 4)):
        fields = rng.choice(lines)
        at = rng.randrange(len(fields))
        match rng.randrange(6):
            case 0:
                fields[at] = rng.choice(ODD)
            case 1:
                fields[at : at + 1] = [fields[at]] * rng.choice([0, 2])
            case 2:
                other = rng.choice(lines)
                place = rng.randrange(len(other))
                fields[at], other[place] = other[place], fields[at]
            case 3:
                lines.insert(rng.randrange(len(lines)), list(fields))
            case 4 if len(lines) > 1:
                lines.remove(fields)
            case _:
                fields[at] = str(rng.choice([0, 1, 2, 3, 4, -2, 1e-200, 1e200]))

        lines = [line or [""] for line in lines]
    content = bytearray("\n".join(map(" ".join, lines)).encode())
    if content and rng.random() < 0.2:
        content[rng.randrange(len(content))] = rng.randrange(256)
    return bytes(content)


def options(rng: random.Random) -> dict[str, object]:
    """Any mixture of the options of reading."""
    drawn: dict[str, object] = {"drop": rng.sample(KINDS, rng.randint(0, len(KINDS)))}
    drawn["robust_as_plain"] = rng.random() < 0.3
    drawn["edge2_order"] = rng.choice(["toro", "isam"])
    drawn["component"] = rng.choice(["all", "largest", 1, "x1"])
    drawn["planar"] = rng.random() < 0.3
    return drawn


@pytest.mark.parametrize(
    ("reader", "text"),
    [(read_g2o, PLANAR), (read_g2o, SPATIAL), (read_toro, TORO), (read_pose_graph, PLANAR), (read_pose_graph, TORO)],
    ids=["g2o", "g2o in space", "TORO", "either, g2o", "either, TORO"],
)
def test_a_mutated_file_gives_a_graph_or_one_line(reader, text: str, tmp_path: Path):
    """Many mutations leave a graph, many do not; none gives any other error, or a message of two lines."""
    rng = random.Random(20)
    path = tmp_path / "graph"
    num_read, messages = 0, list[str]()
    for _ in range(ROUNDS):
        path.write_bytes(mutated(text, rng))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                warnings.simplefilter("ignore", ReadingWarning)
                graph = reader(path, **options(rng))
        except TopobeliefError as error:
            messages.append(str(error))
        else:
            assert isinstance(graph, PoseGraph)
            num_read += 1
    assert 0 < num_read < ROUNDS
    assert all("\n" not in message and len(message) < 1000 for message in messages)
