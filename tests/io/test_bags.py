"""Bags of ROS 1 and 2 give graphs and maps, and say which topic they need."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from bag_files import FORMATS, Messages, messages_for, write_bag
from door_files import LIST, SPHERE, STRIP
from topobelief.errors import FileError, InvalidInputError
from topobelief.io import decompression
from topobelief.io.bag_maps import read_bag_grid
from topobelief.io.floor_plan import read_world
from topobelief.io.formats import read_graph_file
from topobelief.io.reading import ReadingOptions

NOISE = (0.02, math.radians(0.5))
PLACES = [(0, 0, 0), (1, 0, 0), (2, 0, math.pi / 2), (2, 1, math.pi / 2)]
CORNERS = [(0.0, 0.0), (2.5, 0.0), (2.5, 2.5), (0.0, 2.5)]


def options(*topics: str, **others) -> ReadingOptions:
    return ReadingOptions(topic=topics, **{"noise": NOISE, **others})


def square(made: Messages, corners=CORNERS):
    """What slam_toolbox publishes: what was there is deleted, then spheres and lines."""
    ends = [corners[index] for pair in ((0, 1), (1, 2), (2, 3), (0, 3)) for index in pair]
    spheres = [made.marker("slam_toolbox", number, SPHERE, at=corner) for number, corner in enumerate(corners)]
    return made.markers(made.marker("", 0, 0, action=3), *spheres, made.marker("edges", 0, LIST, ends))


@pytest.mark.parametrize("name", FORMATS)
def test_odometry_gives_a_pose_a_message(name: str, tmp_path: Path):
    made = messages_for(name)
    bag = write_bag(tmp_path, name, made, {"/odom": [made.odometry(*place) for place in PLACES]})
    graph, notes = read_graph_file(bag, options(planar=True))
    np.testing.assert_allclose(graph.poses, PLACES, atol=1e-12)
    assert graph.edges.tolist() == [[0, 1], [1, 2], [2, 3]]
    np.testing.assert_allclose(graph.information[0, 0, 0], NOISE[0] ** -2)
    assert notes[0] == "read all of 4 messages of '/odom' (nav_msgs/Odometry)"
    with pytest.raises(FileError, match="expected a noise for the odometry of a trajectory"):
        read_graph_file(bag, ReadingOptions())


@pytest.mark.parametrize("name", FORMATS)
def test_of_a_path_the_last_message_counts(name: str, tmp_path: Path):
    made = messages_for(name)
    bag = write_bag(tmp_path, name, made, {"/path": [made.path(PLACES[:2]), made.path(PLACES)]})
    graph, notes = read_graph_file(bag, options(planar=True))
    np.testing.assert_allclose(graph.poses, PLACES, atol=1e-12)
    assert notes[0] == "read the last of 2 messages of '/path' (nav_msgs/Path)"


@pytest.mark.parametrize("release", ["ROS1_NOETIC", "ROS2_FOXY", "ROS2_HUMBLE", "ROS2_JAZZY"])
def test_markers_of_every_release_draw_the_graph(release: str, tmp_path: Path):
    made = Messages(release)
    first = square(made, [(x + 0.1, y) for x, y in CORNERS])
    bag = write_bag(tmp_path, "ROS 1" if made.ros_1 else "ROS 2 MCAP", made, {"/graph": [first, square(made)]})
    graph, _ = read_graph_file(bag, ReadingOptions())
    assert graph.positions.tolist() == [list(corner) for corner in CORNERS]
    assert sorted(map(sorted, graph.edges.tolist())) == [[0, 1], [0, 3], [1, 2], [2, 3]]


def test_two_topics_of_cartographer_draw_one_graph(tmp_path: Path):
    made = Messages()
    poses = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.1)]
    ends = [(0.5, 0.5), poses[0], (0.5, 0.5), poses[1], (1.5, 0.5), poses[1], (1.5, 0.5), poses[2]]
    topics = {
        "/trajectory_node_list": [made.markers(made.marker("Trajectory 0", 0, STRIP, poses))],
        "/constraint_list": [made.markers(made.marker("Intra constraints", 0, LIST, ends))],
        "/odom": [made.odometry(*place) for place in PLACES],
    }
    bag = write_bag(tmp_path, "ROS 2 SQLite", made, topics)
    graph, _ = read_graph_file(bag, options("/trajectory_node_list", "/constraint_list"))
    assert (graph.num_poses, graph.num_edges) == (5, 6)
    message = r"got /constraint_list \(MarkerArray\), /odom \(Odometry\), /traj.* \(MarkerArray\); choose one with --topic NAME"
    with pytest.raises(FileError, match=message):
        read_graph_file(bag, options())
    with pytest.raises(FileError, match=r"expected a topic among .*, got /map$"):
        read_graph_file(bag, options("/map"))
    with pytest.raises(FileError, match="expected one topic, or several of type MarkerArray, got /odom and /constraint_list"):
        read_graph_file(bag, options("/odom", "/constraint_list"))
    with pytest.raises(FileError, match="expected a topic with messages of type OccupancyGrid, got none among 3 topics"):
        read_world(bag)


@pytest.mark.parametrize("name", FORMATS)
def test_an_occupancy_grid_is_a_map(name: str, tmp_path: Path):
    made = messages_for(name)
    cells = np.full((4, 6), 0)
    cells[:, 0], cells[0, 1], cells[1, 1], cells[2, 1] = 100, -1, 64, 26
    grids = [made.grid(np.full((4, 6), 100)), made.grid(cells, 0.05, (1.0, 2.0, math.pi / 2))]
    bag = write_bag(tmp_path, name, made, {"/map": grids, "/costmap": grids[:1]})
    with pytest.raises(FileError, match=r"got /costmap \(OccupancyGrid\), /map \(OccupancyGrid\); choose one with --map-topic"):
        read_world(bag)
    grid = read_bag_grid(bag, topic="/map")
    assert grid.cells.tolist() == [[100, -1, 0, 0, 0, 0], [100, -1, 0, 0, 0, 0], [100, -1, 0, 0, 0, 0], [100] + [0] * 5]
    assert grid.resolution == 0.05
    np.testing.assert_allclose(grid.origin, (1, 2, math.pi / 2))
    world = read_world(bag, topic="/map")
    np.testing.assert_allclose(world.free.area, 17 * 0.05**2)
    np.testing.assert_allclose(read_world(bag, topic="/map", unknown="free").free.area, 20 * 0.05**2)
    np.testing.assert_allclose(world.bounds, (0.8, 2.0, 1.0, 2.3))


@pytest.mark.parametrize("name", FORMATS)
def test_a_bag_is_told_by_its_content_and_may_be_the_file_within_the_folder(name: str, tmp_path: Path):
    made = messages_for(name)
    bag = write_bag(tmp_path, name, made, {"/odom": [made.odometry(*place) for place in PLACES]})
    file = bag if bag.is_file() else next(path for path in bag.iterdir() if path.name != "metadata.yaml")
    graph, _ = read_graph_file(shutil.copy(file, tmp_path / "recording"), options())
    assert graph.num_poses == 4
    damaged = tmp_path / "damaged"
    damaged.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with pytest.raises(FileError, match=r"expected a bag that can be read, got a damaged one .* reindex"):
        read_graph_file(damaged, options())


@pytest.mark.parametrize("compression", ["lz4", "bz2", "file", "message"])
def test_compressed_bags_are_read(compression: str, tmp_path: Path):
    name = "ROS 1" if compression in ("lz4", "bz2") else "ROS 2 SQLite"
    made = messages_for(name)
    topics = {"/odom": [made.odometry(*place) for place in PLACES], "/map": [made.grid(np.zeros((2, 2)))]}
    bag = write_bag(tmp_path, name, made, topics, compression=compression)
    assert read_graph_file(bag, options()).graph.num_poses == 4
    assert read_bag_grid(bag).cells.tolist() == [[0, 0], [0, 0]]


@pytest.mark.parametrize("compression", ["lz4", "bz2", "file", "message", "storage"])
def test_a_bag_that_decompresses_to_far_more_than_its_size_is_refused(compression: str, tmp_path: Path, monkeypatch):
    """5 MB of zeros in a few kilobytes; what other programs read by rosbags is as before."""
    name = {"lz4": "ROS 1", "bz2": "ROS 1", "storage": "ROS 2 MCAP"}.get(compression, "ROS 2 SQLite")
    made = messages_for(name)
    topics = {"/odom": [made.odometry(*place) for place in PLACES], "/map": [made.grid(np.zeros((2200, 2200)))]}
    bag = write_bag(tmp_path, name, made, topics, compression=compression)
    assert read_bag_grid(bag).cells.size == 4_840_000
    monkeypatch.setattr(decompression, "_ALWAYS", 1_000_000)
    with pytest.raises(FileError, match=r"expected a bag that decompresses to at most \d+ MB \(100 times its size, or 1 MB\)"):
        read_bag_grid(bag)
    with AnyReader([bag]) as reader:
        assert sum(len(data) for _, _, data in reader.messages()) > 4_840_000


def test_a_topic_without_messages_is_passed_over(tmp_path: Path):
    made = Messages()
    bag = write_bag(tmp_path, "ROS 2 MCAP", made, {"/odom": [made.odometry(0, 0), made.odometry(1, 0)], "/path": []})
    assert read_graph_file(bag, options()).graph.num_poses == 2


def test_messages_with_impossible_numbers_are_named(tmp_path: Path):
    made = Messages()
    still = made.pose(1, 0)
    still.orientation.w = 0.0
    lost = made.make("geometry_msgs/msg/PoseStamped", pose=still)
    path = made.path(PLACES[:1])
    path.poses.append(lost)
    stray = made.markers(made.marker("edges", 0, LIST, [(0, 0), (math.nan, 0)]))
    topics = {"/turned": [path], "/empty": [made.path([])], "/far": [made.odometry(1e12, 0)], "/stray": [stray]}
    grid = made.grid(np.zeros((2, 2)))
    grid.info.width = 3
    bag = write_bag(tmp_path, "ROS 2 MCAP", made, topics | {"/map": [grid]})
    for topic, message in {
        "/turned": "expected a quaternion of length 1, got one of 0; .* at pose 1 of '/turned'",
        "/empty": "expected at least one pose in the last message of '/empty', got none",
        "/far": "expected positions within 1e.09 m of the origin, got one beyond at pose 0 of '/far'",
        "/stray": "expected numbers within 1e.09 m, got another in marker 0 of '/stray'",
    }.items():
        with pytest.raises(FileError, match=message):
            read_graph_file(bag, options(topic))
    with pytest.raises(FileError, match="expected 2 x 3 cells in the last message of '/map', got 4"):
        read_world(bag)


def test_without_rosbags_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    made = Messages()
    bag = write_bag(tmp_path, "ROS 2 MCAP", made, {"/odom": [made.odometry(*place) for place in PLACES]})
    monkeypatch.setitem(__import__("sys").modules, "rosbags.rosbag2", None)
    with pytest.raises(
        InvalidInputError, match=r"expected rosbags to be installed, got none; run pip install 'topobelief\[ros\]'"
    ):
        read_graph_file(bag, options())
