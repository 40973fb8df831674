"""Databases of RTAB-Map, which `door_files` writes by its published schema."""

from __future__ import annotations

import sqlite3
import struct
import zlib
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from door_files import INFORMATION, Database, compressed, matrix
from topobelief.errors import FileError
from topobelief.geometry import SE3_GROUP
from topobelief.io.formats import read_graph_file, read_pose_graph
from topobelief.io.reading import ReadingOptions


def test_links_are_measurements_and_optimised_poses_are_taken(tmp_path: Path):
    """A link that is stored from both of its ends is one edge; a landmark among the optimised poses is none."""
    database = Database()
    database.optimised(-5, 1, 2, 3, 4)
    graph, notes = read_graph_file(database.write(tmp_path / "map.db"), ReadingOptions())
    assert graph.ids.tolist() == [1, 2, 3, 4]
    assert graph.ids[graph.edges].tolist() == [[1, 2], [2, 3], [3, 4], [4, 1]]
    np.testing.assert_allclose(graph.poses[:, :3], [[11, 1, 0.5], [12, 1, 0.5], [13, 1, 0.5], [14, 1, 0.5]], atol=1e-6)
    np.testing.assert_allclose(SE3_GROUP.rotation_vector(graph.poses)[:, 2], 0.1, atol=1e-6)
    np.testing.assert_allclose(graph.measurements[:, 0], [1, 1, 1, -2.9], atol=1e-6)
    assert (graph.information == INFORMATION).all()
    assert notes == ()


def test_without_optimised_poses_they_are_composed_from_odometry_and_links(tmp_path: Path):
    graph, notes = read_graph_file(Database().write(tmp_path / "map.db"), ReadingOptions())
    np.testing.assert_allclose(graph.poses[:, :3], [[0, 0, 0.5], [1, 0, 1], [2, 0, 1.5], [3, 0, 2]], atol=1e-6)
    assert notes == ("composed poses from odometry and links for 4 of 4 nodes without an optimised one; optimise the graph",)


def test_nodes_that_the_optimisation_left_out_are_composed_from_it(tmp_path: Path):
    database = Database()
    database.optimised(1, 2)
    graph, notes = read_graph_file(database.write(tmp_path / "map.db"), ReadingOptions())
    np.testing.assert_allclose(graph.poses[2, :2], [12 + np.cos(0.1), 1 + np.sin(0.1)], atol=1e-6)
    assert "2 of 4 nodes" in notes[0]


def test_two_measurements_between_two_nodes_stay_two(tmp_path: Path):
    database = Database()
    database.links.append((3, 1, 1, INFORMATION.tobytes(), matrix(-2)))
    database.links.append((1, 3, 1, INFORMATION.tobytes(), matrix(2.1)))
    assert read_graph_file(database.write(tmp_path / "map.db"), ReadingOptions()).graph.num_edges == 6


def test_a_robot_on_a_floor_is_projected(tmp_path: Path):
    database = Database()
    database.optimised(1, 2, 3, 4)
    graph, notes = read_graph_file(database.write(tmp_path / "map.db"), ReadingOptions(planar=True))
    assert graph.group.name == "SE(2)"
    assert graph.information[0].tolist() == [[100, 0, 7], [0, 200, 0], [7, 0, 600]]
    assert notes[0].startswith("projected onto the plane")


def test_sessions_that_no_link_joins_are_components(tmp_path: Path):
    database = Database()
    database.nodes += [(7, 1, matrix(5)), (8, 1, None), (9, 1, None)]
    database.links.append((7, 8, 0, INFORMATION.tobytes(), matrix(1)))
    database.optimised(1, 2, 3, 4)
    path = database.write(tmp_path / "map.db")
    graph, notes = read_graph_file(path, ReadingOptions(component=8))
    assert (graph.ids.tolist(), graph.poses[:, 0].tolist()) == ([7, 8], [5, 6])
    assert "left out 1 node without a link to another" in notes
    assert "kept one of 2 components: 2 of 6 poses (7 … 8)" in notes
    assert read_graph_file(path, ReadingOptions(component="largest")).graph.num_poses == 4


