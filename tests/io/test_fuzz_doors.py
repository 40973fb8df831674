"""Whatever is done to the bytes of a valid database, trajectory or drawing, a reader returns a graph or raises one line.

Mutations are drawn from a seed: bytes are overwritten, cut out, doubled or moved; in text, lines and fields too.
`PYTHONPATH=tests python tests/io/test_fuzz_doors.py ROUNDS` makes many more and prints the slowest and the largest.
"""

from __future__ import annotations

import random
import resource
import sys
import tempfile
import time
import warnings
from pathlib import Path

import pytest

from door_files import Database, cartographer, slam_toolbox
from topobelief.errors import ReadingWarning, TopobeliefError
from topobelief.io.formats import read_graph_file
from topobelief.io.reading import ReadingOptions

ROUNDS = 300
TUM = "# timestamp x y z qx qy qz qw\n" + "".join(f"{k} {k % 7} {k % 3} 0.5 0 0 0 1\n" for k in range(20))
KITTI = "".join(f"1 0 0 {k} 0 1 0 0.5 0 0 1 {k % 5}\n" for k in range(20))
ODD = [
    "",
    "-1",
    "1e400",
    "nan",
    "-inf",
    "1e9",
    "9" * 400,
    "1_0",
    "0x1",
    "'...'",
    "- ",
    "---",
    "#",
    ": ",
    "[",
    "{",
    "\t",
    "x:",
    "\x85",
]


def database() -> bytes:
    """An RTAB-Map database with optimised poses and an odd link of each kind."""
    made = Database()
    made.optimised(-5, 1, 2, 3, 4)
    made.links.append((1, 1, 7, made.links[0][3], made.links[0][4]))
    with tempfile.TemporaryDirectory() as folder:
        return made.write(Path(folder, "map.db")).read_bytes()


SEEDS = {
    "RTAB-Map": database(),
    "TUM": TUM.encode(),
    "KITTI": KITTI.encode(),
    "slam_toolbox": slam_toolbox().encode(),
    "Cartographer": "".join(cartographer()).encode(),
    "archive": b"22 serialization::archive 17 0 0 0 0 1 2 3",
}


def mutated(content: bytes, rng: random.Random) -> bytes:
    """The file with one to four mutations."""
    data = bytearray(content)
    for _ in range(rng.randint(1, 4)):
        if not data:
            return b""
        at = rng.randrange(len(data))
        match rng.randrange(6):
            case 0:
                data[at] = rng.randrange(256)
            case 1:
                del data[at : at + rng.choice([1, 4, 100, len(data)])]
            case 2:
                size = rng.choice([1, 8, 60])
                data[at:at] = data[at : at + size] * rng.choice([1, 3])
            case 3:
                data[at : at + 4] = rng.choice([b"\xff" * 4, b"\0" * 4, b"\x7f\xff\xff\xff", rng.randbytes(4)])
            case 4:
                words = bytes(data).split(b" ")
                words[rng.randrange(len(words))] = rng.choice(ODD).encode()
                data = bytearray(b" ".join(words))
            case _:
                lines = bytes(data).split(b"\n")
                lines.insert(rng.randrange(len(lines)), lines.pop(rng.randrange(len(lines))))
                data = bytearray(b"\n".join(lines))
    return bytes(data)


def options(rng: random.Random) -> ReadingOptions:
    return ReadingOptions(
        drop=rng.sample(["priors", "gravity", "landmarks", "indefinite"], rng.randint(0, 4)),
        component=rng.choice(["all", "largest", 1]),
        planar=rng.random() < 0.3,
        noise=rng.choice([None, (0.1, 0.1), (0.1, 0.1)]),
        spacing=rng.choice([0.1, 2.0]),
        closure_radius=rng.choice([None, 1.0]),
    )


def outcome(content: bytes, path: Path, chosen: ReadingOptions) -> str:
    """The message of the error, or nothing."""
    path.write_bytes(content)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", ReadingWarning)
            read_graph_file(path, chosen)
    except TopobeliefError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("name", SEEDS)
def test_a_mutated_file_gives_a_graph_or_one_line(name: str, tmp_path: Path):
    rng = random.Random(21)
    messages = [outcome(mutated(SEEDS[name], rng), tmp_path / "file", options(rng)) for _ in range(ROUNDS)]
    assert all("\n" not in message and len(message) < 1000 for message in messages)
    assert any(messages)
    assert name == "archive" or not all(messages)


def _run(rounds: int) -> None:
    """Many mutations of each reader's file, with the time of the slowest and the memory of the largest."""
    with tempfile.TemporaryDirectory() as folder:
        for name, content in SEEDS.items():
            rng, slowest, refused = random.Random(1), 0.0, 0
            for _ in range(rounds):
                made, chosen = mutated(content, rng), options(rng)
                begin = time.process_time()
                refused += bool(outcome(made, Path(folder, "file"), chosen))
                slowest = max(slowest, time.process_time() - begin)
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            print(f"{name}: {rounds} files, {refused} refused, slowest {slowest:.3f} s, peak memory {peak:.0f} MB")


if __name__ == "__main__":
    _run(int(sys.argv[1]))
