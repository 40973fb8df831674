"""Whatever is done to the bytes of a valid file, its reader returns what it should or raises one line.

Mutations are drawn from a seed: bytes are overwritten, cut out, doubled or moved; in text, lines and fields too.
`PYTHONPATH=tests python tests/io/test_fuzz_doors.py ROUNDS [NAME …]` makes many more and prints the slowest and the largest.
"""

from __future__ import annotations

import io
import random
import resource
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from bag_files import FORMATS, messages_for, write_bag
from cloud_files import CLOUDS
from door_files import LIST, SPHERE, Database, cartographer, slam_toolbox
from graph_texts import LANDMARKS, LANDMARKS_IN_SPACE, PLANAR, SPATIAL, TORO
from topobelief.errors import MapWarning, ReadingWarning, TopobeliefError
from topobelief.io.floor_plan import read_world
from topobelief.io.formats import read_graph_file
from topobelief.io.map_3d import read_world_3d
from topobelief.io.nav_path import json_of_path, yaml_of_path
from topobelief.io.path_formats import read_path
from topobelief.io.reading import Droppable, Edge2Order, ReadingOptions
from topobelief.io.ros_map import write_ros_map

ROUNDS = 200
TUM = "# timestamp x y z qx qy qz qw\n" + "".join(f"{k} {k % 7} {k % 3} 0.5 0 0 0 1\n" for k in range(20))
KITTI = "".join(f"1 0 0 {k} 0 1 0 0.5 0 0 1 {k % 5}\n" for k in range(20))
KINDS = get_args(Droppable)
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
    "x0",
    "\x85",
    "\u2028",
    "\ufffd",
    "١",
    "9223372036854775808",
    "1e308",
    "5e-324",
    "0.5",
    "VERTEX_SE2",
    "EDGE_SE3:QUAT",
    "EDGE2",
    "FIX",
    "PARAMS_",
]


def database() -> bytes:
    """An RTAB-Map database with optimised poses and an odd link of each kind."""
    made = Database()
    made.optimised(-5, 1, 2, 3, 4)
    made.links.append((1, 1, 7, made.links[0][3], made.links[0][4]))
    with tempfile.TemporaryDirectory() as folder:
        return made.write(Path(folder, "map.db")).read_bytes()


def bag(format_name: str) -> bytes:
    """A bag with odometry, a path, a drawing and a map."""
    made = messages_for(format_name)
    corners = [(0.0, 0.0), (2.5, 0.0), (2.5, 2.5)]
    drawing = made.markers(
        *(made.marker("poses", number, SPHERE, at=corner) for number, corner in enumerate(corners)),
        made.marker("edges", 0, LIST, [*corners[:2], *corners[1:]]),
    )
    topics = {
        "/odom": [made.odometry(x, y) for x, y in corners],
        "/path": [made.path(corners)],
        "/graph": [drawing],
        "/map": [made.grid(np.array([[0, 100, 0], [-1, 0, 0]]))],
    }
    with tempfile.TemporaryDirectory() as folder:
        written = write_bag(Path(folder), format_name, made, topics)
        return (written if written.is_file() else max(written.iterdir(), key=lambda file: file.suffix != ".yaml")).read_bytes()


def ros_map(suffix: str) -> bytes:
    """One of the two files of a ROS map."""
    with tempfile.TemporaryDirectory() as folder:
        write_ros_map(Path(folder, "map.yaml"), np.array([[0, 100, 0], [-1, 0, 0]] * 3), resolution=0.5)
        return Path(folder, f"map{suffix}").read_bytes()


def grid() -> bytes:
    """A grid in space as NumPy saves it."""
    content = io.BytesIO()
    np.save(content, np.array([[[0, 1], [1, 0]], [[-1, 100], [0, 0]]]))
    return content.getvalue()


def nav_path() -> str:
    return yaml_of_path(np.array([[0.0, 0, 0], [1, 0, 0.5], [2, 1, 1]]))


def _graph(path: Path, rng: random.Random) -> None:
    read_graph_file(path, options(rng))


def _map_of_bag(path: Path, rng: random.Random) -> None:
    read_world(path, unknown=rng.choice(["free", "occupied"]), topic=rng.choice([None, "/map"]))


def _world(path: Path, rng: random.Random) -> None:
    read_world(path, unknown=rng.choice(["free", "occupied"]))


def _image(path: Path, rng: random.Random) -> None:
    path.with_name("map.yaml").write_bytes(MAP)
    _world(path.with_name("map.yaml"), rng)


def _with_image(path: Path, rng: random.Random) -> None:
    path.with_name("map.pgm").write_bytes(IMAGE)
    _world(path, rng)


def _map_3d(path: Path, rng: random.Random) -> None:
    read_world_3d(path, resolution=rng.choice([0.5, 2.0]), unknown=rng.choice(["free", "occupied"]))


def _path(path: Path, rng: random.Random) -> None:
    read_path(path, in_space=rng.random() < 0.5)