def test_links_to_other_things_are_refused_at_once_and_dropped_on_demand(tmp_path: Path):
    database = Database()
    database.optimised(1, 2, 3, 4)
    unit = np.eye(6).tobytes()
    database.links += [(1, 1, 7, unit, matrix(0)), (1, -5, 8, unit, matrix(0)), (1, 1, 9, unit, None), (2, 2, 9, unit, None)]
    path = database.write(tmp_path / "map.db")
    message = (
        r"got 1 absolute pose and 2 directions of gravity; leave them out with --drop priors "
        r"--drop gravity \(in Python drop=\['priors', 'gravity'\]\)"
    )
    with pytest.raises(FileError, match=message):
        read_pose_graph(path)
    graph, notes = read_graph_file(path, ReadingOptions(drop=("priors", "landmarks", "gravity")))
    assert graph.num_edges == 4
    assert len(notes) == 3


def test_tags_are_landmarks_seen_by_their_positions(tmp_path: Path):
    """Tag 5 from two nodes, once from both ends; tag 6 as RTAB-Map states a point; both numbered apart from the nodes."""
    database = Database()
    database.optimised(1, 2, 3, 4, -5)
    turned = np.diag([100.0, 200, 300, 400, 500, 600])
    turned[0, 5] = turned[5, 0] = 50
    point = np.diag([25.0, 25, 25, 1e-4, 1e-4, 1e-4])
    database.links += [
        (1, -5, 8, turned.tobytes(), matrix(0, 2, np.pi / 2)),
        (2, -6, 8, point.tobytes(), matrix(3)),
        (4, -5, 8, point.tobytes(), matrix(-3, 2)),
        (-6, 3, 8, point.tobytes(), matrix(-2)),
    ]
    path = database.write(tmp_path / "map.db")
    graph, notes = read_graph_file(path, ReadingOptions())
    assert repr(graph) == "PoseGraph(SE(3), 4 poses, 2 landmarks, 8 edges)"
    assert [graph.label(index) for index in range(6)] == ["1", "2", "3", "4", "l5", "l6"]
    assert sorted(map(tuple, graph.edges[4:].tolist())) == [(0, 4), (1, 5), (2, 5), (3, 4)]
    np.testing.assert_allclose(graph.positions[4], [5, 1, 0.5], atol=1e-6)  # as optimised
    np.testing.assert_allclose(graph.positions[5], graph.positions[1] + SE3_GROUP.rotation_matrix(graph.poses[1]) @ [3, 0, 0.5])
    first = graph.edges.tolist().index([0, 4])
    along = 100 - 50**2 / 600  # the x axis of the tag is the y axis of the node
    np.testing.assert_allclose(graph.information[first][:3, :3], np.diag([200, along, 300]), atol=1e-4)
    assert not graph.information[first][3:].any()
    back = graph.edges.tolist().index([2, 5])
    np.testing.assert_allclose(graph.measurements[back, :3], [2, 0, -0.5], atol=1e-6)
    assert notes == ("took tags for points: what is measured of their orientation is not counted",)
    planar = read_graph_file(path, ReadingOptions(planar=True)).graph
    assert (planar.num_landmarks, planar.tangent_dim) == (2, 3)
    assert read_graph_file(path, ReadingOptions(drop=("landmarks",))).graph.num_landmarks == 0


@pytest.mark.parametrize("ends", [(1, 5), (-1, -5), (0, -5), (1, -(2**40))])
def test_a_sighting_leads_from_a_node_to_a_tag(ends, tmp_path: Path):
    database = Database()
    database.links.append((*ends, 8, np.eye(6).tobytes(), matrix(1)))
    with pytest.raises(FileError, match=f"expected a node and a landmark at the ends of the link {ends[0]} - {ends[1]}"):
        read_pose_graph(database.write(tmp_path / "map.db"))


def test_the_database_is_not_touched(tmp_path: Path):
    path = Database().write(tmp_path / "map.db")
    before = path.read_bytes(), sorted(file.name for file in tmp_path.iterdir())
    path.chmod(0o444)
    read_graph_file(path, ReadingOptions())
    assert (path.read_bytes(), sorted(file.name for file in tmp_path.iterdir())) == before


def _link(**changes: object):
    names = ("from_id", "to_id", "type", "information_matrix", "transform")

    def change(database: Database) -> None:
        database.links[0] = tuple(changes.get(name, value) for name, value in zip(names, database.links[0], strict=True))

    return change


def _admin(ids: bytes, poses: bytes):
    def change(database: Database) -> None:
        database.admin = ids, poses

    return change


IDS = compressed(np.array([1, 2], dtype="<i4"))
POSES = compressed(np.zeros(12, dtype="<f4"))
MIRROR = np.diag([1, 1, -1, 0]).astype("<f4")[:3].tobytes()
BOMB = zlib.compress(bytes(10**7)) + struct.pack("<3i", 50_000, 40_000, 4)
WRONG = {
    "link to nowhere": (_link(to_id=77), "expected a node at both ends of the link 1 - 77, got none with id 77"),
    "link to itself": (_link(to_id=1), "expected a link between two nodes with ids from 1, got 1 - 1"),
    "id that is text": (_link(to_id="two"), "expected a link between two nodes with ids from 1, got 1 - 'two'"),
    "type": (_link(type=31), "expected types of links from 0 to 9, got 31 for the link 1 - 2"),
    "short information": (_link(information_matrix=b"1234"), "expected 288 bytes for the information of the link 1 - 2, got 4"),
    "no transform": (_link(transform=None), "expected 48 bytes for the transform of the link 1 - 2, got none"),
    "nan": (_link(transform=struct.pack("<12f", *[float("nan")] * 12)), "expected finite numbers for the transform"),
    "mirror": (_link(transform=MIRROR), "expected a rotation and a position within 1e9 m for the link 1 - 2"),
    "indefinite": (_link(information_matrix=bytes(288)), "positive definite .* 1 - 2, .*--drop indefinite"),
    "counts": (_admin(IDS, POSES), "expected 24 numbers in opt_poses for 2 ids, got 12"),
    "damage": (_admin(IDS[:4] + IDS[6:], POSES), "expected a compressed array in the field opt_ids .*, got damaged bytes"),
    "short": (_admin(b"12", POSES), "expected a compressed array in the field opt_ids .*, got damaged bytes"),
    "bomb": (_admin(BOMB, POSES), "expected a compressed array in the field opt_ids .*, got damaged bytes"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named(name: str, tmp_path: Path):
    change, message = WRONG[name]
    database = Database()
    change(database)
    with pytest.raises(FileError, match=message):
        read_pose_graph(database.write(tmp_path / "map.db"))


@pytest.mark.parametrize(
    ("schema", "message"),
    [
        ("CREATE TABLE photos (id INTEGER)", r"expected a database of RTAB-Map with the table Node, got tables: photos"),
        (
            "CREATE TABLE Node (id, pose); CREATE TABLE Admin (a); CREATE TABLE Link (from_id, to_id, type, rot_variance)",
            "expected the column information_matrix in the table Link, got none; open it once with a current RTAB-Map",
        ),
        ("CREATE TABLE Node (id, pose); CREATE VIEW Link AS SELECT 1; CREATE TABLE Admin (a)", "with the table Link"),
    ],
    ids=["another program", "an old version", "a view"],
)
def test_other_databases_are_refused(schema: str, message: str, tmp_path: Path):
    with closing(sqlite3.connect(tmp_path / "map.db")) as database:
        database.executescript(schema)
    with pytest.raises(FileError, match=message):
        read_pose_graph(tmp_path / "map.db")


def test_a_truncated_database_is_refused(tmp_path: Path):
    path = Database().write(tmp_path / "map.db")
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(FileError, match="got one that SQLite cannot read: database disk image is malformed"):
        read_pose_graph(path)