MAP, IMAGE = ros_map(".yaml"), ros_map(".pgm")
Reader = Callable[[Path, random.Random], None]
SEEDS: dict[str, tuple[str, bytes, Reader]] = {  # name of the file, its content, what reads it
    "g2o": ("file", PLANAR.encode(), _graph),
    "g2o in space": ("file", SPATIAL.encode(), _graph),
    "landmarks": ("file", LANDMARKS.encode(), _graph),
    "landmarks in space": ("file", LANDMARKS_IN_SPACE.encode(), _graph),
    "TORO": ("file", TORO.encode(), _graph),
    "iSAM": (
        "file",
        b"ODOMETRY 0 1 1 0 0 9 0 0 9 0 20\nConstraint2 1 2 1 0 0.5 9 1 0 9 0 20\nEDGE2 0 2 2 0 0 9 0 0 9 0 20\n",
        _graph,
    ),
    "RTAB-Map": ("file", database(), _graph),
    "TUM": ("file", TUM.encode(), _graph),
    "KITTI": ("file", KITTI.encode(), _graph),
    "slam_toolbox": ("file", slam_toolbox().encode(), _graph),
    "Cartographer": ("file", "".join(cartographer()).encode(), _graph),
    "archive": ("file", b"22 serialization::archive 17 0 0 0 0 1 2 3", _graph),
    **{name: ("file", bag(name), _graph) for name in FORMATS},
    **{f"{name}, map": ("file", bag(name), _map_of_bag) for name in FORMATS},
    "ROS map": ("map.yaml", MAP, _with_image),
    "image of a ROS map": ("map.pgm", IMAGE, _image),
    "walls": ("walls.csv", b"# bounds: 0 0 9 9\nx_min,y_min,x_max,y_max\n1,1,2,2\n3,3,5,4\n", _world),
    "grid in space": ("grid.npy", grid(), _map_3d),
    **{f"point cloud, {name}": (name, content, _map_3d) for name, content in CLOUDS.items()},
    "path in CSV": ("path.csv", b"x,y,yaw\n0,0,0\n1,0,0.5\n2,1,1\n", _path),
    "path in space, CSV": ("path.csv", b"x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n1,0,2,0,0.6,0,0.8\n", _path),
    "path in TUM": ("path.tum", TUM.encode(), _path),
    "nav_msgs/Path in YAML": ("path.yaml", nav_path().encode(), _path),
    "nav_msgs/Path in JSON": ("path.json", json_of_path(np.array([[0.0, 0, 0], [1, 0, 0.5]])).encode(), _path),
}
ALWAYS_REFUSED = ("archive",)


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
        drop=rng.sample(KINDS, rng.choice([0, 4, len(KINDS)])),
        robust_as_plain=rng.random() < 0.2,
        edge2_order=rng.choice(get_args(Edge2Order)),
        component=rng.choice(["all", "largest", 1, "x1"]),
        planar=rng.random() < 0.3,
        noise=rng.choice([None, (0.1, 0.1), (0.1, 0.1)]),
        spacing=rng.choice([0.1, 2.0]),
        closure_radius=rng.choice([None, 1.0]),
        topic=rng.choice([(), "/odom", "/path", "/graph"]),
    )


def outcome(content: bytes, path: Path, read: Reader, rng: random.Random) -> str:
    """The message of the error, or nothing."""
    path.write_bytes(content)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", ReadingWarning)
            warnings.simplefilter("ignore", MapWarning)
            read(path, rng)
    except TopobeliefError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("name", SEEDS)
def test_a_mutated_file_gives_what_it_should_or_one_line(name: str, tmp_path: Path):
    rng = random.Random(21)
    file, content, read = SEEDS[name]
    messages = [outcome(mutated(content, rng), tmp_path / file, read, rng) for _ in range(ROUNDS)]
    assert all("\n" not in message and len(message) < 1000 for message in messages)
    assert any(messages)
    assert name in ALWAYS_REFUSED or not all(messages)


def _run(rounds: int, names: list[str]) -> None:
    """Many mutations of each reader's file, with the time of the slowest and the memory of the largest."""
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            file, content, read = SEEDS[name]
            rng, slowest, refused = random.Random(1), 0.0, 0
            for number in range(rounds):
                made = mutated(content, rng)
                begin = time.process_time()
                try:
                    refused += bool(outcome(made, Path(folder, file), read, rng))
                except BaseException as error:
                    kept = Path(tempfile.gettempdir(), f"fuzz_{number}_{file}")
                    kept.write_bytes(made)
                    print(f"{name}: {kept}: {type(error).__name__}: {error}", flush=True)
                slowest = max(slowest, time.process_time() - begin)
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            print(f"{name}: {rounds} files, {refused} refused, slowest {slowest:.3f} s, peak memory {peak:.0f} MB", flush=True)


if __name__ == "__main__":
    _run(int(sys.argv[1]), sys.argv[2:] or list(SEEDS))
